#!/bin/sh
# Builds the library with CMake, installs it to a scratch folder and runs the tests of the package with ctest. Without the
# GPU backend, whose functions have the same names. `sh tests/package/run.sh FOLDER` works in FOLDER, target/package as a rule.
set -eu
# What counts is the time to build.
export CARGO_INCREMENTAL=0 CARGO_PROFILE_DIST_OPT_LEVEL=1
# That release.sh strips a library, too, is tested.
export CARGO_PROFILE_DIST_STRIP=debuginfo

source=$(cd "$(dirname "$0")/../.." && pwd)
folder=${1:-$source/target/package}
cmake -S "$source" -B "$folder" -DVRTM_GPU=OFF -DVRTM_TESTS=ON \
    "-DVRTM_PYTHON=$(sh "$source/tests/package/python.sh")"
ctest --test-dir "$folder" --parallel 2 --output-on-failure --no-tests=error
