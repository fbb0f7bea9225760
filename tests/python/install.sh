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
wheels=$target/python
built=$target/python-built
mkdir -p "$wheels"
# Several may install it at the same time.
exec 9>"$wheels/lock"
! command -v flock >/dev/null || flock 9
# A wheel, built without looking for anything outside of the environment. The same files make the same wheel: what uses an
# installed one is then not disturbed.
rm -rf "$built"
"$venv/bin/pip" wheel --quiet --disable-pip-version-check --no-deps --no-build-isolation --wheel-dir "$built" \
    "$repository/bindings/python" || {
    echo "FAILED python: the wheel cannot be built"
    exit 1
}
wheel=$(basename "$built"/*.whl)
cmp -s "$built/$wheel" "$wheels/$wheel" || {
    rm -f "$wheels"/*.whl
    mv "$built/$wheel" "$wheels/"
}
cmp -s "$wheels/$wheel" "$venv/$wheel" || {
    "$venv/bin/pip" install --quiet --disable-pip-version-check --no-deps --no-index --force-reinstall "$wheels/$wheel" &&
        cp "$wheels/$wheel" "$venv/"
} || {
    echo "FAILED python: the package cannot be installed"
    exit 1
}
