#!/bin/sh
# Writes the archive of one release for one platform: the stripped library, the headers, the CMake package and vrtm.pc, the
# licences of vrtm and of all that is linked into it, and beside it a file with its SHA-256. The bytes of an archive follow
# from the library's alone: names are sorted, times are that of the commit, owners are nobody.
set -eu

help() {
    cat <<'END'
usage: sh bindings/release.sh [options]

  --out DIR          where to write to (target/release-archive)
  --max-glibc X.Y    fail if the library needs a newer glibc
  --no-gpu, --features LIST, --profile NAME, --target TRIPLE, --target-dir DIR, --offline, --prebuilt FILE
                     as bindings/install.sh has them
  --help             say this

It writes vrtm-VERSION-TRIPLE.tar.xz, or .zip for Windows, and the same with .sha256. STRIP names the program that strips
the library (such as aarch64-linux-gnu-strip, strip, llvm-strip, or none), SOURCE_DATE_EPOCH the time of all files (that of
the last commit). Linux: the oldest glibc that the library runs with follows from the one that it is linked with, so build
on the oldest system you support.
END
}

fail() {
    echo "release.sh: $*" >&2
    exit 2
}

here=$(cd "$(dirname "$0")" && pwd)
source=$(cd "$here/.." && pwd)
out='' max_glibc='' target='' prebuilt=''
install_options=''
while [ $# -gt 0 ]; do
    option=$1
    shift
    case $option in
        --help | -h) help; exit 0 ;;
        --no-gpu) install_options="$install_options --no-gpu"; continue ;;
        --offline) install_options="$install_options --offline"; continue ;;
        --*=*)
            value=${option#*=}
            option=${option%%=*}
            ;;
        --*)
            [ $# -gt 0 ] || fail "$option needs a value; --help lists the options"
            value=$1
            shift
            ;;
        *) fail "$option is no option; --help lists them" ;;
    esac
    case $option in
        --out) out=$value ;;
        --max-glibc) max_glibc=$value ;;
        --prebuilt) prebuilt=$value ;;
        --target | --profile | --features | --target-dir)
            [ "$option" != --target ] || target=$value
            case $value in *[\ \	]*) fail "$option is $value: blanks are not supported" ;; esac
            install_options="$install_options $option=$value"
            ;;
        *) fail "$option is no option; --help lists them" ;;
    esac
done

PATH=$PATH:${CARGO_HOME:-${HOME:-}/.cargo}/bin
export LC_ALL=C TZ=UTC
triple=$target
[ -n "$triple" ] || triple=$(rustc -vV | sed -n 's/^host: //p' | tr -d '\r')
version=$(sed -n 's/^version = "\([0-9.]*\)".*/\1/p' "$source/Cargo.toml" | head -n 1)
name=vrtm-$version-$triple
out=${out:-${CARGO_TARGET_DIR:-$source/target}/release-archive}
mkdir -p "$out"
out=$(cd "$out" && pwd)
if [ -z "${SOURCE_DATE_EPOCH:-}" ]; then
    SOURCE_DATE_EPOCH=$(git -C "$source" log -1 --format=%ct 2>/dev/null) ||
        fail "this is no git checkout: set SOURCE_DATE_EPOCH to the time of the release"
fi
export SOURCE_DATE_EPOCH

work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT
tree=$work/$name

# The library holds the paths of its sources, for messages: those of this machine have no place in it.
registry=${CARGO_HOME:-${HOME:-}/.cargo}/registry/src
if [ -z "$prebuilt" ]; then
    RUSTFLAGS="${RUSTFLAGS:-} --remap-path-prefix=$registry=/cargo --remap-path-prefix=$source=/vrtm"
    export RUSTFLAGS
    # shellcheck disable=SC2086 # None of the options holds a blank.
    sh "$here/install.sh" --prefix "$tree" $install_options
else
    # shellcheck disable=SC2086
    sh "$here/install.sh" --prefix "$tree" --prebuilt "$prebuilt" $install_options
fi

# What is stripped is neither used by programs nor by the loader. Another target's file takes that target's program.
strip=${STRIP:-}
foreign= options=--strip-unneeded
case $triple in
    *-windows-msvc) library=$tree/bin/vrtm.dll strip=none ;; # rustc puts its symbols into a file of their own, vrtm.pdb.
    *-windows-*) library=$tree/bin/vrtm.dll foreign=${triple%%-*}-w64-mingw32-strip ;;
    *-apple-*) library=$tree/lib/libvrtm.$version.dylib options=-x ;;
    *) library=$tree/lib/libvrtm.so.$version foreign=${triple%%-*}-${triple#*-unknown-}-strip ;;
esac
[ -n "$strip" ] || ! command -v "$foreign" >/dev/null || strip=$foreign
strip=${strip:-strip}
if [ "$strip" != none ]; then
    "$strip" "$options" "$library" || fail "$strip does not strip $library: set STRIP, to llvm-strip for instance"
fi
if [ -n "$max_glibc" ]; then
    needed=$(readelf -VW "$library" | sed -n 's/.*Name: GLIBC_\([0-9.]*\) .*/\1/p' | sort -t. -k1,1n -k2,2n | tail -n 1)
    newest=$(printf '%s\n%s\n' "$needed" "$max_glibc" | sort -t. -k1,1n -k2,2n | tail -n 1)
    [ "$newest" = "$max_glibc" ] || fail "the library needs glibc $needed, but --max-glibc is $max_glibc"
fi

# The same bytes each time: GNU's tar and BSD's differ in the options for that.
find "$tree" -type d -exec chmod 755 {} +
stamp=$(date -u -d "@$SOURCE_DATE_EPOCH" +%Y%m%d%H%M.%S 2>/dev/null || date -u -r "$SOURCE_DATE_EPOCH" +%Y%m%d%H%M.%S)
find "$tree" -exec touch -h -t "$stamp" {} +
(cd "$work" && find "$name" | sort) >"$work/list"
case $triple in
    *-windows-*)
        archive=$name.zip
        rm -f "$out/$archive"
        (cd "$work" && zip -q -X -9 "$out/$archive" -@ <list)
        ;;
    *)
        archive=$name.tar.xz
        owner='--uid 0 --gid 0 --uname root --gname root'
        if tar --version | grep -q GNU; then
            owner='--owner=root:0 --group=root:0 --format=gnu --mode=u+rw,go+r,go-w'
        fi
        # shellcheck disable=SC2086 # Several options.
        tar -C "$work" -c -f "$work/archive.tar" $owner --no-recursion -T "$work/list"
        xz -9e -T1 -c "$work/archive.tar" >"$out/$archive"
        ;;
esac
cd "$out"
if command -v sha256sum >/dev/null; then
    sha256sum "$archive" >"$archive.sha256"
else
    shasum -a 256 "$archive" >"$archive.sha256"
fi
echo "$out/$archive"
