"""Differences between versions of Blender, from 4.2 to 5.2. No other module asks for the version."""

from __future__ import annotations

import bpy

# From Blender 5.0 on a property says that it takes paths beside the file; without that a warning is printed.
PATH_OPTIONS = {"options": {"ANIMATABLE", "PATH_SUPPORTS_BLEND_RELATIVE"}} if bpy.app.version >= (5, 0, 0) else {}


def set_input(modifier: bpy.types.Modifier, name: str, value: object) -> None:
    """Sets an input of a Geometry Nodes modifier, which is a custom property before Blender 5.2."""
    key = _identifier(modifier, name)
    if hasattr(modifier, "properties"):
        getattr(modifier.properties.inputs, key).value = value
    else:
        modifier[key] = value


def image_of(modifier: bpy.types.Modifier) -> bpy.types.Image | None:
    """The input "Image" of a Geometry Nodes modifier."""
    key = _identifier(modifier, "Image")
    new = hasattr(modifier, "properties")
    found = getattr(modifier.properties.inputs, key).value if new else modifier.get(key)
    return found if isinstance(found, bpy.types.Image) else None


def _identifier(modifier: bpy.types.Modifier, name: str) -> str:
    sockets = modifier.node_group.interface.items_tree
    return next(one.identifier for one in sockets if one.name == name and one.in_out == "INPUT")


def is_used(owner: bpy.types.ID) -> bool:
    """True if other data uses a data-block. Blender 5.2 goes on counting it as used by a modifier that was removed."""
    return bool(bpy.data.user_map(subset=[owner])[owner])


def unified_paint_settings(scene: bpy.types.Scene) -> bpy.types.UnifiedPaintSettings:
    """The brushes' common settings, from Blender 5.0 on those of Texture Paint mode."""
    tools = scene.tool_settings
    owner = tools.image_paint if hasattr(tools.image_paint, "unified_paint_settings") else tools
    return owner.unified_paint_settings


def save_copy(image: bpy.types.Image, path: str) -> None:
    """Saves an image to another file; the image stays unsaved, and that of its own file."""
    if "save_copy" in bpy.types.Image.bl_rna.functions["save"].parameters:
        image.save(filepath=path, save_copy=True)
        return
    # Blender 4.2 has an operator alone that does so, which moves the path of tiled images on.
    kept = image.filepath_raw
    try:
        with bpy.context.temp_override(edit_image=image):
            bpy.ops.image.save_as("EXEC_DEFAULT", filepath=path, copy=True, save_as_render=False)
    finally:
        image.filepath_raw = kept
