"""The contents of a saved file: nothing that was solved or painted is lost."""

from __future__ import annotations

import bpy

from . import maps, messages, result_image, session


def keep_results() -> None:
    """Packs the images of results, which exist in memory only, so that the opened file has them, with or without this
    add-on."""
    for image in bpy.data.images:
        if not result_image.is_result(image) or image.library is not None:
            continue
        if image.is_dirty or image.packed_file is None:
            try:
                result_image.pack(image)
            except RuntimeError as error:
                session.log.error("image %r cannot be packed into the file: %s", image.name, messages.text_of(error))


def keep_image(image: bpy.types.Image | None) -> None:
    """Has an unused image saved with the file: only the artist deletes it."""
    if image is not None and not image.users and image.library is None:
        image.use_fake_user = True


def replace_image(before: bpy.types.Image | None, image: bpy.types.Image) -> bool:
    """Has a map take the name and the place of the one before, if that was made by this add-on, not painted on, and is
    no other object's; otherwise that is kept. Returns True if it did."""
    if before is None or before == image:
        return False
    maps_of = [{obj.vrtm.rigidity_image, obj.vrtm.mask_image} for obj in bpy.data.objects]
    if before.library is not None or any(before in each for each in maps_of) or not maps.is_as_made(before):
        keep_image(before)
        return False
    name = before.name
    # Whatever else shows it, such as an image editor, goes on with the new one.
    before.user_remap(image)
    bpy.data.images.remove(before)
    image.name = name
    return True


def unsaved_maps(obj: bpy.types.Object) -> list[str]:
    """Painted maps of the object that a file saved now would lack, or that the opened one lacked, in sentences. The
    artist saves or packs them."""
    settings = obj.vrtm
    found = []
    for which in ("rigidity", "mask"):
        image = getattr(settings, f"{which}_image")
        if getattr(settings, f"{which}_source") != "IMAGE" or image is None:
            continue
        if image.is_dirty:
            found.append(f"{which.capitalize()} {image.name!r} is not saved: save or pack the image")
        elif _is_black(image):
            found.append(f"{which.capitalize()} {image.name!r} is black: nothing was painted, or it was not saved")
    return found


def _is_black(image: bpy.types.Image) -> bool:
    """True if an image is as Blender made it: so it comes back, too, if it was painted and not saved."""
    made = image.source == "GENERATED" and image.packed_file is None and image.generated_type == "BLANK"
    return made and not any(image.generated_color[:3])


def tell_unsaved() -> None:
    """Tells the painted maps that the file being saved lacks."""
    for obj in bpy.data.objects:
        for text in unsaved_maps(obj) if obj.vrtm.is_set_up else []:
            session.log.warning("%s: %s", obj.name, text)
            messages.status(f"vrtm: {obj.name}: {text}")
