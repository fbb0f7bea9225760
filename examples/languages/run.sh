#!/bin/sh
# Runs the programs of the languages that are there, and compares the numbers that they print with expected.txt.
#
#     examples/languages/run.sh [cpp|rust|python|javascript|csharp]...
#
# The library VRTM_LIBRARY is that of C++ and C#; the others have what their steps of .ci/run have built: the example of
# cargo test, the package in the environment VRTM_VENV (target/venv), bindings/web/dist.
set -u
here=$(cd "$(dirname "$0")" && pwd)
repository=$(cd "$here/../.." && pwd)
target=${CARGO_TARGET_DIR:-$repository/target}
venv=${VRTM_VENV:-$target/venv}
bindings=$repository/bindings
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
for name in libvrtm.so libvrtm.so.0 libvrtm.dylib libvrtm.0.dylib; do
    ln -s "${VRTM_LIBRARY:-/no/library}" "$folder/$name"
done
export LD_LIBRARY_PATH="$folder" DYLD_LIBRARY_PATH="$folder"

# Each prints its program's lines, or "missing: ...".
cpp() {
    [ -f "${VRTM_LIBRARY:-}" ] || { echo "missing: VRTM_LIBRARY" && return; }
    "${CXX:-c++}" -std=c++17 -Wall -Wextra -pedantic -Werror -I "$repository/include" "$here/sheet.cpp" \
        -o "$folder/sheet" "$VRTM_LIBRARY" && "$folder/sheet"
}
rust() {
    [ -x "$target/debug/examples/languages" ] || { echo "missing: cargo test --no-run builds it" && return; }
    "$target/debug/examples/languages"
}
python() {
    "$venv/bin/python" -c "import vrtm" 2>/dev/null || { echo "missing: sh tests/python/run.sh installs it" && return; }
    "$venv/bin/python" "$here/sheet.py"
}
javascript() {
    [ -f "$bindings/web/dist/worker.js" ] || { echo "missing: npm run build, in bindings/web" && return; }
    node "$here/sheet.mjs"
}
csharp() {
    command -v mcs >/dev/null || { echo "missing: mono" && return; }
    [ -f "${VRTM_LIBRARY:-}" ] || { echo "missing: VRTM_LIBRARY" && return; }
    python=$venv/bin/python
    "$python" -c "import pycparser" 2>/dev/null || python=python3
    "$python" "$bindings/csharp/generate.py" "$folder/Vrtm.cs" &&
        mcs -unsafe -warnaserror -nowarn:0169,0649 -out:"$folder/sheet.exe" "$folder/Vrtm.cs" \
            "$bindings/csharp/Asset.cs" "$here/Sheet.cs" && mono "$folder/sheet.exe"
}

passed=0 failed=0 skipped=0
[ $# != 0 ] || set -- cpp rust python javascript csharp
for language in "$@"; do
    "$language" >"$folder/said" 2>"$folder/log"
    status=$?
    # One unit of the last digit: sums in another order may be rounded otherwise.
    if grep -q '^missing: ' "$folder/said"; then
        echo "skipped: $language: $(sed 's/^missing: //' "$folder/said")"
        skipped=$((skipped + 1))
    elif [ $status = 0 ] && paste -d '|' "$here/expected.txt" "$folder/said" | awk -F '|' '
        {
            if (split($1, a, " ") != split($2, b, " ") || $2 == "") bad = 1
            for (k in a) if (a[k] != b[k] && (a[k] - b[k]) ^ 2 > 1.5e-4 ^ 2 || b[k] !~ /^(preview|[0-9.]+)$/) bad = 1
            if (bad) { print "line " NR ": " $2 "\n  expected: " $1; exit 1 }
        }'; then
        echo "test languages $language ... ok"
        passed=$((passed + 1))
    else
        cat "$folder/log"
        echo "test languages $language ... FAILED (exit code $status)"
        failed=$((failed + 1))
    fi
done
[ $failed = 0 ] && result=ok || result=FAILED
echo "test result: $result. $passed passed; $failed failed; $skipped ignored"
[ $failed = 0 ]
