#!/bin/sh
# Writes the files of one release for one system: the archive (the stripped library, the headers, the CMake package and
# vrtm.pc, the licences of vrtm and of all that is linked into it), with --python the wheel, the add-on for Blender, the
# package for Unity and the list of what is in them (SPDX), with --web the npm package and the page instead; and
# SHA256SUMS of all. Their bytes follow from the library's alone: names are sorted, times are that of the commit, owners
# are nobody.
set -eu

help() {
    cat <<'END'
usage: sh bindings/release.sh [options]

  --out DIR          where to write to (target/release-archive)
  --python PROGRAM   a Python 3.11 or newer with pip, hatchling and pycparser: also makes the wheel, the add-on, the package
                     for Unity and the SPDX file; with auditwheel it confirms the wheel's tag
  --web              pack bindings/web/dist and examples/web/dist, which `npm run build` has made, and no library; with
                     --python also the SPDX file
  --glibc X.Y        link for this glibc or a newer one, by zig: ZIG is its program, or "PYTHON -m ziglang"
  --max-glibc X.Y    fail if the library needs a newer glibc
  --no-gpu, --features LIST, --profile NAME, --target TRIPLE, --target-dir DIR, --offline, --prebuilt FILE
                     as bindings/install.sh has them
  --help             say this

The archive is vrtm-VERSION-TRIPLE.tar.xz, or .zip for Windows; vrtm-VERSION-TRIPLE-debug.tar.xz has the library's symbols for
debuggers, where there is an objcopy beside the program that strips. STRIP names the program that strips the library (such as
aarch64-linux-gnu-strip, strip, llvm-strip, or none), SOURCE_DATE_EPOCH the time of all files (that of the last commit),
VRTM_WHEEL_PLATFORM the wheel's platform tag, VRTM_REPOSITORY the repository's address, for the links of the descriptions of
the wheel and the npm package (without it they are text). Linux: the oldest glibc that the library runs with follows from the
one that it is linked with: --glibc names one, or build on the oldest system you support.
END
}

fail() {
    echo "release.sh: $*" >&2
    exit 2
}

here=$(cd "$(dirname "$0")" && pwd)
source=$(cd "$here/.." && pwd)
out='' glibc='' max_glibc='' target='' prebuilt='' python='' web=''
install_options='' linked=''
while [ $# -gt 0 ]; do
    option=$1
    shift
    case $option in
        --help | -h) help; exit 0 ;;
        --no-gpu) install_options="$install_options --no-gpu" linked="$linked --no-default-features"; continue ;;
        --web) web=1; continue ;;
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
        --glibc) glibc=$value ;;
        --max-glibc) max_glibc=$value ;;
        --python)
            python=$(command -v "$value") || fail "--python is $value, which is not there"
            python=$(cd "$(dirname "$python")" && pwd)/$(basename "$python")
            ;;
        --prebuilt) prebuilt=$value ;;
        --target | --profile | --features | --target-dir)
            [ "$option" != --target ] || target=$value
            [ "$option" != --features ] || linked="$linked --features $value"
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

stamp=$(date -u -d "@$SOURCE_DATE_EPOCH" +%Y%m%d%H%M.%S 2>/dev/null || date -u -r "$SOURCE_DATE_EPOCH" +%Y%m%d%H%M.%S)
# The same bytes each time: GNU's tar and BSD's differ in the options for that.
pack() { # FOLDER-IN-WORK zip|tar.xz
    find "$work/$1" -type d -exec chmod 755 {} +
    find "$work/$1" -exec touch -h -t "$stamp" {} +
    (cd "$work" && find "$1" | sort) >"$work/list"
    rm -f "$out/$1.$2"
    if [ "$2" = zip ]; then
        (cd "$work" && zip -q -X -9 "$out/$1.zip" -@ <list)
    else
        owner='--uid 0 --gid 0 --uname root --gname root'
        if tar --version | grep -q GNU; then
            owner='--owner=root:0 --group=root:0 --format=gnu --mode=u+rw,go+r,go-w'
        fi
        # shellcheck disable=SC2086 # Several options.
        tar -C "$work" -c -f "$work/archive.tar" $owner --no-recursion -T "$work/list"
        xz -9e -T1 -c "$work/archive.tar" >"$out/$1.tar.xz"
    fi
    made="$made $1.$2"
}

# What is in the files that were made, and the sums of all that lie there.
finish() { # SYSTEM
    cd "$out"
    if [ -n "$python" ]; then
        # shellcheck disable=SC2086 # Several options, several files.
        "$python" "$here/spdx.py" --system "$1" $linked $made >"vrtm-$version-$1.spdx.json"
        made="$made vrtm-$version-$1.spdx.json"
    fi
    if command -v sha256sum >/dev/null; then
        sha256sum vrtm-* >SHA256SUMS
    else
        shasum -a 256 vrtm-* >SHA256SUMS
    fi
    for file in $made SHA256SUMS; do
        echo "$out/$file"
    done
    exit 0
}

