#!/bin/sh
# Within setup.sh's Debian: a screen in memory, a window manager, and Blender in a window that fills the screen, with one
# check.
here=/vrtm/bindings/blender
export BLENDER_USER_RESOURCES=/tmp/vrtm-blender PYTHONDONTWRITEBYTECODE=1
rm -rf "$BLENDER_USER_RESOURCES" /tmp/display
run() {
    blender --factory-startup --python-exit-code 1 "$@"
}
mkdir -p /tmp/.X11-unix
mkfifo /tmp/display
Xvfb -displayfd 3 -screen 0 1600x1000x24 +extension GLX -nolisten tcp 3>/tmp/display &
read -r number </tmp/display
export DISPLAY=:$number
openbox &
run --background --python $here/sample.py -- /tmp/arm.blend || exit
run --window-geometry 0 0 1600 1000 --python $here/tests/window/driver.py -- "$1"
