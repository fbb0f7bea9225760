#!/usr/bin/env bash
# Builds the bench, checks that GPU and CPU agree, and prints the time of a solve on this machine's GPU: each time
# beside the result's error, each stage beside its lower bound. The same goes to benches/results/gpu-NAME.md. Arguments
# are passed to the bench. Beside it stands the paper's solver. `cargo run --release -p vrtm-render` prints what drawing
# through the map costs:
#
#     benches/gpu.sh                      # all sizes to 4096, about 5 minutes
#     benches/gpu.sh --sizes 512,2048
#     benches/gpu.sh --software           # on a software driver: dispatches and bytes are a GPU's, and times say nothing
#     VRTM_BENCH=path/to/gpu benches/gpu.sh    # with a program built elsewhere
set -euo pipefail
cd "$(dirname "$0")/.."
if [ -n "${VRTM_BENCH:-}" ]; then
    exec "$VRTM_BENCH" "$@"
fi
cargo bench -p vrtm-benches --bench gpu -- "$@"
