"""Files of redirected corner UVs, one per mesh and frame, which record what they were made of."""

from __future__ import annotations

import contextlib
import os
from dataclasses import dataclass

import numpy as np

from vrtm.bake import overwrite
from vrtm.bake.failure import INPUT, Failure, one_line
from vrtm.bake.frames import Frame
from vrtm.bake.names import Pattern
from vrtm.bake.scene import Shape

ENDING = ".usdc"
_INPUTS = "vrtm_inputs"
_VALUES = "vrtm_values"


def corner_name(pattern: Pattern, mesh: str, frame: Frame) -> str:
    """The name below the output folder: that of the maps, of the kind `corners`, without a tile's number."""
    folder, name = os.path.split(pattern.text)
    parts = [part for part in name[: -len(".exr")].split(".") if part not in ("<UDIM>", "<subset>")]
    stripped = "/".join(filter(None, [folder, ".".join(parts) + ".exr"]))
    return Pattern(stripped, {"<subset>": 1}).name(mesh, "corners", frame, "all", ENDING, subset="all")


@dataclass(frozen=True)
class CornerFile:
    """Such a file, as it should be."""

    path: str
    inputs: str
    """A hash of all that it depends on."""

    def write(self, shape: Shape, frame: Frame, uvs: np.ndarray) -> None:
        """Writes (corners, 2) UVs. Raises Failure."""
        from vrtm.bake.layer import corner_uv_layer, export, values_hash

        layer = corner_uv_layer(shape, frame, uvs)
        layer.customLayerData |= {_INPUTS: self.inputs, _VALUES: values_hash(layer)}
        try:
            export(layer, self.path, values_hash)
        except OSError as error:
            self._remove_damaged()
            raise Failure(INPUT, f"{self.path}: {one_line(error.strerror or error)}") from error

    def up_to_date(self) -> bool:
        """Whether the file is there, whole, and made of these inputs. A damaged one of vrtm's own is taken away."""
        recorded = _recorded(self.path)
        if recorded is None:
            self._remove_damaged()
        return recorded is not None and recorded.get(_INPUTS) == self.inputs

    def _remove_damaged(self) -> None:
        if os.path.isfile(self.path) and overwrite.is_ours(self.path) and _recorded(self.path) is None:
            with contextlib.suppress(OSError):
                os.remove(self.path)


def _recorded(path: str) -> dict | None:
    """What a file tells of itself; None if it cannot be read, or its values are not those that it tells of."""
    from vrtm.bake.layer import values_hash
    from vrtm.bake.mark import found_in

    if not os.path.isfile(path):
        return None
    told, values = found_in(path, lambda layer: (dict(layer.customLayerData), values_hash(layer)), ({}, ""))
    return told if told.get(_VALUES) == values else None
