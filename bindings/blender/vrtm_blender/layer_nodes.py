"""The Geometry Nodes group `vrtm layers`, which makes the attribute of faces that tells layers apart, out of an image:
for an object whose mesh is linked, and cannot keep the attribute itself."""

from __future__ import annotations

from functools import partial

import bpy
import numpy as np

from . import packed, trees, versions

# Of the image: a hash of the faces' layers.
STAMP = "vrtm_faces"
# Texels per row of the image at most. A power of two, so that a row is exact in floats.
WIDTH = 4096


def _fill(tree: bpy.types.NodeTree) -> None:
    """Of face n: the texel in column n % columns and row n / columns, whose values are the layer / 255."""
    link, node, math = tree.links.new, partial(trees.node, tree), partial(trees.operate, tree, "Math")
    given, index = node("NodeGroupInput", 0, 0), node("GeometryNodeInputIndex", 0, 2).outputs[0]
    columns, rows = given.outputs["Columns"], given.outputs["Rows"]
    column = math("ADD", 2, 2, math("MODULO", 1, 2, index, columns), 0.5)
    row = math("ADD", 3, 1, math("FLOOR", 2, 1, math("DIVIDE", 1, 1, index, columns)), 0.5)
    at, image = node("ShaderNodeCombineXYZ", 5, 1), node("GeometryNodeImageTexture", 6, 1)
    image.interpolation, image.extension = "Closest", "EXTEND"
    link(math("DIVIDE", 4, 2, column, columns), at.inputs["X"])
    link(math("DIVIDE", 4, 1, row, rows), at.inputs["Y"])
    link(at.outputs[0], image.inputs["Vector"])
    link(given.outputs["Image"], image.inputs["Image"])
    layer = node("FunctionNodeFloatToInt", 8, 1, rounding_mode="ROUND")
    link(math("MULTIPLY", 7, 1, image.outputs["Color"], 255.0), layer.inputs[0])
    store = node("GeometryNodeStoreNamedAttribute", 9, 0, data_type="INT", domain="FACE")
    link(given.outputs["Geometry"], store.inputs["Geometry"])
    link(given.outputs["Name"], store.inputs["Name"])
    link(layer.outputs[0], trees.enabled(store.inputs, "Value"))
    link(store.outputs["Geometry"], node("NodeGroupOutput", 10, 0).inputs[0])


GROUP = trees.ModifierGroup(
    "vrtm layers", "vrtm_layers_group", {"Image": "Image", "Columns": "Int", "Rows": "Int", "Name": "String"}, _fill
)


def stamp_of(obj: bpy.types.Object) -> str | None:
    """The hash of the layers that the object's modifier gives to faces; None where it gives none."""
    modifier = GROUP.modifier_of(obj)
    image = None if modifier is None else versions.image_of(modifier)
    works = image is not None and modifier.show_viewport and modifier.show_render
    return image.get(STAMP) if works else None


def insert(obj: bpy.types.Object, name: str, values: np.ndarray, stamp: str) -> None:
    """Gives an object the modifier, with the layer of each face, in front of all that may make other faces. It is
    always a new one, of which Blender hears in renders, too."""
    remove(obj)
    columns = min(len(values), WIDTH)
    rows = -(-len(values) // columns)
    texels = np.zeros((rows * columns, 4), np.float32)
    texels[: len(values), :3] = values[:, None] / 255
    texels[:, 3] = 1
    image = packed.image(f"vrtm {obj.name} layers", {packed.WHOLE: texels.reshape(rows, columns, 4)})
    image[STAMP] = stamp
    # In front of a soft body it cannot stand, which keeps the faces.
    soft = [modifier.type == "SOFT_BODY" for modifier in obj.modifiers]
    made = GROUP.insert(obj, at=[*soft, False].index(False))
    for of, value in zip(GROUP.inputs, (image, columns, rows, name)):
        versions.set_input(made, of, value)


def remove(obj: bpy.types.Object) -> None:
    """Removes the modifier, and its unused data."""
    GROUP.remove(obj)
    # Also those of modifiers that the artist has taken away.
    for image in [image for image in bpy.data.images if STAMP in image and image.library is None]:
        if not versions.is_used(image):
            bpy.data.images.remove(image)
