#!/bin/sh
# Makes the pictures of the add-on's README out of the walk's screenshots; takes ImageMagick.
#
#     VRTM_PICTURES=FOLDER sh run.sh walk && sh pictures.sh FOLDER
set -eu
cd "${1:?pictures.sh FOLDER}"
images=$(cd "$OLDPWD/$(dirname "$0")/../../../../docs/images" && pwd)
small="-resize 60% -quality 82"
# Without the window's title and its status bar.
convert 1_opened.png -crop 1600x925+0+50 $small "$images/blender_opened.jpg"
convert 2_set_up.png -crop 1600x925+0+50 $small "$images/blender_set_up.jpg"
convert \( 3_menu.png -crop 440x925+1160+50 +repage \) \( 3_from_texture.png -crop 840x925+0+50 +repage \) +append \
    $small "$images/blender_rigidity.jpg"
convert \( 4_strain_before.png -crop 1180x880+50+95 +repage \) \( 4_strain_after.png -crop 1180x880+50+95 +repage \) \
    +append -resize 40% -quality 82 "$images/blender_strain.jpg"
convert \( 2_set_up.png -crop 250x925+1350+50 +repage \) \( 3_status.png -crop 250x925+1350+50 +repage \) +append \
    -quality 85 "$images/blender_panel.jpg"
