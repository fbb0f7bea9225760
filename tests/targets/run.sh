#!/bin/sh
# Builds the library for another target, without the GPU backend, and hosts with that target's C and C++ compilers; runs
# them under an emulator, and compares the bits of results with this machine's. A line per host, and at the end a count as
# cargo prints it; where something cannot be had, a line "... skipped: why" counts as ignored.
#
#     tests/targets/run.sh windows|arm64
#
# Windows: GNU's tools (MinGW-w64) and Wine. ARM64: Linux under QEMU. Variables: VRTM_LONG_TESTS=1, all hosts and checks;
# VRTM_LIBRARY, this machine's library, which else is built; VRTM_SETUP_SECONDS,
# how long packages may take to come; VRTM_REQUIRE_TARGETS=1: what would be skipped fails.
set -u
here=$(cd "$(dirname "$0")" && pwd)
repository=$(cd "$here/../.." && pwd)
target=${1:?run.sh windows|arm64}
# A folder for each target: what compilers of different kinds build for the build itself, cargo takes for out of date.
folder=${CARGO_TARGET_DIR:-$repository/target}/targets/$target
mkdir -p "$folder/hosts"
folder=$(cd "$folder" && pwd)
hosts=$folder/hosts
passed=0 failed=0 ignored=0
long=${VRTM_LONG_TESTS:-0}

finish() {
    [ "$target" != windows ] || end_wine
    verdict=ok
    [ "$failed" = 0 ] || verdict=FAILED
    echo "test result: $verdict. $passed passed; $failed failed; $ignored ignored"
    [ "$failed" = 0 ]
    exit
}
good() { # NAME [SECONDS]
    passed=$((passed + 1))
    echo "test $target $1 ... ok${2:+ <$2s>}"
}
since() { # START
    echo $(($(date +%s) - $1))
}
bad() { # NAME [FILE]
    failed=$((failed + 1))
    echo "test $target $1 ... FAILED"
    [ $# = 1 ] || tail -n 40 "$2"
}
skip() {
    if [ "${VRTM_REQUIRE_TARGETS:-0}" = 1 ]; then
        bad "would be skipped: $*"
    else
        ignored=$((ignored + 1))
        echo "$target skipped: $*"
    fi
}
end_wine() {
    [ ! -d "$hosts/wine" ] || { "$wineserver" -k; rm -rf "$hosts/wine"; } 2>/dev/null
}

why=$(sh "$here/setup.sh" "$target") || {
    skip "$(echo "$why" | tail -n 1)"
    finish
}

# ---- What differs between targets

warnings='-Wall -Wextra -pedantic -Werror'
case $target in
    windows)
        triple=x86_64-pc-windows-gnu
        cc=x86_64-w64-mingw32-gcc-posix cxx=x86_64-w64-mingw32-g++-posix
        program=.exe library=vrtm.dll position=
        # The compiler's own libraries go into the programs, which then need the DLL beside them alone.
        link='-static -lm' linked="$hosts/libvrtm.dll.a"
        export WINEPREFIX="$hosts/wine" WINEDEBUG=-all WINEDLLOVERRIDES='mscoree=;mshtml=;winemenubuilder.exe='
        run=/usr/lib/wine/wine64 wineserver=/usr/lib/wine/wineserver64
        [ -x "$run" ] || run=$(command -v wine64 || command -v wine)
        [ -x "$wineserver" ] || wineserver=$(command -v wineserver)
        german=German_Germany.1252
        # In every so many of its loads a library solves.
        loads=5 variables=
        ;;
    arm64)
        triple=aarch64-unknown-linux-gnu
        cc=aarch64-linux-gnu-gcc cxx=aarch64-linux-gnu-g++
        program= library=libvrtm.so position=-fPIC
        link="-static-libstdc++ -Wl,-rpath,$hosts -lm -ldl" linked="$hosts/libvrtm.so"
        run=qemu-aarch64
        # The C library of Debian's packages for ARM64, or the cross compiler's, but never the loader of one with the library of
        # the other, which the loader's cache names: threads then wait for ever.
        cross=/usr/aarch64-linux-gnu
        [ -e /lib/ld-linux-aarch64.so.1 ] || run="$run -L $cross -E LD_LIBRARY_PATH=$cross/lib"
        german=de_DE.UTF-8
        loads=50 variables=PLATFORM_EMULATED=1
        ;;
esac

# ---- The libraries

cd "$repository" || exit 1
native=${VRTM_LIBRARY:-}
if [ -z "$native" ]; then
    cargo build --package vrtm-c >"$hosts/log" 2>&1 || {
        bad "this machine's library is built" "$hosts/log"
        finish
    }
    native=${CARGO_TARGET_DIR:-target}/debug/libvrtm.so
fi
native=$(cd "$(dirname "$native")" && pwd)/$(basename "$native")

# The hosts are small, and the bits are the same at any level: what counts is the time to build.
export CARGO_INCREMENTAL=0 CARGO_PROFILE_RELEASE_OPT_LEVEL=1
# tests/package/other.sh makes a release of it, which has no paths of this machine.
export RUSTFLAGS="${RUSTFLAGS:-} --remap-path-prefix=${CARGO_HOME:-$HOME/.cargo}=/cargo"
export CARGO_TARGET_DIR="$folder"
cross() {
    cargo "$@" --target "$triple"
}
export CARGO_TARGET_X86_64_PC_WINDOWS_GNU_LINKER=x86_64-w64-mingw32-gcc-posix
export CARGO_TARGET_AARCH64_UNKNOWN_LINUX_GNU_LINKER=aarch64-linux-gnu-gcc
start=$(date +%s)
if ! cross fetch >"$hosts/log" 2>&1; then
    tail -n 3 "$hosts/log"
    skip "the sources of the packages cannot be had"
    finish
