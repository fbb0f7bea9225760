#!/bin/sh
# Makes a virtual environment with zig's clang, which has the C and C++ headers of Linux, macOS and Windows with it: 90
# MB to load and 450 MB on disk.
#
#     tests/compilers/setup.sh FOLDER
#
# Prints where the compiler is. Where it cannot be had, prints one line that says why, and ends with exit code 3.
set -eu
version=0.17.1
folder=${1:?setup.sh FOLDER}

cannot() {
    echo "$1"
    exit 3
}

found() {
    "$folder/bin/python" -c 'import os, ziglang; print(os.path.dirname(ziglang.__file__) + "/zig")' 2>/dev/null
}

if zig=$(found) && [ "$("$zig" version)" = "$version" ]; then
    echo "$zig"
    exit 0
fi
log=$(mktemp)
trap 'rm -f "$log"' EXIT
python=${PYTHON:-python3}
"$python" -m venv "$folder" >"$log" 2>&1 || cannot "no virtual environment: $(tail -n 1 "$log")"
limit=
! command -v timeout >/dev/null || limit="timeout ${VRTM_SETUP_SECONDS:-300}"
$limit "$folder/bin/pip" install --quiet --disable-pip-version-check --retries 1 --timeout 15 --only-binary :all: \
    "ziglang==$version" >"$log" 2>&1 || cannot "the package ziglang cannot be had: $(tail -n 1 "$log" | cut -c1-200)"
found || cannot "the package ziglang does not load"
