#!/usr/bin/env bash
# Runs C and C++ hosts with AddressSanitizer and LeakSanitizer in the library and in the host: accesses out of bounds and
# after the end, and memory that nobody frees. Where a tool is missing it says so. The last line counts as cargo's does.
#
# The library is built with the Rust compiler's own sanitizer, and the host with gcc's, whose runtime serves both.
set -uo pipefail
cd "$(dirname "$0")/../.."
[ ! -x "$HOME/.cargo/bin/cargo" ] || PATH="$HOME/.cargo/bin:$PATH"

target=$(rustc -vV | sed -n 's/^host: //p')
folder=${CARGO_TARGET_DIR:-target}/sanitize
hosts=$folder/hosts
mkdir -p "$hosts"
passed=0 failed=0

skip() {
    echo "skipped: $*"
    echo "test result: ok. 0 passed; 0 failed; 1 ignored"
    exit 0
}
case $target in
    x86_64-unknown-linux-gnu | aarch64-unknown-linux-gnu) ;;
    *) skip "the sanitizers are not tried on $target" ;;
esac
echo 'int main(void) { return 0; }' >"$hosts/empty.c"
"${CC:-cc}" -fsanitize=address "$hosts/empty.c" -o "$hosts/empty" 2>/dev/null && "$hosts/empty" ||
    skip "${CC:-cc} has no AddressSanitizer"

# The flags are for the target alone, not for programs that run in the build. The hosts are small: what counts is the time
# to build. The standard library checks its preconditions here, which the tests' profile leaves out.
CARGO_PROFILE_DEV_DEBUG_ASSERTIONS=true CARGO_PROFILE_DEV_OPT_LEVEL=1 RUSTC_BOOTSTRAP=1 RUSTFLAGS="-Zsanitizer=address" cargo build --package vrtm-c --no-default-features \
    --target "$target" --target-dir "$folder" || { echo "test result: FAILED. 0 passed; 1 failed; 0 ignored"; exit 1; }
library=$folder/$target/debug
ln -sf libvrtm.so "$library/libvrtm.so.0"
library=$(cd "$library" && pwd)

build() { # SOURCE PROGRAM
    local compiler=("${CC:-cc}" -std=c11)
    case $1 in *.cpp) compiler=("${CXX:-c++}" -std=c++17) ;; esac
    "${compiler[@]}" -O1 -g -fsanitize=address -fno-omit-frame-pointer -pthread -Iinclude -Itests/host "$1" -o "$2" \
        "$library/libvrtm.so" "-Wl,-rpath,$library" -lm -ldl
}

run() { # PROGRAM ARGUMENT...
    env -u VRTM_DEVICE -u VRTM_THREADS XDG_RUNTIME_DIR="$hosts" \
        ASAN_OPTIONS=detect_leaks=1:detect_stack_use_after_return=1:allocator_may_return_null=1 \
        timeout 600 "$@" >"$hosts/output" 2>&1
}

count() { # NAME GOOD
    if [ "$2" = 1 ]; then
        passed=$((passed + 1))
        echo "test $1 ... ok"
    else
        failed=$((failed + 1))
        echo "test $1 ... FAILED"
        tail -n 40 "$hosts/output"
    fi
}

# What the sanitizers must find: that the library reads beyond a host's array, and that a host keeps what it allocated.
for control in reads_beyond leaks; do
    good=0
    if build tests/host/sanitizers.c "$hosts/sanitizers"; then
        run "$hosts/sanitizers" "$control"
        case $control in
            reads_beyond) grep -q 'heap-buffer-overflow' "$hosts/output" && grep -q 'vrtm_asset_create' "$hosts/output" ;;
            leaks) grep -q 'LeakSanitizer: detected memory leaks' "$hosts/output" ;;
        esac && good=1
    fi
    count "control $control" $good
done

# Not those that measure memory or give the library small stacks, since a sanitizer needs more of both, nor the one that
# unloads the library, which a sanitizer keeps.
for host in smoke.c misuse.c mesh.c float_mode.c job.c refine.c carry.c farm.cpp; do
    name=${host%.*}
    good=0
    build "tests/host/$host" "$hosts/$name" && run "$hosts/$name" && good=1
    count "$name" $good
done

if [ "$failed" = 0 ]; then verdict=ok; else verdict=FAILED; fi
echo "test result: $verdict. $passed passed; $failed failed; 0 ignored"
[ "$failed" = 0 ]
