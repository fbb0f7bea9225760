#!/bin/sh
# Builds vrtm with cargo and installs it for C and C++ programs, where there is no CMake: the same files as
# `cmake --install` puts in place, which tests/package compares.
set -eu

help() {
    cat <<'END'
usage: sh bindings/install.sh [options]

  --prefix DIR       where to install to (/usr/local); the tree may be moved later
  --destdir DIR      put before the prefix, for those who build packages
  --libdir DIR       folder for libraries, below the prefix (lib)
  --no-gpu           leave the GPU backend out
  --features LIST    more features for cargo, separated by commas
  --profile NAME     cargo's profile (dist): release and dev build more quickly
  --target TRIPLE    cargo's target (this machine)
  --target-dir DIR   cargo's target folder (CARGO_TARGET_DIR, or target)
  --offline          keep cargo from the network: all sources are there
  --prebuilt FILE    install this library, as cargo built it, and do not call cargo
  --help             say this
END
}

fail() {
    echo "install.sh: $*" >&2
    exit 2
}

prefix=/usr/local destdir='' libdir=lib gpu=1 features='' profile=dist target='' offline='' prebuilt=''
here=$(dirname "$0")
source=$(cd "$here/.." && pwd)
target_dir=${CARGO_TARGET_DIR:-$source/target}

while [ $# -gt 0 ]; do
    option=$1
    shift
    case $option in
        --help | -h) help; exit 0 ;;
        --no-gpu) gpu=; continue ;;
        --offline) offline=1; continue ;;
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
    [ -n "$value" ] || fail "$option needs a value; --help lists the options"
    case $option in
        --prefix) prefix=$value ;;
        --destdir) destdir=$value ;;
        --libdir) libdir=$value ;;
        --features) features=$value ;;
        --profile) profile=$value ;;
        --target) target=$value ;;
        --target-dir) target_dir=$value ;;
        --prebuilt) prebuilt=$value ;;
        *) fail "$option is no option; --help lists them" ;;
    esac
done
case $prefix in /* | [A-Za-z]:*) ;; *) prefix=$PWD/$prefix ;; esac
case $libdir in /* | *..*) fail "--libdir is $libdir, but must lie below the prefix, so that the tree can be moved" ;; esac

PATH=$PATH:${CARGO_HOME:-${HOME:-}/.cargo}/bin
triple=$target
if [ -z "$prebuilt" ]; then
    command -v rustc >/dev/null || fail "vrtm is built with Rust, which is not found: see https://rustup.rs"
    [ -n "$triple" ] || triple=$(rustc -vV | sed -n 's/^host: //p' | tr -d '\r')
elif [ -z "$triple" ]; then
    # A library that is built already takes no Rust: only the names depend on the target.
    case $(uname -s) in
        Darwin) triple=$(uname -m)-apple-darwin ;;
        *_NT*) fail "--prebuilt needs --target on Windows, such as x86_64-pc-windows-msvc or -gnu" ;;
        *) triple=$(uname -m)-unknown-$(uname -s | tr 'A-Z' 'a-z')-gnu ;;
    esac
fi
version=$(sed -n 's/^version = "\([0-9.]*\)".*/\1/p' "$source/Cargo.toml" | head -n 1)
major=${version%%.*}

# What the files are called: bindings/cmake/VrtmNames.cmake says the same to CMake.
links='' soname='' built_import='' import=''
case $triple in
    *-windows-*)
        built=vrtm.dll file=vrtm.dll
        case $triple in
            *-windows-gnu*) built_import=libvrtm.dll.a import=libvrtm.dll.a ;;
            *) built_import=vrtm.dll.lib import=vrtm.lib ;;
        esac
        ;;
    *-apple-*)
        built=libvrtm.dylib file=libvrtm.$version.dylib
        links="libvrtm.$major.dylib libvrtm.dylib" soname=@rpath/libvrtm.$major.dylib
        ;;
    *)
        built=libvrtm.so file=libvrtm.so.$version
        links="libvrtm.so.$major libvrtm.so" soname=libvrtm.so.$major
        ;;
esac
case $triple in
    *x32 | arm* | thumb* | i?86* | mips-* | mipsel-* | powerpc-* | riscv32* | wasm32*) pointer_bytes=4 ;;
    *) pointer_bytes=8 ;;
