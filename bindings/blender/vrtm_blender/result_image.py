"""An object's result image: the layout of its tiles, and its texels."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import bpy
import numpy as np

from . import exr
from .messages import Problem

if TYPE_CHECKING:
    import vrtm

# The custom property of a result's image with its layout, for the node group and for bakes.
LAYOUT = "vrtm_layout"


@dataclass(frozen=True)
class Layout:
    """The layout of tiles in the image: side by side, as in the UV editor, each of `size` x `size` texels.

    Blender lets scripts write the first tile of a tiled image only. So a result of several tiles is one image without
    tiles, and the node group finds a UV's place in it.
    """

    first_u: int
    first_v: int
    columns: int
    rows: int
    size: int

    @staticmethod
    def of(udims: list[int], size: int) -> Layout:
        us, vs = [(udim - 1001) % 10 for udim in udims], [(udim - 1001) // 10 for udim in udims]
        return Layout(min(us), min(vs), max(us) - min(us) + 1, max(vs) - min(vs) + 1, size)

    @property
    def width(self) -> int:
        return self.columns * self.size

    @property
    def height(self) -> int:
        return self.rows * self.size

    def place(self, udim: int) -> tuple[slice, slice]:
        """Rows and columns of a tile in the image's array, whose first row is the bottom one."""
        x, y = (udim - 1001) % 10 - self.first_u, (udim - 1001) // 10 - self.first_v
        return slice(y * self.size, (y + 1) * self.size), slice(x * self.size, (x + 1) * self.size)

    def numbers(self) -> list[int]:
        return [self.first_u, self.first_v, self.columns, self.rows, self.size]


def layout_of(asset: vrtm.Asset, name: str, map_size: int) -> Layout:
    """The layout of an object's image; `map_size` 0 is as many texels as the largest grid has cells."""
    tiles = asset.tiles
    if not tiles:
        raise Problem(f"{name} has no faces in any UDIM tile (u from 0 to 10, v from 0)")
    size = map_size or max(max(tile.info.grid_width, tile.info.grid_height) for tile in tiles)
    layout = Layout.of([tile.udim for tile in tiles], size)
    if max(layout.width, layout.height) > 65536:
        raise Problem(f"{name}: an image of {layout.width} x {layout.height} texels is too large: lower Map Size")
    return layout


def redirection(asset: vrtm.Asset, layout: Layout, layer: int) -> np.ndarray:
    """The image of a layer of the last result: (height, width, 4) float32, bottom row first; the differences of u and
    v in the first two channels, and 1 in the last one, so that no alpha mode changes the others."""
    image = np.zeros((layout.height, layout.width, 4), np.float32)
    image[..., 3] = 1
    for tile in [tile for tile in asset.tiles if tile.layer == layer]:
        rows, columns = layout.place(tile.udim)
        part = tile.fetch("redirection_delta", (layout.size, layout.size), channels=2, origin="bottom")
        image[rows, columns, :2] = part
    return image


def pack(image: bpy.types.Image) -> None:
    """Packs an image into the file as EXR of 16-bit floats, compressed, and reads it back: differences of UVs lose
    1 / 2048 at most, a tenth of a texel of 4096 for one of 0.05. Blender's own `pack` takes 16 bytes for each texel.
    Raises RuntimeError."""
    pixels = np.empty((image.size[1], image.size[0], 4), np.float32)
    image.pixels.foreach_get(pixels.ravel())
    data = exr.file_of(pixels, {}, halves=True)
    image.pack(data=data, data_len=len(data))
    # From now on it is read from there.
    image.source = "FILE"
    image.buffers_free()


def is_result(image: bpy.types.Image | None) -> bool:
    """True if an image was made for a result. The artist may choose another one in the panel, which is not written
    to."""
    return image is not None and LAYOUT in image


def has_pixels(image: bpy.types.Image) -> bool:
    """True if an image has pixels. One that existed in memory only is empty when the file is opened: so it is with
    files that Blender saved on a timer, or without this add-on."""
    if image.is_dirty or image.packed_file is not None:
        return True
    return image.source != "GENERATED" and image.size[0] > 0