fi
if ! cross build --release --package vrtm-c --no-default-features >"$hosts/log" 2>&1 || grep -q '^warning' "$hosts/log"; then
    bad 'the library is built' "$hosts/log"
    finish
fi
good "the library is built" "$(since "$start")"
cp "$folder/$triple/release/$library" "$hosts/"
[ "$target" != windows ] || cp "$folder/$triple/release/libvrtm.dll.a" "$hosts/"
[ "$target" != arm64 ] || ln -sf libvrtm.so "$hosts/libvrtm.so.0"

here_folder=$hosts/this-machine
mkdir -p "$here_folder"
cp "$native" "$here_folder/libvrtm.so" && ln -sf libvrtm.so "$here_folder/libvrtm.so.0"

# ---- Hosts

compile() { # SOURCE NAME OPTION...
    source=$1 built=$2
    shift 2
    case $source in
        *.cpp) set -- "$cxx" -std=c++17 "$@" ;;
        *) set -- "$cc" -std=c11 "$@" ;;
    esac
    # shellcheck disable=SC2086
    "$@" -O1 $warnings -pthread -Iinclude -Itests/host "$source" -o "$hosts/$built" $linked $link >"$hosts/log" 2>&1
}
emulated() { # PROGRAM ARGUMENT...
    first=$1 status=0
    shift
    (
        cd "$hosts" &&
            env -u VRTM_DEVICE -u VRTM_THREADS $variables LOCPATH="$hosts/locales" \
                timeout "${limit:-300}" $run "./$first$program" "$@" >"$hosts/output" 2>&1
    ) || status=$?
    tr -d '\r' <"$hosts/output"
    [ "$status" = 0 ] || echo "exit code $status"
    return "$status"
}
# A host that prints a line "ok ..." per case, at least so many of them, and "0 failed" at the end, and nothing else. OPTIONS
# are further ones of the compiler, and AS is the test's name, if it is not the file's.
host() { # SOURCE CASES ARGUMENT...
    source=$1 cases=$2 name=${as:-$(basename "${1%.*}")}
    shift 2
    start=$(date +%s)
    # shellcheck disable=SC2086
    if ! compile "$source" "$name$program" ${options:-}; then
        bad "$name" "$hosts/log"
        return
    fi
    emulated "$name" "$@" >"$hosts/log"
    if [ "$(tail -n 1 "$hosts/log")" = '0 failed' ] && [ "$(grep -c '^ok ' "$hosts/log")" -ge "$cases" ] &&
        ! grep -v -e '^ok ' -e '^0 failed$' "$hosts/log" >/dev/null; then
        good "$name ($(grep -c '^ok ' "$hosts/log") cases)" "$(since "$start")"
    else
        bad "$name" "$hosts/log"
    fi
}

if [ "$target" = windows ]; then
    rm -rf "$hosts/wine"
    trap end_wine EXIT
    # Its messages are about what no host needs, such as programs of 32 bits.
    timeout 300 "$run" cmd /c exit >"$hosts/log" 2>&1 || {
        skip "Wine makes no folder for Windows"
        finish
    }
    if ! [ -f "$hosts/wine/drive_c/windows/system32/bcryptprimitives.dll" ]; then
        $cc -O1 $warnings -shared "$here/process_prng.c" -o "$hosts/bcryptprimitives.dll" -ladvapi32 || exit 1
    fi
fi
mkdir -p "$hosts/locales"
localedef -i de_DE -f UTF-8 "$hosts/locales/de_DE.UTF-8" 2>/dev/null

host tests/host/smoke.c 50
host tests/host/misuse.c 261
host tests/host/float_mode.c 26
host tests/host/job.c 118
host tests/host/wrapper_throws.cpp 7
if [ "$target" = arm64 ] && ! [ -d "$hosts/locales/de_DE.UTF-8" ]; then
    skip "locale: localedef does not make the locale de_DE"
else
    host tests/host/locale.c 20 "$german"
fi
before=$linked
linked=
host tests/host/unload.c 24 "./$library"
host tests/host/reload.c 8 "./$library" 1000 "$loads"
linked=$before

if compile tests/host/readme.c "readme$program" && emulated readme >"$hosts/log" &&
    grep -q '^texel (64, 64) samples the texture at 0\.[0-9]* 0\.[0-9]*$' "$hosts/log"; then
    good readme
else
    bad readme "$hosts/log"
fi

# The bits: the same program with this machine's library and compiler.
if compile tests/host/bits.c "bits$program" && emulated bits >"$hosts/hashes" &&
    "${CC:-cc}" -std=c11 -O1 -ffp-contract=off -Iinclude -Itests/host tests/host/bits.c -o "$here_folder/bits" \
        "$here_folder/libvrtm.so" "-Wl,-rpath,$here_folder" -lm >"$hosts/log" 2>&1 &&
    "$here_folder/bits" >"$here_folder/hashes" && [ "$(wc -l <"$here_folder/hashes")" -ge 22 ] &&
    diff "$here_folder/hashes" "$hosts/hashes" >"$hosts/log" 2>&1; then
    good "bits ($(wc -l <"$hosts/hashes") hashes are this machine's)"
else
    bad bits "$hosts/log"
fi

[ "$long" = 0 ] || . "$here/long.sh"
finish
