#!/usr/bin/env bash
# Runs unit tests, and small solves and storms of calls through the C functions (tests.rs), in a tool that finds undefined
# behaviour. Where the tool cannot be had this says so. The last line counts as cargo's does.
#
#     tests/sound/run.sh miri [NAME...]      Miri, which interprets the code: pointers to the wrong memory, or used against
#                                            the rules of references, uninitialised and misaligned values, races, leaks
#     tests/sound/run.sh threads [NAME...]   ThreadSanitizer, with a standard library that is built for it: accesses that
#                                            nothing orders. It does not follow fences: the library has none, and that std
#                                            does without
#
# Miri's rules of references are Tree Borrows: under the stricter Stacked Borrows a global allocator may not read what
# stands in front of a block that it gave out, as crates/core/src/allocation/global.rs does.
set -uo pipefail
cd "$(dirname "$0")/../.."
[ ! -x "$HOME/.cargo/bin/cargo" ] || PATH="$HOME/.cargo/bin:$PATH"
tool=$1
shift
target=$(rustc -vV | sed -n 's/^host: //p')
folder=${CARGO_TARGET_DIR:-target}/$tool
mkdir -p "$folder"
passed=0 failed=0 ignored=0
programs=(--manifest-path tests/sound/Cargo.toml)

skip() {
    echo "skipped: $*"
    echo "test result: ok. 0 passed; 0 failed; 1 ignored"
    exit 0
}
command -v rustup >/dev/null || skip "without rustup there is no nightly compiler"
{
    rustup toolchain list | grep -q '^nightly' || rustup toolchain install nightly --profile minimal
    rustup component add rust-src --toolchain nightly
    [ "$tool" != miri ] || rustup component add miri --toolchain nightly
} >"$folder/setup" 2>&1

case $tool in
    miri)
        cargo +nightly miri --version >/dev/null 2>&1 || skip "no Miri: $(tail -n 1 "$folder/setup")"
        run() { MIRIFLAGS=-Zmiri-tree-borrows cargo +nightly miri test --target-dir "$folder" "$@"; }
        # Some modules are safe code alone, which is slow here.
        of_core=(--skip grid:: --skip mesh:: --skip method:: --skip strain::)
        controls=("race|Data race detected" "freed_through_a_reference|Undefined Behavior: .* is forbidden")
        ;;
    threads)
        case $target in
            x86_64-unknown-linux-gnu | aarch64-unknown-linux-gnu) ;;
            *) skip "ThreadSanitizer is not tried on $target" ;;
        esac
        [ -d "$(rustc +nightly --print sysroot 2>/dev/null)/lib/rustlib/src/rust/library" ] ||
            skip "no source of the standard library: $(tail -n 1 "$folder/setup")"
        run() {
            env -u VRTM_DEVICE -u VRTM_THREADS RUSTFLAGS=-Zsanitizer=thread TSAN_OPTIONS=halt_on_error=1 \
                cargo +nightly test -Zbuild-std --target "$target" --target-dir "$folder" "$@"
        }
        of_core=(allocation:: control:: local:: panics:: team::)
        controls=("race|WARNING: ThreadSanitizer: data race")
        ;;
    *) sed -n '5,9s/^# *//p' "$0" >&2 && exit 2 ;;
esac

# What the tool must find.
for control in "${controls[@]}"; do
    run "${programs[@]}" --test sound -- --ignored "controls::${control%%|*}" >"$folder/output" 2>&1
    if grep -q "${control#*|}" "$folder/output"; then
        passed=$((passed + 1))
        echo "test control ${control%%|*} ... ok"
    else
        failed=$((failed + 1))
        echo "test control ${control%%|*} ... FAILED"
        tail -n 40 "$folder/output"
    fi
done

# The first error ends a program: the tests after it count as one failure with it.
tests() { # OPTION...
    run "$@" 2>&1 | tee "$folder/output" | grep -v '^test result: '
    counts='s/^test result: .* \([0-9]*\) passed; \([0-9]*\) failed; \([0-9]*\) ignored.*/\1 \2 \3/p'
    read -r good bad left < <(sed -n "$counts" "$folder/output"; echo 0 1 0)
    passed=$((passed + good)) failed=$((failed + bad)) ignored=$((ignored + left))
}
tests --package vrtm-core-tests -- "${of_core[@]}" "$@"
tests --package vrtm-capi --lib -- "$@"
tests "${programs[@]}" --test sound -- --show-output --skip controls:: "$@"

if [ "$failed" = 0 ]; then verdict=ok; else verdict=FAILED; fi
echo "test result: $verdict. $passed passed; $failed failed; $ignored ignored"
[ "$failed" = 0 ]
