#!/bin/sh
# Makes the virtual environment that tests in Python run in: Blender as a Python module, OpenImageIO, MaterialX, USD and
# what is small beside these; about 450 MB to load and 1.5 GB on disk. The short one has what the package itself needs, and
# those named after a version of Blender (350 MB, 1 GB) that version alone.
#
#     tests/python/setup.sh FOLDER [requirements.txt|short.txt|blender-VERSION.txt]
#
# The variable PYTHON may name a Python of the version that is wanted, for where neither the PATH nor pyenv has it. Prints
# nothing if the environment is there. Where it cannot be made, prints one line that says why, and ends with exit code 3.
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
asked() { # FILE: it, and those that it names
    cat "$here/$1"
    for more in $(sed -n 's/^-r //p' "$here/$1"); do asked "$more"; done
}
if asked "$requirements" | cmp -s - "$stamp"; then
    exit 0
fi
version=$(sed -n 's/^# For Python \(3\.[0-9]*\).*/\1/p' "$here/$requirements")
# pyenv's commands run this version.
export PYENV_VERSION="$version"
for python in "python$version" ${PYTHON:+"$PYTHON"} ''; do
    [ -n "$python" ] || cannot "Python $version is not there"
    ! "$python" -c "import sys; sys.exit(sys.version_info[:2] != tuple(map(int, '$version'.split('.'))))" 2>/dev/null ||
        break
done
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
! asked "$requirements" | grep -q '^bpy=' || "$folder/bin/python" -c 'import bpy' >"$log" 2>&1 ||
    cannot "Blender's Python module does not load: $(tail -n 1 "$log")"
asked "$requirements" >"$stamp"
