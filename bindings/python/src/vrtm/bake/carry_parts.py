"""Connected parts of detail meshes, each of which is bound at its foot on the surface, and distances from it."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from vrtm import borders
from vrtm.bake.carry_prims import CarriedPrim
from vrtm.bake.scene.axes import placed
from vrtm.bake.scene.topology import next_corners

_FOOT = 0.25
"""A part's foot is all that is at most this share of its radius farther from the surface than its nearest point."""
_AT_ONCE = 1 << 16
"""Points that are searched for together."""
_LEAF = 4
"""Triangles in a box of the lowest level."""


def in_parts(prim: CarriedPrim, to_mesh: np.ndarray, surface: Nearest) -> CarriedPrim:
    """A mesh whose connected parts are bound at the centres of their feet on a surface, means of points. `to_mesh`:
    (4, 4) from the prim's space to the surface's."""
    assert prim.faces is not None
    of = connected(prim.points, *prim.faces)
    return replace(prim, roots=feet(prim.points, placed(prim.points, to_mesh), of, surface), of=of)


def feet(rest: np.ndarray, points: np.ndarray, of: np.ndarray, surface: Nearest) -> np.ndarray:
    """(parts, 3): the centres of the feet of parts, in the space of `rest`. `points`: the same in the surface's space;
    `of`: (points,), the part of each."""
    centres = _means(points, of)
    nearest, radius = np.full(len(centres), np.inf), np.zeros(len(centres))
    np.maximum.at(radius, of, np.linalg.norm(points - centres[of], axis=1))
    away = np.empty(len(points))
    for first in range(0, len(points), _AT_ONCE):
        own = slice(first, first + _AT_ONCE)
        part = of[own]
        away[own] = surface.distances(points[own], part, nearest, _FOOT * radius)
    stands = away <= (nearest + _FOOT * radius)[of]
    return _means(rest[stands], of[stands])


def _means(points: np.ndarray, of: np.ndarray) -> np.ndarray:
    sums = np.stack([np.bincount(of, values) for values in points.T], -1)
    return sums / np.bincount(of)[:, None]


def connected(points: np.ndarray, counts: np.ndarray, indices: np.ndarray) -> np.ndarray:
    """(points,): the number of the connected part that each point belongs to, from 0. Faces join points, and so does
    the same place."""
    _, same = np.unique(points, axis=0, return_inverse=True)
    same = same.reshape(-1)
    indices = same[indices]
    part = borders.connected(len(points), indices, indices[next_corners(counts)])
    return np.unique(part[same], return_inverse=True)[1].reshape(-1)


class Nearest:
    """A surface, in boxes within boxes."""

    def __init__(self, triangles: np.ndarray) -> None:
        """`triangles`: (triangles, 3, 3)."""
        leaves = 1 << max(-(-len(triangles) // _LEAF) - 1, 0).bit_length()
        # Some triangles are there twice.
        filled = np.resize(triangles, (leaves * _LEAF, 3, 3))
        self._leaves = filled[_order(filled.mean(axis=1))].reshape(leaves, _LEAF, 3, 3)
        corners = self._leaves.reshape(leaves, -1, 3)
        self._boxes = [(corners.min(axis=1), corners.max(axis=1))]
        """From the largest box to the smallest ones: of box k of a level, 2 k and 2 k + 1 of the next one."""
        while len(self._boxes[0][0]) > 1:
            low, high = (ends.reshape(-1, 2, 3) for ends in self._boxes[0])
            self._boxes.insert(0, (low.min(axis=1), high.max(axis=1)))

    def distances(self, points: np.ndarray, part: np.ndarray, nearest: np.ndarray, slack: np.ndarray) -> np.ndarray:
        """(points,): distances of points from the surface; infinite for those that are farther than the nearest one of
        their part by more than its `slack`. `nearest`, (parts,): the smallest distances so far, which is kept."""
        box = np.zeros(len(points), np.int64)
        for level in range(1, len(self._boxes)):
            middle = np.add(*self._boxes[level]) / 2
            both = [np.linalg.norm(points - middle[2 * box + k], axis=1) for k in (0, 1)]
            box = 2 * box + np.argmin(both, axis=0)
        found = self._in_leaf(points, box)
        np.minimum.at(nearest, part, found)
        at, box = np.arange(len(points)), np.zeros(len(points), np.int64)
        for level in range(len(self._boxes)):
            if level:
                at, box = np.tile(at, 2), np.concatenate([2 * box, 2 * box + 1])
            most = np.minimum(found, (nearest + slack)[part])
            low, high = (ends[box] for ends in self._boxes[level])
            near = np.linalg.norm(points[at] - np.clip(points[at], low, high), axis=1) <= most[at]
            at, box = at[near], box[near]
        np.minimum.at(found, at, self._in_leaf(points[at], box))
        np.minimum.at(nearest, part, found)
        return np.where(found <= (nearest + slack)[part], found, np.inf)

    def _in_leaf(self, points: np.ndarray, box: np.ndarray) -> np.ndarray:
        return np.min([to_triangles(points, self._leaves[box, k]) for k in range(_LEAF)], axis=0)


def to_triangles(points: np.ndarray, triangles: np.ndarray) -> np.ndarray:
    """(n,): the distance of each point, (n, 3), from a triangle of its own, (n, 3, 3)."""
    sides = np.roll(triangles, -1, axis=1) - triangles
    away = points[:, None] - triangles
    square = (sides * sides).sum(-1)
    share = np.clip((away * sides).sum(-1) / np.where(square > 0, square, 1), 0, 1)
    edge = np.linalg.norm(away - share[..., None] * sides, axis=-1).min(axis=1)
    normal = np.cross(sides[:, 0], sides[:, 1])
    length = np.linalg.norm(normal, axis=1)
    above = ((np.cross(normal[:, None], sides) * away).sum(-1) >= 0).all(axis=1) & (length > 0)
    height = np.abs((normal * away[:, 0]).sum(-1)) / np.where(length > 0, length, 1)
    return np.where(above, height, edge)


def _order(points: np.ndarray) -> np.ndarray:
    """An order of a number of points that is _LEAF times a power of two, halves of which lie apart, and so on."""
    order = np.arange(len(points))
    count = len(points)
    while count > _LEAF:
        of = points[order].reshape(-1, count, 3)
        along = np.ptp(of, axis=1).argmax(axis=1)
        by = np.take_along_axis(of, along[:, None, None], axis=2)[..., 0]
        order = np.take_along_axis(order.reshape(-1, count), by.argsort(axis=1, kind="stable"), axis=1).reshape(-1)
        count //= 2
    return order
