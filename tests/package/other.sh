#!/bin/sh
# The tests of the package for another system, with a library for it that is built already, and its compilers, which
# toolchain files name: an emulator runs its programs.
#
#     tests/package/other.sh windows|arm64 [FOLDER]
#
# Windows: MinGW-w64 and Wine; ARM64: GNU's compilers and QEMU. Variables: VRTM_OTHER_LIBRARY, the library as cargo
# names it, with its import library beside it (that which tests/targets/run.sh has built); VRTM_VENV, the virtual
# environment that tests/python/setup.sh makes (target/venv), for the wheel. Where something cannot be had, a line
# "skipped: why" counts as ignored.
set -u
here=$(cd "$(dirname "$0")" && pwd)
source=$(cd "$here/../.." && pwd)
system=${1:?other.sh windows|arm64 [FOLDER]}
target=${CARGO_TARGET_DIR:-$source/target}
folder=${2:-$target/package-$system}

skip() {
    echo "skipped: the package for $system: $*"
    echo "test result: ok. 0 passed; 0 failed; 1 ignored"
    exit 0
}
case $system in
    windows) triple=x86_64-pc-windows-gnu file=vrtm.dll programs='x86_64-w64-mingw32-gcc-posix x86_64-w64-mingw32-g++-posix' ;;
    arm64) triple=aarch64-unknown-linux-gnu file=libvrtm.so programs='aarch64-linux-gnu-gcc aarch64-linux-gnu-g++' ;;
    *) echo "other.sh: $system is neither windows nor arm64" >&2; exit 2 ;;
esac
library=${VRTM_OTHER_LIBRARY:-$target/targets/$system/$triple/release/$file}
[ -f "$library" ] || skip "there is no $library"
library=$(cd "$(dirname "$library")" && pwd)/$file
for program in $programs cmake; do
    command -v "$program" >/dev/null || skip "there is no $program"
done

mkdir -p "$folder"
folder=$(cd "$folder" && pwd)
case $system in
    arm64)
        emulator=$(command -v qemu-aarch64-static || command -v qemu-aarch64) || skip "there is no qemu-aarch64"
        # The compiler's C library, where this machine has none for ARM64; without the second variable, its loader would take
        # libraries that this machine's cache of them names.
        if ! [ -e /lib/ld-linux-aarch64.so.1 ]; then
            prefix=$(aarch64-linux-gnu-gcc -print-sysroot)
            [ -n "${prefix%/}" ] || prefix=/usr/aarch64-linux-gnu
            export QEMU_LD_PREFIX="$prefix" QEMU_SET_ENV="LD_LIBRARY_PATH=$prefix/lib"
        fi
        ;;
    windows)
        emulator=/usr/lib/wine/wine64 server=/usr/lib/wine/wineserver64
        [ -x "$emulator" ] || emulator=$(command -v wine64 || command -v wine) || skip "there is no wine"
        [ -x "$server" ] || server=$(command -v wineserver)
        export WINEPREFIX="$folder/wine" WINEDEBUG=-all WINEDLLOVERRIDES='mscoree=;mshtml=;winemenubuilder.exe='
        end_wine() {
            { "$server" -k; "$server" -w; } 2>/dev/null
            rm -rf "$WINEPREFIX"
        }
        trap end_wine EXIT
        timeout 300 "$emulator" cmd /c exit >"$folder/log" 2>&1 || skip "Wine makes no folder for Windows"
        # Wine before 9 lacks a library that Windows has.
        if ! [ -f "$WINEPREFIX/drive_c/windows/system32/bcryptprimitives.dll" ]; then
            x86_64-w64-mingw32-gcc-posix -O1 -shared "$source/tests/targets/process_prng.c" -ladvapi32 \
                -o "$WINEPREFIX/drive_c/windows/system32/bcryptprimitives.dll" || exit 1
        fi
        ;;
esac
python=$(sh "$here/python.sh")
cmake -S "$source" -B "$folder" "-DCMAKE_TOOLCHAIN_FILE=$here/toolchains/$system.cmake" "-DVRTM_PREBUILT=$library" \
    "-DCMAKE_CROSSCOMPILING_EMULATOR=$emulator" "-DVRTM_PYTHON=$python" -DVRTM_GPU=OFF -DVRTM_TESTS=ON || exit 1
ctest --test-dir "$folder" --parallel 2 --output-on-failure --no-tests=error
