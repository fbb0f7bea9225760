#!/bin/sh
# Makes the virtual environment that tests in Python run in: Blender as a Python module, OpenImageIO, MaterialX, USD and
# what is small beside these; about 450 MB to load and 1.5 GB on disk. The short one has what the package itself needs.
#
#     tests/python/setup.sh FOLDER [requirements.txt|short.txt]
#
# Prints nothing if it is there. Where it cannot be made, prints one line that says why, and ends with exit code 3.
set -eu
here=$(cd "$(dirname "$0")" && pwd)
folder=${1:?setup.sh FOLDER}
requirements=${2:-requirements.txt}
stamp=$folder/$requirements

cannot() {
    echo "$1"
    exit 3
}

# Several may want it at the same time.
mkdir -p "$folder"
exec 9>"$folder/lock"
! command -v flock >/dev/null || flock 9
asked() {
    cat "$here/short.txt"
    [ "$requirements" = short.txt ] || cat "$here/$requirements"
}
if asked | cmp -s - "$stamp"; then
    exit 0
fi
python=${PYTHON:-python3.11}
"$python" -c 'import sys; sys.exit(sys.version_info[:2] != (3, 11))' 2>/dev/null ||
    cannot "$python is not there or is not Python 3.11"
case $(uname -sm) in
    "Linux x86_64" | "Darwin arm64") ;;
    *) cannot "Blender's Python module is not made for $(uname -sm)" ;;
esac
rm -f "$stamp"
log=$(mktemp)
trap 'rm -f "$log"' EXIT
"$python" -m venv "$folder" >"$log" 2>&1 || cannot "no virtual environment: $(tail -n 1 "$log")"
limit=
! command -v timeout >/dev/null || limit="timeout ${VRTM_SETUP_SECONDS:-900}"
$limit "$folder/bin/pip" install --quiet --disable-pip-version-check --retries 1 --timeout 15 --no-deps \
    -r "$here/$requirements" >"$log" 2>&1 || cannot "the packages cannot be had: $(tail -n 1 "$log" | cut -c1-200)"
[ "$requirements" = short.txt ] || "$folder/bin/python" -c 'import bpy' >"$log" 2>&1 || cannot "Blender's Python module does not load: $(tail -n 1 "$log")"
asked >"$stamp"
