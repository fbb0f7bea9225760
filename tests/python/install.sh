#!/bin/sh
# Installs the Python package with pip, as a user would, into the virtual environment that setup.sh made.
#
#     tests/python/install.sh FOLDER
#
# VRTM_LIBRARY names a shared library that is built already; else cargo builds one with the tests' profile. The exit code is
# 0 if it is installed; what cannot be done is said.
set -u
here=$(cd "$(dirname "$0")" && pwd)
repository=$(cd "$here/../.." && pwd)
target=${CARGO_TARGET_DIR:-$repository/target}
venv=${1:?install.sh FOLDER}

if [ -z "${VRTM_LIBRARY:-}" ]; then
    (cd "$repository" && cargo build --quiet --package vrtm-c) || {
        echo "FAILED python: the library does not build"
        exit 1
    }
    VRTM_LIBRARY=$(ls "$target"/debug/libvrtm.so "$target"/debug/libvrtm.dylib 2>/dev/null | head -n 1)
fi
export VRTM_LIBRARY PYTHONDONTWRITEBYTECODE=1
# A wheel, built without looking for anything outside of the environment.
wheels=$target/python
rm -rf "$wheels"
"$venv/bin/pip" wheel --quiet --disable-pip-version-check --no-deps --no-build-isolation --wheel-dir "$wheels" \
    "$repository/bindings/python" &&
    "$venv/bin/pip" install --quiet --disable-pip-version-check --no-deps --no-index --force-reinstall "$wheels"/*.whl || {
    echo "FAILED python: the package cannot be installed"
    exit 1
}
