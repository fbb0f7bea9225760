"""Copies of textures that show, around each chart, the surface beyond the chart's seams: redirections of seams that
continue lead there.

A copy is an image that is packed into the file, and knows the image that it was made of (Image.vrtm_original). The
materials' nodes show the copy; taking the redirection out of a material gives them the original back.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable
from typing import TYPE_CHECKING

import bpy
import numpy as np

from . import layers, maps, materials, packed, picture, session
from .messages import Problem
from .packed import WHOLE

if TYPE_CHECKING:
    import vrtm

# The custom property of a copy: the reach that it was made with.
REACH = "vrtm_reach"


def textures_of(obj: bpy.types.Object) -> list[bpy.types.Node]:
    """The Image Texture nodes of the object's materials that are looked up at redirected UVs; no moving pictures."""
    found = [node for material in materials.materials_of(obj) for node in picture.redirected(material)]
    return [node for node in found if node.image.source not in ("SEQUENCE", "MOVIE", "VIEWER")]


def is_dilated(image: bpy.types.Image, reach: float) -> bool:
    """True if an image is a copy that was made with a reach."""
    return REACH in image and abs(image[REACH] - reach) <= 1e-6


def dilate(obj: bpy.types.Object, asset: vrtm.Asset, reach: float) -> tuple[int, list[str]]:
    """Makes the copies of all textures that are looked up at redirected UVs, anew where there are some. Returns their
    number, and the names of old copies that were painted on: they are kept."""
    textures = textures_of(obj)
    if not textures:
        raise Problem(f"{obj.name}: no texture is looked up at redirected UVs: set the material up first")
    if any(node.id_data.library is not None for node in textures):
        raise Problem(f"{obj.name}: a material is linked from another file: make it local")
    wanted = {node: (node.image.vrtm_original or node.image, _holds_normals(node)) for node in textures}
    done: dict[tuple[bpy.types.Image, bool], bpy.types.Image] = {}
    try:
        for original, normals in dict.fromkeys(wanted.values()):
            done[original, normals] = _copy(original, asset, reach, normals)
    except BaseException:
        # Nothing was changed yet.
        for copy in done.values():
            bpy.data.images.remove(copy)
        raise
    before = dict.fromkeys(node.image for node in textures)
    for node, key in wanted.items():
        node.image = done[key]
    painted = _let_go(before)
    for (original, _), copy in done.items():
        # The name may be free now.
        copy.name = f"{original.name} dilated"
    return len(done), painted


def restore(obj: bpy.types.Object) -> list[str]:
    """Has the object's materials show the originals again. Returns the names of copies that were painted on: they are
    kept."""
    before = {}
    for material in materials.materials_of(obj):
        for node, _ in picture.textures(material, drawn=False):
            if node.id_data.library is None and (image := node.image).vrtm_original is not None and REACH in image:
                before[image] = None
                node.image = image.vrtm_original
    return _let_go(before)


def _let_go(images: Iterable[bpy.types.Image]) -> list[str]:
    """Removes unused copies. One that was painted on stays, and is saved with the file."""
    kept = []
    for image in images:
        if REACH not in image or image.users:
            continue
        if maps.is_as_made(image):
            bpy.data.images.remove(image)
            continue
        image.use_fake_user, image.vrtm_original = True, None
        del image[REACH], image[maps.STAMP]
        kept.append(image.name)
    return kept


def _holds_normals(node: bpy.types.Node) -> bool:
    """True if a texture goes into a Normal Map node of tangent space, through Reroutes at most."""
    links = list(node.outputs["Color"].links)
    while links:
        to = links.pop().to_node
        if to.bl_idname == "NodeReroute":
            links += to.outputs[0].links
        elif to.bl_idname == "ShaderNodeNormalMap" and to.space == "TANGENT":
            return True
    return False


def _copy(image: bpy.types.Image, asset: vrtm.Asset, reach: float, normals: bool) -> bpy.types.Image:
    dilation = session.library("vrtm.dilation")
    tiles = {udim or WHOLE: np.ascontiguousarray(pixels[::-1]) for udim, pixels in maps.read_image(image).items()}
    # An image without tiles is repeated on all of them.
    keys = {tile.udim: WHOLE if WHOLE in tiles else tile.udim for tile in asset.tiles}
    keys = {udim: key for udim, key in keys.items() if key in tiles}

    def known_in(layer: int) -> Callable[[int, tuple[int, int]], np.ndarray]:
        tile_of = {tile.udim: tile for tile in asset.tiles if tile.layer == layer}

        def known(udim: int, size: tuple[int, int]) -> np.ndarray:
            if udim not in tile_of:
                return np.zeros((size[1], size[0], 4), np.float32)
            return tile_of[udim].dilation(size, reach=reach, channels=4)

        return known

    # No layer's charts are changed; beside them it is the first layer that has something to copy there.
    lookups = [dilation.Lookups(keys, known_in(layer)) for layer in range(layers.number_of(asset))]
    found = dilation.dilated(tiles, lookups, "up" if normals else None)
    copies = {key: np.ascontiguousarray(pixels[::-1]) for key, (pixels, _) in found.items()}
    name = f"{image.name} dilated"
    copy = packed.image(name, copies, image)
    copy.vrtm_original = image
    copy[REACH] = reach
    maps.mark_made(copy)
    return copy
