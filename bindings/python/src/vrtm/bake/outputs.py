"""Kinds of files: those per frame and tile, straight from the library, and redirected corner UVs per mesh and frame."""

import os
from dataclasses import dataclass

import numpy as np

from vrtm.bake import overwrite
from vrtm.bake.failure import unwritable
from vrtm.bake.frames import Frame
from vrtm.bake.layer.clips import corner_uv_layer, export, values_hash
from vrtm.bake.mark import found_in
from vrtm.bake.names import Pattern
from vrtm.bake.scene import Shape
from vrtm.bake.settings import Settings

FETCH = {"tile": "redirection", "udim": "redirection_udim", "delta": "redirection_delta"}
"""The library's names of the forms of redirections."""
_OF_SET = {"udim": "uv_set", "delta": "uv_set_delta"}
"""The same, as UVs of the set that textures are looked up by."""
_RGB = ("R", "G", "B")
_RGBA = ("R", "G", "B", "A")
ENDING = ".usdc"
_INPUTS = "vrtm_inputs"
_VALUES = "vrtm_values"


@dataclass(frozen=True)
class Output:
    """One kind of file."""

    kind: str
    """Its name in file names and metadata."""
    form: str | None
    """The kind of its UVs, if it holds UVs."""
    fetch: str
    """The library's name of it."""
    fetched: int
    """Channels of the image that is fetched."""
    channels: tuple[str, ...]
    """Channels of the file: as many, or all alike."""
    dtype: str

    def image(self, tile, size: tuple[int, int]) -> np.ndarray:
        """(height, width, channels) of a tile that is solved, the first row at the top."""
        dtype, uv_set = np.dtype(self.dtype).type, int(self.fetch in _OF_SET.values())
        pixels = tile.fetch(self.fetch, size, dtype=dtype, channels=self.fetched, uv_set=uv_set)
        return np.broadcast_to(pixels, (*pixels.shape[:2], len(self.channels))) if self.fetched == 1 else pixels


def listed(settings: Settings) -> tuple[Output, ...]:
    """The kinds that are asked for; the first is the redirection."""
    dtype = "float16" if settings.half else "float32"

    channels = _RGBA if settings.alpha else _RGB
    fetch = (FETCH if settings.options.texture_uv is None else _OF_SET)[settings.form]
    outputs = [Output("redirect", settings.form, fetch, len(channels), channels, dtype)]
    if settings.warp:
        outputs.append(Output("warp", "tile", "warp", 3, _RGB, dtype))
    if settings.jacobian:
        outputs.append(Output("jacobian", None, "jacobian", 4, _RGBA, dtype))
    if settings.filter_scale:
        # Three times the same number: programs that read one channel alone show it as red, or not at all.
        outputs.append(Output("filter", None, "filter_scale", 1, _RGB, dtype))
    return tuple(outputs)


def frame_name(pattern: Pattern, mesh: str, frame: Frame, kind: str = "corners", ending: str = ENDING) -> str:
    """The name below the output folder of a file of no single tile: that of the maps, without a tile's number."""
    folder, name = os.path.split(pattern.text)
    parts = [part for part in name[: -len(".exr")].split(".") if part not in ("<UDIM>", "<subset>")]
    stripped = "/".join(filter(None, [folder, ".".join(parts) + ".exr"]))
    return Pattern(stripped, {"<subset>": 1}).name(mesh, kind, frame, "all", ending, subset="all")


@dataclass(frozen=True)
class CornerFile:
    """A file of a frame's corner UVs."""

    path: str
    inputs: str
    """A hash of all that it depends on."""

    def write(self, shape: Shape, frame: Frame, uvs: np.ndarray) -> None:
        """Writes (corners, 2) UVs. Raises Failure."""
        layer = corner_uv_layer(shape, frame, uvs)
        layer.customLayerData |= {_INPUTS: self.inputs, _VALUES: values_hash(layer)}
        try:
            export(layer, self.path, values_hash)
        except OSError as error:
            overwrite.remove_damaged(self.path, _recorded)
            raise unwritable(self.path, error) from error

    def up_to_date(self) -> bool:
        """True if the file is there, whole, and made of these inputs. A damaged one of vrtm's own is removed."""
        recorded = _recorded(self.path)
        if recorded is None:
            overwrite.remove_damaged(self.path, _recorded)
        return recorded is not None and recorded.get(_INPUTS) == self.inputs


def _recorded(path: str) -> dict | None:
    """The custom data of a file; None if it cannot be read, or its values are others than it states."""
    if not os.path.isfile(path):
        return None
    told, values = found_in(path, lambda layer: (dict(layer.customLayerData), values_hash(layer)), ({}, ""))
    return told if told.get(_VALUES) == values else None
