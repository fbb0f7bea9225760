#!/bin/sh
# Makes the package for Unity of the library VRTM_LIBRARY, unpacks it, looks at its meta files, compiles what it has with
# mono's compiler, as Unity would and for other programs, and runs the tests with its library.
set -eu
here=$(cd "$(dirname "$0")" && pwd)
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
"$python" "$here/../../unity.py" --out "$folder" "x86_64-unknown-linux-gnu=${VRTM_LIBRARY:?the library}" >"$folder/name"
tar -xzf "$(cat "$folder/name")" -C "$folder"
cd "$folder/package"
# Unity leaves out what has no meta file of its own.
find . -mindepth 1 ! -name '*.meta' | sed 's/$/.meta/' | sort >"$folder/needed"
find . -name '*.meta' | sort | diff "$folder/needed" - || exit 1
twice=$(find . -name '*.meta' -exec sed -n 's/^guid: //p' {} + | sort | uniq -d)
[ -z "$twice" ] || { echo "two files have the guid $twice"; exit 1; }
mcs -unsafe -warnaserror -nowarn:0169,0649 -target:library -out:"$folder/plain.dll" Runtime/Vrtm.cs Runtime/Asset.cs
mcs -unsafe -warnaserror -nowarn:0169,0649 -define:UNITY_5_3_OR_NEWER -out:"$folder/test.exe" Runtime/*.cs \
    "$here/StandIns.cs" "$here/Program.cs"
LD_LIBRARY_PATH=$folder/package/Plugins/linux-x64 mono "$folder/test.exe"
