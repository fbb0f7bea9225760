"""Reads rigidity and masks: images as they are painted at present, vertex groups and attributes."""

from __future__ import annotations

import os
import tempfile
from dataclasses import dataclass

import bpy
import numpy as np

from . import versions
from .geometry import corner_vertices, read, stamp_of
from .messages import Problem

# The pixels of Blender's images begin with the bottom row.
ORIGIN = "bottom"
# The custom property of an image that this add-on made: a stamp of its pixels at that time.
STAMP = "vrtm_stamp"


@dataclass(frozen=True)
class Map:
    """A map as it was read: an image per UDIM tile, or one for all tiles (None), or values per vertex, or nothing."""

    tiles: dict[int | None, np.ndarray]  # each (height, width) float32, bottom row first
    vertices: np.ndarray | None  # (vertices,) float32
    stamp: bytes

    def of(self, udim: int) -> np.ndarray | None:
        """The image of a tile. An image without tiles is repeated on all of them, as Blender shows it."""
        return self.tiles.get(udim, self.tiles.get(None))


NOTHING = Map({}, None, b"")


def read_map(obj: bpy.types.Object, which: str) -> Map:
    """The object's map `which`, "rigidity" or "mask"."""
    settings = obj.vrtm
    source = getattr(settings, f"{which}_source")
    if source == "NONE":
        return NOTHING
    if source == "IMAGE":
        image = getattr(settings, f"{which}_image")
        if image is None:
            raise Problem(f"{obj.name}: choose the {which} image")
        channel = "RGBA".index(getattr(settings, f"{which}_channel"))
        tiles = {udim: np.ascontiguousarray(pixels[..., channel]) for udim, pixels in read_image(image).items()}
        return Map(tiles, None, stamp_of_tiles(tiles))
    name = getattr(settings, f"{which}_name")
    values = group_values(obj, name) if source == "VERTEX_GROUP" else attribute_values(obj, name)
    return Map({}, values, stamp_of(values))


def stamp_of_tiles(tiles: dict[int | None, np.ndarray]) -> bytes:
    return stamp_of(*(pixels for _, pixels in sorted(tiles.items(), key=lambda of: of[0] or 0)))


def mark_made(image: bpy.types.Image) -> None:
    """Notes the present pixels of an image as those that this add-on made."""
    image[STAMP] = stamp_of_tiles(read_image(image)).hex()


def is_as_made(image: bpy.types.Image) -> bool:
    """True if an image has the pixels that this add-on made: nothing was painted on it."""
    return STAMP in image and not image.is_dirty and image[STAMP] == stamp_of_tiles(read_image(image)).hex()


def read_image(image: bpy.types.Image) -> dict[int | None, np.ndarray]:
    """The pixels of an image as they are in memory: (height, width, channels) float32 per UDIM tile, bottom row first;
    the only key is None for an image without tiles."""
    if image.source in ("SEQUENCE", "MOVIE", "VIEWER"):
        raise Problem(f"image {image.name!r} is a sequence, a movie or a viewer: a map is one picture")
    if image.source != "TILED":
        return {None: _pixels(image)}
    # A script sees the pixels of an image's first tile only. So tiles are read from a copy of the image, whose first
    # tile is removed again and again. A copy has the tiles on disk: unsaved tiles, and packed ones, of which a copy has
    # the first alone, go through a folder.
    only_in_memory = not image.filepath and not image.packed_files
    if image.is_dirty or only_in_memory:
        found = _unsaved_tiles(image)
    else:
        found = _packed_tiles(image) if image.packed_files else _tiles_of_copy(image)
    if not found:
        raise Problem(f"image {image.name!r} has no pixels in any of its tiles: are its files missing?")
    return found


def _pixels(image: bpy.types.Image) -> np.ndarray:
    width, height = image.size
    if not width or not height or len(image.pixels) != width * height * image.channels:
        raise Problem(f"image {image.name!r} has no pixels: is its file missing?")
    pixels = np.empty(len(image.pixels), np.float32)
    image.pixels.foreach_get(pixels)
    pixels = pixels.reshape(height, width, image.channels)
    # An image of fewer channels is grey, or grey and alpha: any colour channel is the first one.
    if image.channels < 3:
        alpha = pixels[..., 1] if image.channels == 2 else np.ones_like(pixels[..., 0])
        pixels = np.stack([pixels[..., 0]] * 3 + [alpha], -1)
    elif image.channels == 3:
        pixels = np.concatenate([pixels, np.ones_like(pixels[..., :1])], -1)
    return pixels


def _tiles_of_copy(image: bpy.types.Image) -> dict[int | None, np.ndarray]:
    copy = image.copy()
    try:
        found = {}
        while True:
            # A tile without a file counts as not painted.
            if len(copy.pixels):
                found[copy.tiles[0].number] = _pixels(copy)
            if len(copy.tiles) == 1:
                return found
            copy.tiles.remove(copy.tiles[0])
    finally:
        bpy.data.images.remove(copy)


