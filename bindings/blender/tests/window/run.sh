#!/bin/sh
# Runs the add-on in Blender's window, which is drawn into memory by Mesa's software driver: those in checks.py,
# each in a Blender of its own. Ends with how many passed, as cargo's tests do; the exit code is 0 if none failed.
#
#     run.sh [CHECK...]          # all checks, or those whose names are given
#
# Variables: VRTM_BLENDER_WINDOW, the folder of setup.sh's Debian (target/blender-window); VRTM_WHEEL, the wheel of the
# Python package (the newest in target/python); VRTM_PICTURES, a folder for screenshots; VRTM_REQUIRE_WINDOW=1: what would
# be skipped fails.
set -u
here=$(cd "$(dirname "$0")" && pwd)
repository=$(cd "$here/../../../.." && pwd)
target=${CARGO_TARGET_DIR:-$repository/target}
root=${VRTM_BLENDER_WINDOW:-$target/blender-window}
# The longest that one Blender may take, in seconds.
seconds=${VRTM_WINDOW_SECONDS:-240}

finish() { # PASSED FAILED SKIPPED
    result=ok
    [ "$2" = 0 ] || result=FAILED
    echo "test result: $result. $1 passed; $2 failed; $3 ignored"
    [ "$2" = 0 ]
    exit
}
skip() {
    if [ "${VRTM_REQUIRE_WINDOW:-0}" = 1 ]; then
        echo "FAILED window: $1"
        finish 0 1 0
    fi
    echo "skipped: the add-on in a window: $1"
    finish 0 0 1
}

why=$(sh "$here/setup.sh" "$root") || skip "$why"
wheel=${VRTM_WHEEL:-$(ls -t "$target"/python/vrtm-*.whl 2>/dev/null | head -n 1)}
[ -n "$wheel" ] || skip "there is no wheel of the Python package: tests/python/run.sh makes one"
out=$(mktemp -d)
trap 'rm -rf "$out"' EXIT
python3 "$repository/bindings/blender/build.py" --wheel "$wheel" --out "$out" >"$out/build.log" 2>&1 || {
    cat "$out/build.log"
    finish 0 1 0
}
mv "$out"/vrtm-*.zip "$out/vrtm.zip"
names=${*:-$(sed -n 's/^def check_\([a-z_]*\).*/\1/p' "$here/checks.py")}
passed=0 failed=0
for name in $names; do
    start=$(date +%s)
    # Mounts are seen by these processes alone, and end with them; so do all processes, since their first one ends.
    timeout -k 10 "$seconds" unshare --mount --pid --fork --kill-child sh -eu -c '
        mkdir -p "$1/vrtm/bindings/blender" "$1/out"
        mount -t proc proc "$1/proc"
        mount --rbind /dev "$1/dev"
        mount --bind "$2" "$1/vrtm/bindings/blender"
        mount --bind "$3" "$1/out"
        exec chroot "$1" env -i PATH=/usr/bin:/bin HOME=/tmp LANG=C.UTF-8 LIBGL_ALWAYS_SOFTWARE=1 XDG_RUNTIME_DIR=/tmp \
            sh /vrtm/bindings/blender/tests/window/inside.sh "$4"
    ' run "$root" "$repository/bindings/blender" "$out" "$name" >"$out/$name.log" 2>&1
    code=$?
    took=$(($(date +%s) - start))
    if [ "$code" = 0 ] && grep -q "^ok $name" "$out/$name.log"; then
        grep "^ok $name" "$out/$name.log"
        passed=$((passed + 1))
    else
        tail -n 40 "$out/$name.log"
        echo "FAILED window: $name: exit code $code after $took s"
        failed=$((failed + 1))
    fi
    [ -z "${VRTM_PICTURES:-}" ] || { mkdir -p "$VRTM_PICTURES" && cp "$out"/*.png "$VRTM_PICTURES" 2>/dev/null; }
done
finish $passed $failed 0