made=
if [ -n "$web" ]; then
    for folder in bindings/web/dist examples/web/dist; do
        [ -d "$source/$folder" ] || fail "$folder is missing: npm ci && npm run build, in bindings/web"
    done
    mkdir "$work/npm"
    cp -R "$here/web/package.json" "$here/web/dist" "$work/npm/"
    "${python:-python3}" "$here/links.py" "$here/web/README.md" >"$work/npm/README.md"
    (
        cd "$work/npm"
        [ -z "${VRTM_REPOSITORY:-}" ] || npm pkg set "repository=git+$VRTM_REPOSITORY.git"
        npm pack --silent --ignore-scripts --pack-destination "$out"
    ) >/dev/null
    made=vrtm-$version.tgz
    cp -R "$source/examples/web/dist" "$work/vrtm-page-$version"
    pack "vrtm-page-$version" zip
    finish web
fi

tree=$work/$name
if [ -n "$glibc" ]; then
    case $triple in *-linux-gnu) ;; *) fail "--glibc is for Linux, not for $triple" ;; esac
    # Cargo builds anew what another linker has linked: it keeps its name.
    mkdir -p "${CARGO_TARGET_DIR:-$source/target}"
    linker=${CARGO_TARGET_DIR:-$source/target}/link-for-glibc-$glibc
    printf '#!/bin/sh\nexec %s cc -target %s "$@"\n' "${ZIG:-zig}" "${triple%%-*}-linux-gnu.$glibc" >"$linker"
    chmod 755 "$linker"
    export "CARGO_TARGET_$(echo "$triple" | tr 'a-z-' 'A-Z_')_LINKER=$linker"
    [ -n "$target" ] || install_options="$install_options --target=$triple"
    max_glibc=${max_glibc:-$glibc}
fi

# With its symbols, which are split off below.
export CARGO_PROFILE_DIST_STRIP=none CARGO_PROFILE_DIST_DEBUG=line-tables-only
# shellcheck disable=SC2086 # None of the options holds a blank.
sh "$here/install.sh" --prefix "$tree" ${prebuilt:+--prebuilt "$prebuilt"} $install_options

# What is stripped is neither used by programs nor by the loader: debuggers find it in a file of its own, by its name in the
# library. Another target's file takes that target's programs.
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
symbols=$(basename "$library").debug
mkdir "$tree-debug"
if [ "$strip" != none ]; then
    objcopy=${strip%strip}objcopy
    command -v "$objcopy" >/dev/null || objcopy=true # Not in Apple's tools.
    "$objcopy" --only-keep-debug "$library" "$tree-debug/$symbols"
    "$strip" "$options" "$library" || fail "$strip does not strip $library: set STRIP, to llvm-strip for instance"
    (cd "$tree-debug" && "$objcopy" --add-gnu-debuglink="$symbols" "$library")
fi
for path in "$source" "${CARGO_HOME:-${HOME:-}/.cargo}"; do
    ! cat "$library" "$tree-debug"/* 2>/dev/null | grep -qaF "$path/" ||
        fail "the library holds $path: build it without --prebuilt and RUSTFLAGS, or with RUSTFLAGS=--remap-path-prefix=$path=/"
done
needed=
case $triple in
    *-linux-gnu)
        needed=$(readelf -VW "$library" | sed -n 's/.*Name: GLIBC_\([0-9.]*\) .*/\1/p' | sort -t. -k1,1n -k2,2n | tail -n 1)
        newest=$(printf '%s\n%s\n' "$needed" "${max_glibc:-$needed}" | sort -t. -k1,1n -k2,2n | tail -n 1)
        [ "$newest" = "${max_glibc:-$needed}" ] ||
            fail "the library needs glibc $needed, but --max-glibc is $max_glibc"
        ;;
esac

case $triple in *-windows-*) pack "$name" zip ;; *) pack "$name" tar.xz ;; esac
[ ! -f "$tree-debug/$symbols" ] || pack "$name-debug" tar.xz
[ -n "$python" ] || finish "$triple"

[ -z "$needed" ] || : "${VRTM_WHEEL_PLATFORM:=manylinux_$(echo "$needed" | tr . _)_${triple%%-*}}"
export VRTM_WHEEL_PLATFORM="${VRTM_WHEEL_PLATFORM:-}" VRTM_LIBRARY="$library" PYTHONDONTWRITEBYTECODE=1
mkdir "$work/wheel"
"$python" -m pip wheel --quiet --disable-pip-version-check --no-deps --no-build-isolation --wheel-dir "$work/wheel" \
    "$here/python"
wheel=$(basename "$work"/wheel/*.whl)
if [ -n "$needed" ] && "$python" -c 'import auditwheel' 2>/dev/null; then
    "$python" -m auditwheel show "$work/wheel/$wheel" >"$work/audit" || fail "auditwheel: $(cat "$work/audit")"
    tr -s '\n ' '  ' <"$work/audit" | grep -qF "platform tag: \"$VRTM_WHEEL_PLATFORM\"" ||
        fail "auditwheel does not confirm $VRTM_WHEEL_PLATFORM: set VRTM_WHEEL_PLATFORM. $(cat "$work/audit")"
fi
cp "$work/wheel/$wheel" "$out/"
"$python" "$here/blender/build.py" --wheel "$work/wheel/$wheel" --out "$work/addon" >/dev/null
addon=$(basename "$work"/addon/*.zip)
cp "$work/addon/$addon" "$out/"
made="$made $wheel $addon"
case $triple in # Unity runs on these.
    x86_64-*-linux-gnu | x86_64-*-windows-* | *-apple-darwin)
        unity=$("$python" "$here/unity.py" --out "$out" "$triple=$library")
        made="$made $(basename "$unity")"
        ;;
esac
finish "$triple"
