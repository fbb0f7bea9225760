#!/bin/sh
# Prints a Python that makes wheels: that of a virtual environment which tests/python/setup.sh has made, or python3.
# Variables: VRTM_VENV, the environment (target/venv).
target=${CARGO_TARGET_DIR:-$(cd "$(dirname "$0")/../.." && pwd)/target}
for candidate in "${VRTM_VENV:-$target/venv}/bin/python" "$target/venv-short/bin/python" python3; do
    "$candidate" -c 'import hatchling, numpy, pip, pycparser, tomllib' 2>/dev/null || continue
    command -v "$candidate"
    exit
done
echo "skipped: the wheel and the add-on: there is no Python with hatchling, numpy and pycparser" >&2
echo "test result: ok. 0 passed; 0 failed; 1 ignored" >&2
