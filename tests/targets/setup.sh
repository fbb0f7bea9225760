#!/bin/sh
# What run.sh needs for a target: its std for the Rust compiler, a C and a C++ compiler, and what runs its programs here.
#
#     tests/targets/setup.sh windows|arm64
#
# Installs what is missing, with apt, if it may, and rustup. What cannot be had: prints one line that says why, and ends
# with exit code 3.
set -u
target=${1:?setup.sh windows|arm64}
case $target in
    windows)
        triple=x86_64-pc-windows-gnu
        packages='gcc-mingw-w64-x86-64-posix g++-mingw-w64-x86-64-posix wine64 wine'
        programs='x86_64-w64-mingw32-gcc-posix x86_64-w64-mingw32-g++-posix'
        ;;
    arm64)
        triple=aarch64-unknown-linux-gnu
        packages='gcc-aarch64-linux-gnu g++-aarch64-linux-gnu libc6-dev-arm64-cross qemu-user'
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
std() {
    [ -d "$("${RUSTC:-rustc}" --print sysroot)/lib/rustlib/$triple/lib" ]
}

# One at a time: packagers let nobody in beside them.
exec 9>"${TMPDIR:-/tmp}/vrtm-targets"
! command -v flock >/dev/null || flock 9
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
std || timeout "$seconds" rustup target add "$triple" >&2
std || {
    echo "the Rust compiler has no std for $triple, and rustup adds none"
    exit 3
}
