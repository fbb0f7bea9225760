#!/bin/sh
# Makes a folder with a small Debian that holds Blender 4.3 and what draws its window without a screen: about 450 MB to
# load and 1.9 GB on disk. Blender's Python module has no window, and some things happen in one only.
#
#     setup.sh FOLDER
#
# Prints nothing if it is there. Where it cannot be made, prints one line that says why, and ends with exit code 3.
set -eu
folder=${1:?setup.sh FOLDER}
stamp=$folder/.vrtm-blender-2
release=trixie
packages="blender openbox python3-numpy python3-pytest libgl1-mesa-dri scrot xdotool xvfb"
PATH=$PATH:/usr/sbin:/sbin

cannot() {
    echo "$1"
    exit 3
}

[ ! -e "$stamp" ] || exit 0
[ "$(uname -sm)" = "Linux x86_64" ] || cannot "it is made on Linux x86_64 alone"
[ "$(id -u)" = 0 ] || cannot "it takes root"
for program in debootstrap unshare chroot; do
    command -v $program >/dev/null || cannot "$program is not there"
done
unshare --mount true 2>/dev/null || cannot "nothing can be mounted here"
log=$(mktemp)
trap 'rm -f "$log"' EXIT
rm -rf "$folder"
mkdir -p "$folder"
limit=
! command -v timeout >/dev/null || limit="timeout ${VRTM_SETUP_SECONDS:-900}"
# What is mounted is seen by these processes alone, and gone with them: whoever removes the folder removes nothing else.
$limit unshare --mount sh -eu -c '
    debootstrap --variant=minbase "$1" "$2"
    mount -t proc proc "$2/proc"
    cp /etc/resolv.conf "$2/etc/resolv.conf"
    DEBIAN_FRONTEND=noninteractive chroot "$2" sh -euc "apt-get update -qq
        apt-get install -y -qq --no-install-recommends $3
        apt-get clean"
' setup "$release" "$folder" "$packages" >"$log" 2>&1 || cannot "Blender cannot be had: $(tail -n 1 "$log" | cut -c1-200)"
touch "$stamp"
