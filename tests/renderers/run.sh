#!/bin/sh
# Runs the recipes of docs/rendering: a line per check ("ok ...", "FAILED ..." or "... skipped: why"), and at the end how
# many there were. The exit code is 0 if none failed.
#
#     tests/renderers/run.sh
#
# Variables: VRTM_VENV, the folder of the virtual environment (target/venv), which tests/python/setup.sh makes; VRTM_LIBRARY,
# a shared library that is built already, for the Python package, whose `vrtm bake` writes the maps (else cargo builds one);
# VRTM_REQUIRE_RENDERERS=1: what would be skipped fails.
set -u
here=$(cd "$(dirname "$0")" && pwd)
repository=$(cd "$here/../.." && pwd)
target=${CARGO_TARGET_DIR:-$repository/target}
venv=${VRTM_VENV:-$target/venv}
work=$target/renderers/work
log=$(mktemp)
trap 'rm -f "$log"' EXIT
# The longest that a single file of checks may take, in seconds: EEVEE compiles its shaders on the CPU, for more than two
# minutes where other programs use it, too.
seconds=${VRTM_RENDERER_SECONDS:-400}

finish() {
    passed=$(grep -c '^ok ' "$log")
    failed=$(grep -c '^FAILED ' "$log")
    skipped=$(grep -c '^[^ ].* skipped: ' "$log")
    if [ "${VRTM_REQUIRE_RENDERERS:-0}" = 1 ] && [ "$skipped" != 0 ]; then
        failed=$((failed + skipped)) skipped=0
    fi
    result=ok
    [ "$failed" = 0 ] || result=FAILED
    echo "test result: $result. $passed passed; $failed failed; $skipped ignored"
    [ "$failed" = 0 ]
    exit
}

say() {
    echo "$1" | tee -a "$log"
}

why=$(sh "$here/../python/setup.sh" "$venv") || {
    say "renderers skipped: $why"
    finish
}
installed=$(sh "$here/../python/install.sh" "$venv") || {
    say "FAILED renderers: $installed"
    finish
}
# Blender 4.5 has no working colour spaces, and another name for EEVEE.
newest=$venv-blender-5.2
why=$(sh "$here/../python/setup.sh" "$newest" blender-5.2.txt) || newest=
limited() {
    if command -v timeout >/dev/null; then
        timeout "$seconds" "$@"
    else
        "$@"
    fi
}

export PYTHONDONTWRITEBYTECODE=1
rm -rf "$work"
mkdir -p "$work"
if ! limited "$venv/bin/python" "$here/fixture.py" "$work" >"$work/log" 2>&1; then
    tail -n 5 "$work/log"
    say "FAILED renderers: the model cannot be baked"
    finish
fi
for name in cycles layers asset normals displacement shaders materialx osl oiio usd eevee; do
    start=$(date +%s) python=$venv/bin/python
    case $name in cycles | eevee)
        [ -n "$newest" ] || { say "$name skipped: $why" && continue; }
        python=$newest/bin/python
        ;;
    esac
    limited "$python" "$here/check_$name.py" "$work" >"$work/$name.log" 2>&1
    code=$?
    grep -v -e '^end$' -e '^EGL Error' -e '^$' "$work/$name.log" | tee -a "$log"
    if grep -q '^end$' "$work/$name.log"; then
        :
    elif [ "$name" = eevee ] && ! grep -q '^eevee draws' "$work/$name.log"; then
        say "eevee skipped: Blender found no driver that draws, or took longer than $seconds s (exit code $code)"
    else
        say "FAILED $name: ended after $(($(date +%s) - start)) s with exit code $code"
    fi
done
finish
