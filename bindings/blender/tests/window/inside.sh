#!/bin/sh
# Within setup.sh's Debian: a screen in memory, a window manager, and Blender in a window that fills the screen, with one
# check.
export BLENDER_USER_RESOURCES=/tmp/vrtm-blender PYTHONDONTWRITEBYTECODE=1
rm -rf "$BLENDER_USER_RESOURCES" /tmp/display
mkdir -p /tmp/.X11-unix
mkfifo /tmp/display
Xvfb -displayfd 3 -screen 0 1600x1000x24 +extension GLX -nolisten tcp 3>/tmp/display &
read -r number </tmp/display
export DISPLAY=:$number
openbox &
blender --background --factory-startup --python-exit-code 1 --python /vrtm/sample.py -- /tmp/arm.blend --width 480 --samples 8 || exit
blender --factory-startup --window-geometry 0 0 1600 1000 --python-exit-code 1 --python /vrtm/tests/window/driver.py -- "$1"
