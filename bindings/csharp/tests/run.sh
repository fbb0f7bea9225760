#!/bin/sh
# Generates Vrtm.cs, compiles it with Asset.cs, the component for Unity and the tests with mono's compiler, and runs them with the
# library VRTM_LIBRARY.
set -eu
here=$(cd "$(dirname "$0")" && pwd)
bindings=$here/..
if ! command -v mcs >/dev/null; then
    echo "test csharp ... skipped: there is no mcs (mono)"
    echo "test result: ok. 0 passed; 0 failed; 1 ignored"
    exit 0
fi
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
python=${VRTM_PYTHON:-python3}
"$python" -c 'import pycparser' 2>/dev/null || {
    "$python" -m venv "$folder/venv" && "$folder/venv/bin/pip" install --quiet pycparser
    python=$folder/venv/bin/python
}
"$python" "$bindings/generate.py" "$folder/Vrtm.cs"
mcs -unsafe -warnaserror -nowarn:0169,0649 -out:"$folder/test.exe" "$folder/Vrtm.cs" "$bindings/Asset.cs" \
    "$here/../../../examples/hosts/unity/VrtmSkin.cs" "$here/StandIns.cs" "$here/Program.cs"
ln -s "${VRTM_LIBRARY:?the library}" "$folder/libvrtm.so"
LD_LIBRARY_PATH=$folder mono "$folder/test.exe"
