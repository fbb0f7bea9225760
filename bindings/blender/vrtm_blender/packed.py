"""Images out of arrays, packed into the file, with UDIM tiles, too; and images of files."""

from __future__ import annotations

import contextlib
import os
import tempfile

import bpy
import numpy as np

from .messages import Problem

# The key of an image without tiles.
WHOLE = 0


def image(name: str, tiles: dict[int, np.ndarray], like: bpy.types.Image | None = None) -> bpy.types.Image:
    """A new image, packed into the file: of one picture (the key WHOLE), or of tiles by their UDIM numbers, each
    (height, width, 4) float32 with the bottom row first. Its colours are meant as those of `like`; without it they are
    data of 8 bits."""
    if WHOLE not in tiles:
        return _tiled(name, tiles, like)
    made = _whole(name, tiles[WHOLE], like)
    made.pack()
    return made


def from_file(path: str, source: str = "FILE", check_existing: bool = False) -> bpy.types.Image:
    """A file's image, as data."""
    made = bpy.data.images.load(path, check_existing=check_existing)
    if bpy.data.filepath:
        # Beside the file, so that both can be moved together; on another drive of Windows there is no such path.
        with contextlib.suppress(ValueError):
            made.filepath = bpy.path.relpath(path)
    made.source = source
    made.colorspace_settings.name, made.alpha_mode = "Non-Color", "CHANNEL_PACKED"
    return made


def _interpret(made: bpy.types.Image, like: bpy.types.Image | None) -> None:
    """As `like` is; but floats are linear in memory, whatever the file's own space is."""
    if like is None:
        made.colorspace_settings.name = "Non-Color"
        return
    if not like.is_float or like.colorspace_settings.is_data:
        made.colorspace_settings.name = like.colorspace_settings.name
    made.alpha_mode = like.alpha_mode


def _whole(name: str, pixels: np.ndarray, like: bpy.types.Image | None) -> bpy.types.Image:
    height, width = pixels.shape[:2]
    deep = like is not None and like.is_float
    made = bpy.data.images.new(name, width, height, alpha=True, float_buffer=deep)
    _interpret(made, like)
    made.pixels.foreach_set(pixels.ravel())
    return made


def _tiled(name: str, tiles: dict[int, np.ndarray], like: bpy.types.Image | None) -> bpy.types.Image:
    """A script can write the first tile of a tiled image only: so each tile goes through a file."""
    suffix, form = (".exr", "OPEN_EXR") if like is not None and like.is_float else (".png", "PNG")
    with tempfile.TemporaryDirectory(prefix="vrtm-") as folder:
        for udim, pixels in tiles.items():
            one = _whole(name, pixels, like)
            try:
                one.file_format = form
                path = os.path.join(folder, f"tile.{udim}{suffix}")
                one.save(filepath=path)
                if not os.path.exists(path) or not os.path.getsize(path):
                    raise Problem(f"image {name!r} cannot be written: is there room in {tempfile.gettempdir()}?")
            finally:
                bpy.data.images.remove(one)
        made = bpy.data.images.load(os.path.join(folder, f"tile.{min(tiles)}{suffix}"))
        made.name, made.source = name, "TILED"
        made.filepath = os.path.join(folder, f"tile.<UDIM>{suffix}")
        _interpret(made, like)
        made.pack()
    return made
