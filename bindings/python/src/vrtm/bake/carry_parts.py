"""Connected parts of detail meshes, each of which is bound by one of its points."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from vrtm.bake.carry_prims import CarriedPrim, placed
from vrtm.bake.nearest import Nearest

_ALIKE = 0.01
"""Of the size of a part: points whose distances from the surface differ by less are equally near."""
_AT_ONCE = 1 << 16
"""Points that are searched for together."""


def in_parts(prim: CarriedPrim, to_mesh: np.ndarray, surface: Nearest) -> CarriedPrim:
    """A mesh whose connected parts are bound by their points nearest to a surface; of those that are equally near, by
    the one nearest to the part's middle. `to_mesh`: (4, 4) from the prim's space to the surface's."""
    assert prim.faces is not None
    of = connected(len(prim.points), *prim.faces)
    points = placed(prim.points, to_mesh)
    order = np.argsort(of, kind="stable")
    starts = np.searchsorted(of[order], np.arange(of.max() + 1))
    sorted_points = points[order]
    low, high = (over.reduceat(sorted_points, starts) for over in (np.minimum, np.maximum))
    size = np.linalg.norm(high - low, axis=1)
    nearest = np.full(len(starts), np.inf)
    away = np.empty(len(points))
    for first in range(0, len(points), _AT_ONCE):
        own = slice(first, first + _AT_ONCE)
        part = of[own]
        away[own] = surface.distances(points[own], part, nearest, _ALIKE * size)
    middle = np.linalg.norm(points - ((low + high) / 2)[of], axis=1)
    middle[away > (nearest + _ALIKE * size)[of]] = np.inf
    first = np.lexsort((middle, of))
    return replace(prim, roots=first[np.searchsorted(of[first], np.arange(len(starts)))], of=of)


def connected(points: int, counts: np.ndarray, indices: np.ndarray) -> np.ndarray:
    """(points,): the number of the connected part that each point belongs to, by the faces; from 0, in the order of
    their first points."""
    last = np.cumsum(counts)
    following = np.arange(1, len(indices) + 1)
    following[last[counts > 0] - 1] = (last - counts)[counts > 0]
    a, b = indices, indices[following]
    part = np.arange(points)
    while not np.array_equal(part[a], part[b]):
        least = np.minimum(part[a], part[b])
        # The parts of both take the lesser number, and then each point that of its part.
        for end in (part[a], part[b]):
            np.minimum.at(part, end, least)
        while not np.array_equal(part, part[part]):
            part = part[part]
    return np.unique(part, return_inverse=True)[1].reshape(-1)


def wrong_faces(prim: CarriedPrim) -> str | None:
    """The reason that a mesh has no connected parts, as the end of a sentence."""
    if prim.faces is None:
        return None
    counts, indices = prim.faces
    if (counts < 0).any() or counts.sum() != len(indices):
        return f"has {len(indices)} corners, and faces with {int(counts.sum())}"
    beyond = (indices < 0) | (indices >= len(prim.points))
    return f"has {len(prim.points)} points, and a face with point {indices[beyond][0]}" if beyond.any() else None
