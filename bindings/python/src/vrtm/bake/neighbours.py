"""Vertices of other meshes that lie where a mesh ends: there the surface goes on.

Each mesh has its coordinates in a space of its own. Those of two meshes may be equal there although both are far apart,
and differ although both meet. So points of several meshes are compared as `World` alone.
"""

from __future__ import annotations

import itertools
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from vrtm.bake.scene import Scene, Shape
from vrtm.bake.scene.axes import placed
from vrtm.borders import places

_NEAR = 1e-5
"""Vertices that are nearer to one another than that share of a mesh's size are at one place."""
_ROUNDING = 4 * float(np.finfo(np.float32).eps)
"""Of coordinates in a mesh's own space."""
_PLACES = 64
"""Instances of a mesh whose neighbours are looked at."""


@dataclass(frozen=True, eq=False)
class World:
    """Points in the world."""

    points: np.ndarray
    """(points, 3), f64."""

    def within(self, low: np.ndarray, high: np.ndarray) -> World:
        return World(self.points[((self.points >= low) & (self.points <= high)).all(axis=1)])

    def meets(self, others: World, near: float) -> bool:
        """True if a point and one of the others are at most `near` apart along each axis."""
        low = self.points.min(axis=0)
        for shift in itertools.product((0, 0.5), repeat=3):
            # One of these grids has both of two such points in the same cell.
            own, other = (places(np.floor((of.points - low) / (2 * near) + shift)) for of in (self, others))
            if np.isin(own, other).any():
                return True
        return False


class Neighbours:
    """All meshes of a scene at rest, also those that are not baked."""

    def __init__(self, scene: Scene, shapes: Sequence[Shape]) -> None:
        """`shapes`: those of the scene, in the units of their poses."""
        known = [(shape.name, shape.rest, scene.places(shape)) for shape in shapes]
        every = known + [("", rest, [to_world]) for rest, to_world in scene.bystanders()]
        self._placed = [(name, rest, to_world) for name, rest, matrices in every for to_world in matrices]
        """Of each mesh in each of its places, the name, the rest and the way to the world."""
        boxes = [_boxes(rest, np.array(matrices)) for _, rest, matrices in every]
        self._low, self._high, self._rounding = (np.concatenate(of) for of in zip(*boxes))

    def touch(self, shape: Shape, border: np.ndarray) -> bool:
        """True if other vertices lie at some of a mesh, in any of its places. `border`: their numbers."""
        own = [number for number, (name, *_) in enumerate(self._placed) if name == shape.name]
        return len(border) > 0 and any(self._touch(number, border) for number in own[:_PLACES])

    def _world(self, number: int, vertices: np.ndarray | slice = slice(None)) -> World:
        _, rest, to_world = self._placed[number]
        return World(placed(rest[vertices].astype(np.float64), to_world))

    def _touch(self, number: int, border: np.ndarray) -> bool:
        edge = self._world(number, border)
        least = max(_NEAR * float((self._high - self._low)[number].max()), 1e-30)
        near = np.maximum(self._rounding, max(least, self._rounding[number]))[:, None]
        low, high = edge.points.min(axis=0) - near, edge.points.max(axis=0) + near
        around = np.flatnonzero(((self._low <= high) & (self._high >= low)).all(axis=1))
        others = around[around != number]
        return any(edge.meets(self._world(of).within(low[of], high[of]), near[of, 0]) for of in others)


def _boxes(rest: np.ndarray, to_world: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """The lower and upper corner in the world of a mesh in each of its places, and the rounding of its vertices."""
    ends = rest.min(axis=0), rest.max(axis=0)
    corners = np.array(list(itertools.product(*np.transpose(ends)))) @ to_world[:, :3, :3] + to_world[:, None, 3, :3]
    rounding = _ROUNDING * np.abs(ends).max() * np.linalg.norm(to_world[:, :3, :3], axis=(1, 2))
    return corners.min(axis=1), corners.max(axis=1), rounding
