"""Connected parts of detail meshes, each of which is bound at its foot on the surface."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from vrtm.bake.carry_prims import CarriedPrim, placed
from vrtm.bake.nearest import Nearest

_FOOT = 0.25
"""A part's foot is all that is at most this share of its radius farther from the surface than its nearest point."""
_AT_ONCE = 1 << 16
"""Points that are searched for together."""


def in_parts(prim: CarriedPrim, to_mesh: np.ndarray, surface: Nearest) -> CarriedPrim:
    """A mesh whose connected parts are bound at the centres of their feet on a surface, means of points. `to_mesh`:
    (4, 4) from the prim's space to the surface's."""
    assert prim.faces is not None
    of = connected(prim.points, *prim.faces)
    points = placed(prim.points, to_mesh)
    centres = _means(points, of)
    nearest, radius = np.full(len(centres), np.inf), np.zeros(len(centres))
    np.maximum.at(radius, of, np.linalg.norm(points - centres[of], axis=1))
    away = np.empty(len(points))
    for first in range(0, len(points), _AT_ONCE):
        own = slice(first, first + _AT_ONCE)
        part = of[own]
        away[own] = surface.distances(points[own], part, nearest, _FOOT * radius)
    stands = away <= (nearest + _FOOT * radius)[of]
    return replace(prim, roots=_means(prim.points[stands], of[stands]), of=of)


def _means(points: np.ndarray, of: np.ndarray) -> np.ndarray:
    sums = np.stack([np.bincount(of, values) for values in points.T], -1)
    return sums / np.bincount(of)[:, None]


def connected(points: np.ndarray, counts: np.ndarray, indices: np.ndarray) -> np.ndarray:
    """(points,): the number of the connected part that each point belongs to, from 0. Faces join points, and so does
    the same place."""
    _, same = np.unique(points, axis=0, return_inverse=True)
    same = same.reshape(-1)
    indices = same[indices]
    last = np.cumsum(counts)
    following = np.arange(1, len(indices) + 1)
    following[last[counts > 0] - 1] = (last - counts)[counts > 0]
    a, b = indices, indices[following]
    part = np.arange(len(points))
    while not np.array_equal(part[a], part[b]):
        least = np.minimum(part[a], part[b])
        # The parts of both take the lesser number, and then each point that of its part.
        for end in (part[a], part[b]):
            np.minimum.at(part, end, least)
        while not np.array_equal(part, part[part]):
            part = part[part]
    return np.unique(part[same], return_inverse=True)[1].reshape(-1)


def wrong_faces(prim: CarriedPrim) -> str | None:
    """The reason that a mesh has no connected parts, as the end of a sentence."""
    if prim.faces is None:
        return None
    counts, indices = prim.faces
    if (counts < 0).any() or counts.sum() != len(indices):
        return f"has {len(indices)} corners, and faces with {int(counts.sum())}"
    beyond = (indices < 0) | (indices >= len(prim.points))
    return f"has {len(prim.points)} points, and a face with point {indices[beyond][0]}" if beyond.any() else None