esac

if [ -n "$prebuilt" ]; then
    [ -f "$prebuilt" ] || fail "--prebuilt is $prebuilt, which does not exist"
    case $prebuilt in
        *".${built##*.}" | *".${built##*.}."[0-9]*) ;;
        *) fail "--prebuilt is $prebuilt, but a library for $triple is called $built: set --target if it is for another" ;;
    esac
    library=$prebuilt
    from=$(dirname "$prebuilt")
else
    set -- build --manifest-path "$source/Cargo.toml" --package vrtm-c --profile "$profile" --target-dir "$target_dir"
    [ -n "$gpu" ] || set -- "$@" --no-default-features
    [ -z "$features" ] || set -- "$@" --features "$features"
    [ -z "$offline" ] || set -- "$@" --offline --locked
    [ -z "$target" ] || set -- "$@" --target "$target"
    # The library holds the paths of its sources, for messages: those of this machine have no place in it.
    remap="'--remap-path-prefix=$source=/vrtm', '--remap-path-prefix=${CARGO_HOME:-${HOME:-}/.cargo}=/cargo'"
    cargo "$@" --config "target.'cfg(all())'.rustflags=[$remap]"
    from=$target_dir${target:+/$target}
    case $profile in dev) from=$from/debug ;; *) from=$from/$profile ;; esac
    library=$from/$built
fi

# One folder per part of a path, so that ".." as often leads back to the prefix.
up() {
    echo "$1" | sed -e 's,//*,/,g' -e 's,/$,,' -e 's,[^/][^/]*,..,g'
}

# Replaces what stands between @ in a template.
fill() {
    sed -e "s|@VRTM_VERSION@|$version|g" -e "s|@VRTM_MAJOR@|$major|g" -e "s|@VRTM_POINTER_BYTES@|$pointer_bytes|g" \
        -e "s|@VRTM_LIB@|$libdir|g" -e "s|@VRTM_INCLUDE@|include|g" -e "s|@VRTM_LIBRARY@|$library_path|g" \
        -e "s|@VRTM_IMPORT_LIBRARY@|$import_path|g" -e "s|@VRTM_SONAME@|$soname|g" \
        -e "s|@VRTM_FROM_CMAKE@|$(up "$libdir/cmake/vrtm")|g" \
        -e "s|@VRTM_FROM_PKGCONFIG@|$(up "$libdir/pkgconfig")|g" \
        "$source/bindings/cmake/$1.in" >"$2/$1"
    chmod 644 "$2/$1"
}

root=$destdir$prefix
copy() { # MODE FILE TARGET
    # A program that has the old file open keeps it: it is replaced, not written over.
    rm -f "$3"
    cp "$2" "$3"
    chmod "$1" "$3"
    echo "$3"
}

mkdir -p "$root/$libdir/cmake/vrtm" "$root/$libdir/pkgconfig" "$root/include" "$root/share/doc/vrtm"
if [ -n "$import" ]; then
    mkdir -p "$root/bin"
    library_path=bin/$file import_path=$libdir/$import
    copy 644 "$from/$built_import" "$root/$import_path"
else
    library_path=$libdir/$file import_path=''
fi
copy 755 "$library" "$root/$library_path"
for link in $links; do
    ln -sf "$file" "$root/$libdir/$link"
done
for header in vrtm.h vrtm.hpp; do
    copy 644 "$source/include/$header" "$root/include/$header"
done
for licence in LICENSE LICENSE-MIT LICENSE-APACHE; do
    copy 644 "$source/$licence" "$root/share/doc/vrtm/$licence"
done
copy 644 "$source/bindings/cmake/vrtmPlace.cmake" "$root/$libdir/cmake/vrtm/vrtmPlace.cmake"
copy 644 "$source/bindings/THIRD-PARTY.txt" "$root/share/doc/vrtm/THIRD-PARTY.txt"
fill vrtmConfig.cmake "$root/$libdir/cmake/vrtm"
fill vrtmConfigVersion.cmake "$root/$libdir/cmake/vrtm"
fill vrtm.pc "$root/$libdir/pkgconfig"
echo "$root/$libdir/pkgconfig/vrtm.pc"
