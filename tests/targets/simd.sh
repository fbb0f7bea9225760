#!/bin/sh
# Counts the instructions of a solve under QEMU's emulators of user programs, on ARM64 (NEON) and on x86-64 without and with
# AVX2, and fails if ARM64 does its arithmetic on single numbers, or other arithmetic than SSE2. The difference of a program that
# solves twice and one that solves once is one solve of 256 x 256 cells, on one thread.
#
#     tests/targets/simd.sh FOLDER
#
# FOLDER holds libvrtm.so for ARM64, and in this-machine/ one for x86-64, as run.sh leaves them there. Instructions other than
# arithmetic may only be compared if both were built at the same level of optimisation. Prints a table, or why it cannot,
# with exit code 3.
set -u
here=$(cd "$(dirname "$0")" && pwd)
repository=$(cd "$here/../.." && pwd)
folder=$(cd "${1:?simd.sh FOLDER}" && pwd)
scratch=$(mktemp -d)
trap 'rm -rf "$scratch"' EXIT

for program in qemu-aarch64 qemu-x86_64 aarch64-linux-gnu-gcc "${CC:-cc}"; do
    command -v "$program" >/dev/null || {
        echo "there is no $program"
        exit 3
    }
done
[ "$(uname -m)" = x86_64 ] || {
    echo "this machine's library is not for x86-64"
    exit 3
}
set -e
cd "$scratch"
"${CC:-cc}" -std=c11 -O1 -Wall -Wextra -pedantic -Werror -shared -fPIC "$here/count.c" -o count.so
headers="-I$repository/include -I$repository/tests/host"
# shellcheck disable=SC2086
aarch64-linux-gnu-gcc -std=c11 -O1 $headers "$here/solves.c" -o solves.arm64 "$folder/libvrtm.so" "-Wl,-rpath,$folder" -lm
# shellcheck disable=SC2086
"${CC:-cc}" -std=c11 -O1 $headers "$here/solves.c" -o solves.x86 "$folder/this-machine/libvrtm.so" \
    "-Wl,-rpath,$folder/this-machine" -lm

# The emulator of static programs takes no plug-ins.
arm='qemu-aarch64'
[ -e /lib/ld-linux-aarch64.so.1 ] || arm="$arm -L /usr/aarch64-linux-gnu -E LD_LIBRARY_PATH=/usr/aarch64-linux-gnu/lib"
measure() { # NAME PROGRAM EMULATOR...
    name=$1 program=$2
    shift 2
    for solves in 1 2; do
        "$@" -plugin "./count.so,to=$scratch/$name.$solves" "./$program" "$solves" | tail -n 1 >"$name.updates.$solves"
    done
}
# shellcheck disable=SC2086
measure neon solves.arm64 $arm
measure sse2 solves.x86 qemu-x86_64 -cpu qemu64
measure avx2 solves.x86 qemu-x86_64 -cpu max

printf '%-6s %14s %12s %12s %12s %12s %12s %12s %12s\n' '' 'node updates' 'all/update' f32x8 f32x4 f32x2 f32 f64x2 f64
for name in neon sse2 avx2; do
    updates=$(($(cat $name.updates.2) - $(cat $name.updates.1)))
    paste -d ' ' $name.1 $name.2 | awk -v name=$name -v updates="$updates" '
        { each[$1] = ($4 - $2) / updates }
        END {
            printf "%-6s %14d %12.1f %12.1f %12.1f %12.1f %12.2f %12.2f %12.2f\n", name, updates, each["all"], each["f32x8"],
                each["f32x4"], each["f32x2"], each["f32"], each["f64x2"], each["f64"]
        }'
done | tee table
awk '
    { vectors[$1] = 8 * $4 + 4 * $5 + 2 * $6; single[$1] = $7 }
    END {
        # Of the arithmetic in 32 bits nearly all is done in lanes, and as much as on x86-64.
        good = vectors["neon"] > 20 * single["neon"]
        good = good && vectors["neon"] > 0.8 * vectors["sse2"] && vectors["neon"] < 1.25 * vectors["sse2"]
        exit !good
    }' table
