#!/bin/sh
# Counts what the CPU's kernels execute in a solve, which depends neither on the machine's load nor on its speed, and
# writes benches/results/kernels.md: on 512 x 512 cells in valgrind, with the bytes that they fetch, and on 64 x 64
# cells for all processor levels. As valgrind knows no AVX-512, the program counts that by itself, in minutes, with a
# trap after each instruction; without valgrind, the other levels, too.
#
#     benches/kernels.sh [LEVEL...]    # by default avx2 baseline avx512; the first one orders the rows
set -eu
cd "$(dirname "$0")/.."
scene=bulge quality=normal file=benches/results/kernels.md nodes=0
[ $# != 0 ] || set -- avx2 baseline avx512
folder=$(realpath -m "${CARGO_TARGET_DIR:-target}/kernels")
# Such symbols have their parameters, which name the kernel that a function was made for.
CARGO_TARGET_DIR=$folder RUSTFLAGS='-C symbol-mangling-version=v0' \
    cargo build --release --package vrtm-testkit --example kernels
program=$folder/release/examples/kernels
command -v valgrind >"$folder/valgrind" || true

table() { # CELLS LEVEL...
    cells=$1 files=
    shift
    printf '\n## %s² cells\n\n' "$cells"
    for level in "$@"; do
        [ "$level.$cells" != avx512.512 ] || continue
        counts=$folder/$level.$cells
        if [ "$level" != avx512 ] && [ -s "$folder/valgrind" ]; then
            # The caches are those of a core of Zen 3, with half of the last level of eight cores.
            set -- valgrind -q --tool=callgrind --dump-instr=yes --compress-pos=no --compress-strings=no \
                --cache-sim=yes --I1=32768,8,64 --D1=32768,8,64 --LL=16777216,16,64 --toggle-collect=counted \
                "--callgrind-out-file=$counts" "$program" "$level" "$scene" "$cells" "$quality"
        else
            set -- "$program" "$level" "$scene" "$cells" "$quality" "$counts"
        fi
        if active=$("$@" 2>"$folder/log"); then
            nodes=$active files="$files $level=$counts"
        else
            printf '%s is missing: %s.\n\n' "$level" "$(tail -n 1 "$folder/log")"
        fi
    done
    # shellcheck disable=SC2086
    [ -z "$files" ] || python3 benches/kernels.py "$program" "$nodes" $files
}

{
    cat <<END
# Kernels of the CPU

\`benches/kernels.sh\`, a solve of \`$scene\` at \`$quality\` on one thread. The columns "avx2", "baseline" (SSE2) and
"avx512" are instructions, each followed by those of them that load from the stack and store to it: spilled registers,
and arrays of the kernel. "Roots" are divisions and square roots, of which each lane counts; "cache" and "memory" are
bytes fetched to a first level of 32 KiB, and from memory to a last level of 16 MiB, with those of functions that the
kernel calls. A kernel's numbers are per call and node of a block (256); the last row's are per node that can move.
Shares, roots and bytes are those of the first level. Other functions have only a share, and libraries (\`memset\`,
\`memcpy\`) are left out.
END
    if [ -s "$folder/valgrind" ]; then
        table 512 "$@"
    else
        printf '\nBytes are missing: there is no valgrind.\n'
    fi
    table 64 "$@"
} >"$file"
cat "$file"
