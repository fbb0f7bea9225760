#!/bin/sh
# What run.sh needs for a target: a Rust compiler with std for it, a C and a C++ compiler, and what runs its programs here.
#
#     tests/targets/setup.sh windows|arm64
#
# Prints lines "NAME=VALUE" for run.sh: CARGO and RUSTC, and STD=sources if std is built from its sources. Installs what is
# missing with apt, if it may. What cannot be had: prints one line that says why, and ends with exit code 3.
set -u
target=${1:?setup.sh windows|arm64}
case $target in
    windows)
        triple=x86_64-pc-windows-gnu
        packages='gcc-mingw-w64-x86-64-posix g++-mingw-w64-x86-64-posix wine64 wine'
        rust='rustc-web cargo-web rust-web-src'
        programs='x86_64-w64-mingw32-gcc-posix x86_64-w64-mingw32-g++-posix'
        ;;
    arm64)
        triple=aarch64-unknown-linux-gnu
        packages='gcc-aarch64-linux-gnu g++-aarch64-linux-gnu libc6-dev-arm64-cross qemu-user'
        rust='rustc-web cargo-web libstd-rust-web-dev:arm64'
        programs='aarch64-linux-gnu-gcc aarch64-linux-gnu-g++ qemu-aarch64'
        ;;
    *)
        echo "no such target: $target"
        exit 3
        ;;
esac

# Seconds that may pass with installing.
seconds=${VRTM_SETUP_SECONDS:-600}
apt() {
    command -v apt-get >/dev/null || return 1
    root=
    [ "$(id -u)" = 0 ] || root='sudo -n'
    # The package lists of other processors' packages come with the next update.
    case "$*" in *:arm64*) $root dpkg --add-architecture arm64 || return 1 ;; esac
    {
        timeout "$seconds" $root apt-get update -qq &&
            DEBIAN_FRONTEND=noninteractive timeout "$seconds" $root apt-get install -y -qq --no-install-recommends "$@"
    } </dev/null >&2
}
have() {
    for program in "$@"; do
        command -v "$program" >/dev/null || return 1
    done
}
wine() { # where Debian has it, or any other
    [ "$target" != windows ] || [ -x /usr/lib/wine/wine64 ] || have wine64 || have wine
}
# The folder of a compiler's standard libraries.
libraries() {
    root=$("$1" --print sysroot 2>/dev/null) && printf '%s/lib/rustlib' "$root"
}
# Finds a Rust compiler: one with std for the target, or one that says it is a release and has std's sources.
rust() {
    for compiler in "${RUSTC:-rustc}" "$HOME/.cargo/bin/rustc" /usr/bin/rustc; do
        command -v "$compiler" >/dev/null || continue
        folder=$(libraries "$compiler") || continue
        cargo=$(dirname "$(command -v "$compiler")")/cargo
        [ -x "$cargo" ] || continue
        if [ -d "$folder/$triple" ]; then
            standard=
        elif [ -f "$folder/src/rust/library/std/Cargo.toml" ]; then
            standard=sources
        else
            continue
        fi
        printf 'RUSTC=%s\nCARGO=%s\nSTD=%s\n' "$(command -v "$compiler")" "$cargo" "$standard"
        return 0
    done
    return 1
}

# shellcheck disable=SC2086
have $programs && wine || apt $packages
have $programs || {
    echo "there is no $programs"
    exit 3
}
wine || {
    echo "there is no wine"
    exit 3
}
# shellcheck disable=SC2086
rust && exit
# shellcheck disable=SC2086
apt $rust && rust && exit
echo "no Rust compiler has std for $triple, or its sources"
exit 3
