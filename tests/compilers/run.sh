#!/bin/sh
# Compiles the headers and the C and C++ hosts with clang, and with zig's clang for Linux, macOS and Windows, in all
# standards from C99 and from C++17: no warning may come from the headers. Nothing is linked or run. The last line
# counts as cargo's does; the exit code is 0 if nothing failed.
#
#     tests/compilers/run.sh [WORD]
#
# With WORD, only the checks that have it in their name.
# Variables: CLANG, the compiler (the newest there is); VRTM_ZIG_VENV, the folder for zig's (target/zig), which setup.sh
# makes.
#
# Microsoft's compiler is not here, and neither are its headers. Clang stands in for it: vrtm.h is compiled for
# Microsoft's targets on x86-64 and ARM64, with clang's own headers of C; vrtm.hpp by the rules of Microsoft's language
# (-fms-compatibility, with templates parsed at once and late), but with the headers of MinGW and of libc++. Not
# checked are therefore Microsoft's own library, its ABI for C++, and its warnings (/W4).
set -u
here=$(cd "$(dirname "$0")" && pwd)
repository=$(cd "$here/../.." && pwd)
target=${CARGO_TARGET_DIR:-$repository/target}
WORK=$target/compilers
export WORK
c_standards="c99 c11 c17 c2x"
cpp_standards="c++17 c++20 c++2b"
log=$WORK/log

rm -rf "$WORK"
mkdir -p "$WORK/c"
echo '#include "vrtm.h"
int main(void) { return (int)(vrtm_version() & 1u); }' >"$WORK/header.c"
echo '#include "vrtm.hpp"
int main() { return static_cast<int>(vrtm::version() & 1u); }' >"$WORK/header.cpp"
# All that vrtm.h needs of a C library, beside the headers that every compiler has with it.
echo '#include <stddef.h>
#ifdef __cplusplus
extern "C"
#endif
void *memset(void *to, int byte, size_t size);' >"$WORK/c/string.h"
# What hosts in C++ take of the standard library, which is compiled once for all of them.
for name in algorithm array atomic chrono cmath condition_variable cstddef cstdint cstdio cstdlib cstring deque functional \
    limits map memory mutex optional random stdexcept string thread type_traits utility vector; do
    echo "#include <$name>"
done >"$WORK/standard.hpp"
: >"$WORK/checks"
skipped=0

skip() {
    echo "skipped: $*"
    skipped=$((skipped + 1))
}

only=${1:-}
check() { # NAME WHAT SYSTEM STANDARD COMPILER FLAG...
    case $1 in *"$only"*) ;; *) return ;; esac
    printf "sh '%s/check.sh'" "$here" >>"$WORK/checks"
    printf " '%s'" "$@" >>"$WORK/checks"
    echo >>"$WORK/checks"
}

# all NAME SYSTEM COMPILER...: the header and the hosts in all standards; C_FLAGS and CPP_FLAGS say where the headers
# are.
all() {
    name=$1 system=$2
    shift 2
    for standard in $c_standards $cpp_standards; do
        case $standard in c++*) flags=$CPP_FLAGS ;; *) flags=$C_FLAGS ;; esac
        for what in header hosts; do
            # shellcheck disable=SC2086 # Several flags.
            check "$name $standard $what" $what $system $standard "$@" $flags
        done
    done
}

clang=${CLANG:-}
for name in clang clang-22 clang-21 clang-20 clang-19; do
    [ -n "$clang" ] || ! command -v "$name" >/dev/null || clang=$name
done
if [ -n "$clang" ]; then
    "$clang" --version | head -n 1
    C_FLAGS='' CPP_FLAGS=''
    case $(uname -s) in Linux) system=linux ;; Darwin) system=macos ;; *) system=windows ;; esac
    all clang $system "$clang"
else
    skip "there is no clang"
fi

# headers DRIVER TARGET ENDING: where zig's driver has clang look for the target's headers, with the macros that these
# want. (The driver itself would make a program, and build each target's libraries first.)
headers() {
    (cd "$WORK" && "$zig" "$1" -target "$2" -c "header.$3" -o header.o '-###' 2>&1) |
        tr ' ' '\n' | sed 's/^"//; s/"$//' |
        awk '$0 == "-isystem" || $0 == "-D" { print; getline; print }' | tr '\n' ' '
}

if zig=$(sh "$here/setup.sh" "${VRTM_ZIG_VENV:-$target/zig}"); then
    "$zig" clang --version | head -n 1
    ZIG_GLOBAL_CACHE_DIR=$WORK/zig ZIG_LOCAL_CACHE_DIR=$WORK/zig
    export ZIG_GLOBAL_CACHE_DIR ZIG_LOCAL_CACHE_DIR
    # The target as zig names it, and as clang does.
    for pair in x86_64-linux-gnu/x86_64-linux-gnu aarch64-macos/arm64-apple-macosx11.0 \
        x86_64-windows-gnu/x86_64-windows-gnu; do
        system=${pair%/*}
        C_FLAGS=$(headers cc "$system" c) CPP_FLAGS=$(headers c++ "$system" cpp)
        case $system in *linux*) kind=linux ;; *macos*) kind=macos ;; *) kind=windows ;; esac
        all "zig $system" $kind "$zig" clang "--target=${pair#*/}" -nostdinc
    done

    microsoft="-fms-compatibility -fms-extensions -fms-compatibility-version=19.40"
    builtin=$(dirname "$zig")/lib/include
    for system in x86_64-pc-windows-msvc aarch64-pc-windows-msvc; do
        for standard in $c_standards $cpp_standards; do
            # shellcheck disable=SC2086
            set -- "$zig" clang --target=$system -nostdinc -isystem "$builtin" -isystem "$WORK/c" $microsoft
            case $standard in c++*) set -- "$@" -x c++ ;; esac
            check "$system $standard vrtm.h" header_of_c windows $standard "$@"
        done
    done
    # With the compiler's version but not its macro, which mingw's headers take for Microsoft's.
    for standard in $cpp_standards; do
        # shellcheck disable=SC2086
        set -- "$zig" clang --target=x86_64-windows-gnu -nostdinc $CPP_FLAGS $microsoft -U_MSC_VER -fgnuc-version=4.2.1
        check "rules of Microsoft $standard vrtm.hpp" header windows "$standard" "$@"
        check "rules of Microsoft $standard late" rules windows "$standard" "$@" -fdelayed-template-parsing \
            -Wno-delayed-template-parsing-in-cxx20
    done
else
    skip "zig's clang: $zig"
fi

# One per core at a time; a check that prints nothing failed.
cores=$(getconf _NPROCESSORS_ONLN 2>/dev/null || echo 2)
: >"$log"
[ ! -s "$WORK/checks" ] || tr '\n' '\0' <"$WORK/checks" | xargs -0 -n 1 -P "$cores" sh -c | tee "$log"
passed=$(grep -c '^test .* \.\.\. ok$' "$log")
failed=$(($(wc -l <"$WORK/checks") - passed))
if [ "$failed" = 0 ]; then verdict=ok; else verdict=FAILED; fi
echo "test result: $verdict. $passed passed; $failed failed; $skipped ignored"
[ "$failed" = 0 ]
