"""Geometry on the surface in single frames: files that tasks of a farm write, from which the last bake makes the one of
all frames without solving again."""

from dataclasses import dataclass

import numpy as np

from vrtm.bake import image_file
from vrtm.bake.fingerprint import Fingerprint
from vrtm.bake.frames import Frame
from vrtm.bake.image_file import Target
from vrtm.bake.scene.images import texels_of


@dataclass(frozen=True, eq=False)
class Moved:
    """The places that a mesh carries, in a pose, in the mesh's space."""

    places: np.ndarray
    """(places, 3) f64."""
    turns: np.ndarray
    """(places, 3, 3) f64."""
    features: int
    """Rigid features that carry any."""
    rim: float
    """The largest distance from the surface to the rim of a feature."""


def target(path: str, mesh: str, frame: Frame, places: int, inputs: Fingerprint, positions: np.ndarray) -> Target:
    """The file of a frame: an image with a row per place, whose texels have the four parts of a number of 64 bits. So
    it has the mark, the hashes and the care of all images. `inputs`: all that counts besides the pose."""
    hashed = inputs.copy().text(frame).array(positions).hex()
    facts = {"vrtm:kind": "carried", "vrtm:mesh": mesh, "vrtm:frame": str(frame), "vrtm:inputs": hashed}
    return Target(path, 12, places, ("A", "B", "C", "D"), "uint16", facts, format="tiff")


def write(target: Target, moved: Moved) -> None:
    """Raises Failure."""
    rows = np.concatenate([moved.places, moved.turns.reshape(-1, 9)], axis=1, dtype="<f8")
    told = {"features": moved.features, "rim": moved.rim}
    image_file.write(target, rows.view("<u2").reshape(-1, 12, 4).astype(np.uint16), told)


def read(target: Target) -> Moved | None:
    """None if there is no file of these inputs."""
    told = image_file.up_to_date(target, replace=True)
    if not told:
        return None
    rows = np.ascontiguousarray(texels_of(target.path)[1], "<u2").reshape(-1, 48).view("<f8")
    return Moved(rows[:, :3], rows[:, 3:].reshape(-1, 3, 3), **told)
