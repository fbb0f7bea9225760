"""Files of redirected corner UVs, one per mesh and frame, which record what they were made of."""

from __future__ import annotations

import os
from dataclasses import dataclass

import numpy as np

from vrtm.bake import staging
from vrtm.bake.failure import INPUT, Failure, one_line
from vrtm.bake.fingerprint import Fingerprint
from vrtm.bake.names import Pattern
from vrtm.bake.scene import Shape

ENDING = ".usdc"
_INPUTS = "vrtm_inputs"
_VALUES = "vrtm_values"


def corner_name(pattern: Pattern, mesh: str, frame: int) -> str:
    """The name below the output folder: that of the maps, of the kind `corners`, without a tile's number."""
    folder, name = os.path.split(pattern.text)
    parts = [part for part in name[: -len(".exr")].split(".") if part != "<UDIM>"]
    stripped = "/".join(filter(None, [folder, ".".join(parts) + ".exr"]))
    return Pattern(stripped, {}).name(mesh, "corners", frame, "all", ENDING)


@dataclass(frozen=True)
class CornerFile:
    """Such a file, as it should be."""

    path: str
    inputs: str
    """A hash of all that it depends on."""

    def write(self, shape: Shape, frame: int, uvs: np.ndarray) -> None:
        """Writes (corners, 2) UVs. Raises Failure."""
        from vrtm.bake.layer import corner_uv_layer

        layer = corner_uv_layer(shape, frame, uvs)
        layer.customLayerData = {_INPUTS: self.inputs, _VALUES: _values(layer)}

        def body(temporary: str) -> None:
            if not layer.Export(temporary):
                raise OSError("cannot be written")

        try:
            staging.write(self.path, body, ENDING)
        except Exception as error:
            # USD raises an exception of its own for what the system reports.
            raise Failure(INPUT, f"{self.path}: {one_line(error)}") from error

    def up_to_date(self) -> bool:
        """Whether the file is there, whole, and made of these inputs."""
        from pxr import Sdf, Tf

        if not os.path.isfile(self.path):
            return False
        try:
            # Anonymous: USD would hand out what it read of an earlier file of that name.
            layer = Sdf.Layer.OpenAsAnonymous(self.path)
            recorded = layer.customLayerData
            return recorded.get(_INPUTS) == self.inputs and recorded.get(_VALUES) == _values(layer)
        except (Tf.ErrorException, AttributeError, RuntimeError, ValueError, TypeError):
            return False


def _values(layer) -> str:
    """A hash of all values in a layer."""
    hashed = Fingerprint()

    def visit(path) -> None:
        for time in layer.ListTimeSamplesForPath(path):
            hashed.text(path, time).array(np.asarray(layer.QueryTimeSample(path, time)))

    layer.Traverse("/", visit)
    return hashed.hex()