def _unsaved_tiles(image: bpy.types.Image) -> dict[int | None, np.ndarray]:
    with tempfile.TemporaryDirectory(prefix="vrtm-") as folder:
        # As the file format that keeps what is painted, whatever the image's own is.
        kept = image.file_format
        image.file_format = "OPEN_EXR" if image.is_float else "PNG"
        suffix = ".exr" if image.is_float else ".png"
        try:
            versions.save_copy(image, os.path.join(folder, "tile.<UDIM>" + suffix))
        except RuntimeError as error:
            raise Problem(
                f"image {image.name!r}: the painted tiles cannot be read ({' '.join(str(error).split())}): "
                "fill all of its tiles, or save it"
            ) from error
        finally:
            image.file_format = kept
        paths = {tile.number: os.path.join(folder, f"tile.{tile.number}{suffix}") for tile in image.tiles}
        return _tiles_of_files(image, {number: path for number, path in paths.items() if os.path.exists(path)})


def _packed_tiles(image: bpy.types.Image) -> dict[int | None, np.ndarray]:
    with tempfile.TemporaryDirectory(prefix="vrtm-") as folder:
        paths = {}
        for file in image.packed_files:
            path = os.path.join(folder, f"{file.tile_number}{os.path.splitext(file.filepath)[1]}")
            try:
                with open(path, "wb") as out:
                    out.write(file.packed_file.data)
            except OSError as error:
                raise Problem(f"image {image.name!r}: its packed tiles cannot be read: {error}") from error
            paths[file.tile_number] = path
        return _tiles_of_files(image, paths)


def _tiles_of_files(image: bpy.types.Image, paths: dict[int, str]) -> dict[int | None, np.ndarray]:
    """The pixels of an image's tiles out of files that were written for that."""
    found: dict[int | None, np.ndarray] = {}
    for number, path in paths.items():
        # No conversion: the numbers are those of the image's buffer.
        pixels = of_file(path, image.colorspace_settings.name, image.alpha_mode)
        if pixels is None:
            # Blender saves a PNG without a word of a disk that is full.
            raise Problem(
                f"image {image.name!r}: the painted tiles cannot be read: is there room in {tempfile.gettempdir()}?"
            )
        found[number] = pixels
    return found


def of_file(path: str, space: str = "Non-Color", alpha: str = "CHANNEL_PACKED") -> np.ndarray | None:
    """The pixels of a file as Blender reads it, (height, width, channels); None if it cannot."""
    loaded = bpy.data.images.load(path)
    try:
        loaded.colorspace_settings.name, loaded.alpha_mode = space, alpha
        return _pixels(loaded) if loaded.size[0] else None
    finally:
        bpy.data.images.remove(loaded)


def nearest(values: np.ndarray, size: tuple[int, int]) -> np.ndarray:
    """A picture in another size, by its nearest texels."""
    rows, columns = (((np.arange(n) + 0.5) * (m / n)).astype(int) for n, m in zip(size, values.shape))
    return values[rows][:, columns]


def group_values(obj: bpy.types.Object, name: str) -> np.ndarray:
    """The weights of a vertex group, (vertices,) float32; 0 where a vertex is not in the group."""
    group = obj.vertex_groups.get(name)
    if group is None:
        raise Problem(f"{obj.name} has no vertex group {name!r}: choose another in the panel")
    mesh, index = obj.data, group.index
    # Blender has no way to read the weights of all vertices at once; a generator keeps this loop short.
    weights = (next((g.weight for g in vertex.groups if g.group == index), 0.0) for vertex in mesh.vertices)
    return np.fromiter(weights, np.float32, len(mesh.vertices))


def attribute_values(obj: bpy.types.Object, name: str) -> np.ndarray:
    """A colour or float attribute per vertex, (vertices,) float32: of colours the largest channel, and of corners
    the mean around the vertex."""
    mesh = obj.data
    attribute = mesh.attributes.get(name)
    if attribute is None:
        raise Problem(f"{obj.name} has no attribute {name!r}: choose another in the panel")
    if attribute.data_type == "FLOAT":
        values = read(attribute.data, "value", 1)
    elif attribute.data_type in ("FLOAT_COLOR", "BYTE_COLOR"):
        # As they were painted: byte colours are kept with sRGB's curve, and read without it.
        kind = "color_srgb" if attribute.data_type == "BYTE_COLOR" else "color"
        values = read(attribute.data, kind, 4)[:, :3].max(1)
    else:
        raise Problem(f"{obj.name}: attribute {name!r} holds neither colours nor single numbers")
    if attribute.domain == "POINT":
        return values
    if attribute.domain != "CORNER":
        raise Problem(f"{obj.name}: attribute {name!r} is neither of vertices nor of face corners")
    corners = corner_vertices(mesh)
    number = np.bincount(corners, minlength=len(mesh.vertices))
    total = np.bincount(corners, values, minlength=len(mesh.vertices))
    return (total / np.maximum(number, 1)).astype(np.float32)
