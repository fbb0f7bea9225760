"""The plan of a layer."""

from __future__ import annotations

import functools
from collections.abc import Callable
from dataclasses import dataclass, field, replace

import numpy as np

from vrtm.bake.frames import Frame

PRIMVAR = "st_redirected"
"""Name of the primvar with redirected corner UVs."""

LAYER = "vrtmLayer"
"""Name of the primvar that says which layer's maps each face takes."""

UDIM = "<UDIM>"
"""Placeholder that renderers replace by the number of a tile."""


@dataclass(frozen=True)
class LayerPlan:
    """The baked files, and their use by the shot's materials. All paths are relative to the layer, or absolute."""

    frames: tuple[Frame, ...]
    """Frames that were baked."""
    shapes: tuple[str, ...]
    """Names of the shapes that were baked."""
    tiles: dict[str, tuple[int, ...]] = field(default_factory=dict)
    """UDIM numbers of the tiles of each shape."""
    face_layers: dict[str, np.ndarray] = field(default_factory=dict)
    """The layer of each face, of shapes that have several: which maps it takes, where charts lie over one another; -1
    where it takes none, and stays as it is."""
    parts: dict[str, dict[str, str]] = field(default_factory=dict)
    """The parts of shapes that were baked by themselves: their names by those of the subsets, "" standing for the faces
    in none of them."""
    map_path: Callable[..., str] | None = None
    """The redirection map of (shape, frame, UDIM number or "<UDIM>"); of a further layer with its number as `layer`,
    and of a part with its name as `subset`. None: there are no maps."""
    form: str = "udim"
    """UVs of the maps: `udim`, `tile` or `delta`."""
    warped_path: Callable[..., str | None] | None = None
    """The warped copy of (shape, frame, texture as the material names it, resolved where it is one file), `layer` and
    `subset` as above; in the path `<UDIM>` stands for the number if the texture's name has it. None: this texture was
    not warped."""
    corner_path: Callable[[str, Frame], str] | None = None
    """The file of corner UVs of (shape, frame), which all networks take then. None: networks look the redirection map
    up where they can, else they take warped textures."""
    freeze: Frame | None = None
    """The frame whose files are named at all times; None: each frame has its own."""
    time_of: Callable[[Frame], float] = float
    """The time code of a frame."""

    def of(self, subset: str, layer: int) -> LayerPlan:
        """The plan with the files of a part and a layer, for the materials of its faces."""
        of = {name: value for name, value in (("subset", subset), ("layer", layer)) if value}
        paths = {"map_path": self.map_path, "warped_path": self.warped_path}
        return replace(self, **{name: functools.partial(path, **of) for name, path in paths.items() if path})

    def values(self, path_of: Callable[[Frame], str]) -> list[tuple[str, float | None]]:
        """(path, time code) of a file that there is of each frame; None stands for all times."""
        if self.freeze is not None:
            return [(path_of(self.freeze), None)]
        return [(path_of(frame), self.time_of(frame)) for frame in sorted(self.frames)]

    def map_of(self, shape: str, frame: Frame) -> str:
        """The map of a frame as a renderer takes it: with <UDIM>, unless there is the tile 1001 alone."""
        assert self.map_path is not None
        only = tuple(self.tiles.get(shape, (1001,))) == (1001,)
        return self.map_path(shape, frame, 1001 if only else UDIM)
