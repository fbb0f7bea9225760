"""Layers: if charts lie over one another in the UV map, as mirrored halves do, each layer of them has an image of its
own, and an attribute of faces tells the material which one to look up. A linked mesh cannot keep the attribute: a
modifier of the object makes it.

The image of the first layer is the object's result image, as where there is one layer alone. Each image knows the next
one (Image.vrtm_next), so that all of them are there as long as the first is.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import TYPE_CHECKING

import bpy
import numpy as np

from . import geometry, layer_nodes, session, tap

if TYPE_CHECKING:
    import vrtm

# Custom properties: of the first image the number of layers, if there are several; of the others their own layer.
NUMBER, LAYER = "vrtm_layers", "vrtm_layer"
# The most layers that are asked for.
MOST = 32


def number_of(asset: vrtm.Asset) -> int:
    return max((tile.layers for tile in asset.tiles), default=1)


def images_of(first: bpy.types.Image | None) -> list[bpy.types.Image]:
    """The images of all layers, by the first one."""
    found: list[bpy.types.Image] = []
    while first is not None and first not in found:
        found.append(first)
        first = first.vrtm_next
    return found


def own_images(first: bpy.types.Image, number: int, new: Callable[[int], bpy.types.Image]) -> list[bpy.types.Image]:
    """The images of `number` layers, of which the first is given; `new` makes missing ones."""
    found = [image for image in images_of(first)[:number] if image == first or image.library is None]
    for layer in range(len(found), number):
        image = new(layer)
        image[LAYER] = layer
        found.append(image)
    for image, following in zip(found, [*found[1:], None]):
        if image.vrtm_next != following:
            image.vrtm_next = following
    if number > 1:
        first[NUMBER] = number
    elif NUMBER in first:
        del first[NUMBER]
    return found


def remove_unused() -> None:
    """Removes the images of layers that are gone. In a render they may still be looked up."""
    while not session.rendering:
        following = {image.vrtm_next for image in bpy.data.images}
        unused = [i for i in bpy.data.images if LAYER in i and i.library is None and i not in following]
        if not unused:
            return
        for image in unused:
            bpy.data.images.remove(image)


def attribute_name(settings: bpy.types.PropertyGroup) -> str:
    """Of the attribute of faces. Objects that share a mesh have one each."""
    return f"{settings.uv_name}_layer"


def attribute_of(obj: bpy.types.Object) -> bpy.types.Attribute | None:
    found = obj.data.attributes.get(attribute_name(obj.vrtm))
    return found if found is not None and (found.domain, found.data_type) == ("FACE", "INT") else None


def missing(obj: bpy.types.Object) -> str | None:
    """The missing part of the layers of the object's result, in words."""
    image = obj.vrtm.image
    number = image.get(NUMBER, 1)
    if len(images_of(image)) != number:
        return "The result image of a layer is not there"
    if number > 1 and attribute_of(obj) is None and not _is_made(obj):
        return "The attribute that tells layers apart is not there"
    return None


def _is_made(obj: bpy.types.Object) -> bool:
    """True if a modifier of the object makes the attribute, before others make other faces."""
    made = layer_nodes.GROUP.modifier_of(obj)
    if made is None or layer_nodes.stamp_of(obj) is None:
        return False
    return not any(map(tap.changes_topology, obj.modifiers[: obj.modifiers.find(made.name)]))


def write(obj: bpy.types.Object, values: np.ndarray | None) -> None:
    """Writes the layer of each face; None: there is one layer, and no attribute."""
    # Baked files that are shown may have more layers than the result has now.
    if values is None and obj.vrtm.shows_baked:
        return
    mesh, attribute, is_linked = obj.data, attribute_of(obj), geometry.is_linked(obj)
    values = None if values is None else values.astype(np.int32)
    kept = None if attribute is None else geometry.read(attribute.data, "value", 1, np.int32)
    # A write makes Blender evaluate the mesh again: only if there is something to write.
    same = np.array_equal(kept, values)
    if is_linked and values is not None and not same:
        stamp = geometry.stamp_of(values).hex()
        if layer_nodes.stamp_of(obj) != stamp or not _is_made(obj):
            layer_nodes.insert(obj, attribute_name(obj.vrtm), values, stamp)
        return
    layer_nodes.remove(obj)
    if same or is_linked:
        return
    if values is None:
        mesh.attributes.remove(attribute)
    else:
        geometry.write(mesh, attribute_name(obj.vrtm), "FACE", "INT", values)
    if not session.rendering:
        mesh.update_tag()
