"""Copies of textures that hold, around each chart, what the surface shows beyond the chart's seams: where seams go on,
redirections lead there.

A copy is an image that is packed into the file, and knows the image that it was made of (Image.vrtm_original). The
materials' nodes show the copy; taking the redirection out of a material gives them the original back.
"""

from __future__ import annotations

import os
import tempfile
from typing import TYPE_CHECKING

import bpy
import numpy as np

from . import maps, nodes, session
from .messages import Problem

if TYPE_CHECKING:
    import vrtm

# The key of an image without tiles.
WHOLE = 0


def materials_of(obj: bpy.types.Object) -> list[bpy.types.Material]:
    found = dict.fromkeys(slot.material for slot in obj.material_slots if slot.material is not None)
    return [material for material in found if material.node_tree is not None]


def textures_of(obj: bpy.types.Object) -> list[bpy.types.Node]:
    """The Image Texture nodes of the object's materials that are looked up at redirected UVs."""
    return [node for material in materials_of(obj) for node in nodes.redirected(material.node_tree)]


def left_of(obj: bpy.types.Object) -> list[bpy.types.Image]:
    """The images that the object's materials look up at redirected UVs, and that no copy was made of."""
    images = dict.fromkeys(node.image for node in textures_of(obj) if node.image.vrtm_original is None)
    return list(images)


def dilate(obj: bpy.types.Object, asset: vrtm.Asset, reach: float) -> int:
    """Makes the copies of all textures that are looked up at redirected UVs, anew where there are some; returns their
    number."""
    done: dict[tuple[bpy.types.Image, bool], bpy.types.Image] = {}
    textures = textures_of(obj)
    if not textures:
        raise Problem(f"{obj.name}: no texture is looked up at redirected UVs: set the material up first")
    for node in textures:
        if node.id_data.library is not None:
            raise Problem(f"{obj.name}: a material is linked from another file: make it local")
        original, normals = node.image.vrtm_original or node.image, _holds_normals(node)
        if (original, normals) not in done:
            done[original, normals] = _copy(original, asset, reach, normals)
        before, node.image = node.image, done[original, normals]
        if before.vrtm_original is not None and not before.users:
            bpy.data.images.remove(before)
    for (original, _), copy in done.items():
        # The name may be free now.
        copy.name = f"{original.name} dilated"
    return len(done)


def restore(obj: bpy.types.Object) -> None:
    """Has the object's materials show the originals again."""
    for material in materials_of(obj):
        for node in material.node_tree.nodes:
            image = node.image if node.bl_idname == "ShaderNodeTexImage" else None
            if image is not None and image.vrtm_original is not None:
                node.image = image.vrtm_original
                if not image.users:
                    bpy.data.images.remove(image)


def _holds_normals(node: bpy.types.Node) -> bool:
    links = node.outputs["Color"].links
    return any(link.to_node.bl_idname == "ShaderNodeNormalMap" for link in links)


def _copy(image: bpy.types.Image, asset: vrtm.Asset, reach: float, normals: bool) -> bpy.types.Image:
    session.library()
    from vrtm import dilation

    tiles = {udim or WHOLE: np.ascontiguousarray(pixels[::-1]) for udim, pixels in maps.read_image(image).items()}
    # An image without tiles is repeated on all of them.
    keys = {tile.udim: WHOLE if WHOLE in tiles else tile.udim for tile in asset.tiles}
    keys = {udim: key for udim, key in keys.items() if key in tiles}

    def known(udim: int, size: tuple[int, int]) -> np.ndarray:
        return asset.tile(udim).dilation(size, reach=reach, channels=4)

    found = dilation.dilated(tiles, [dilation.Lookups(keys, known)], "up" if normals else None)
    copies = {key: np.ascontiguousarray(pixels[::-1]) for key, (pixels, _) in found.items()}
    name = f"{image.name} dilated"
    copy = _whole(image, name, copies[WHOLE]) if WHOLE in copies else _tiled(image, name, copies)
    copy.vrtm_original = image
    return copy


def _whole(image: bpy.types.Image, name: str, pixels: np.ndarray) -> bpy.types.Image:
    height, width = pixels.shape[:2]
    copy = bpy.data.images.new(name, width, height, alpha=True, float_buffer=image.is_float)
    copy.colorspace_settings.name, copy.alpha_mode = image.colorspace_settings.name, image.alpha_mode
    copy.pixels.foreach_set(pixels.ravel())
    copy.pack()
    return copy


def _tiled(image: bpy.types.Image, name: str, tiles: dict[int, np.ndarray]) -> bpy.types.Image:
    """A script can write the first tile of a tiled image only: so each tile goes through a file."""
    suffix, form = (".exr", "OPEN_EXR") if image.is_float else (".png", "PNG")
    with tempfile.TemporaryDirectory(prefix="vrtm-") as folder:
        for udim, pixels in tiles.items():
            height, width = pixels.shape[:2]
            one = bpy.data.images.new(name, width, height, alpha=True, float_buffer=image.is_float)
            try:
                one.colorspace_settings.name, one.alpha_mode = image.colorspace_settings.name, image.alpha_mode
                one.pixels.foreach_set(pixels.ravel())
                one.file_format = form
                path = os.path.join(folder, f"tile.{udim}{suffix}")
                one.save(filepath=path)
                if not os.path.exists(path) or not os.path.getsize(path):
                    raise Problem(f"image {name!r} cannot be written: is there room in {tempfile.gettempdir()}?")
            finally:
                bpy.data.images.remove(one)
        copy = bpy.data.images.load(os.path.join(folder, f"tile.{min(tiles)}{suffix}"))
        copy.name, copy.source = name, "TILED"
        copy.filepath = os.path.join(folder, f"tile.<UDIM>{suffix}")
        copy.colorspace_settings.name, copy.alpha_mode = image.colorspace_settings.name, image.alpha_mode
        copy.pack()
    return copy
