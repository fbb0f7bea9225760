"""Axes and units of files, and points in them."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np


@dataclass(frozen=True)
class Axes:
    """The axes of a file's world and its unit, as far as the file says them. All worlds are right-handed."""

    up: str | None = None
    """`Y` or `Z`."""
    meters: float | None = None
    """Meters of the unit."""

    def to(self, other: Axes) -> np.ndarray:
        """(4, 4) by which rows of points along these axes are multiplied to lie along others, as far as both say what
        they differ by."""
        matrix = np.eye(4)
        if {self.up, other.up} == {"Y", "Z"}:
            # What was up is up, and x stays.
            quarter = np.array([(1, 0, 0), (0, 0, -1), (0, 1, 0)], float)
            matrix[:3, :3] = quarter if self.up == "Z" else quarter.T
        if self.meters and other.meters:
            matrix[:3, :3] *= self.meters / other.meters
        return matrix


GLTF = Axes("Y", 1.0)


def placed(points: np.ndarray, matrix: np.ndarray) -> np.ndarray:
    """(points, 3), transformed by a (4, 4) as rows."""
    return points @ matrix[:3, :3] + matrix[3, :3]
