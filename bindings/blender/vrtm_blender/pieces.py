"""The connected parts of a detail mesh, and the place where each of them stands on the skin. All of it on arrays."""

from __future__ import annotations

import numpy as np
from mathutils.bvhtree import BVHTree

# A part's foot is all that is at most this share of its radius farther from the skin than its nearest vertex.
FOOT = 0.25


def connected(points: np.ndarray, edges: np.ndarray) -> np.ndarray:
    """The part of each vertex, (points,) from 0 on. Edges (n, 2) join vertices, and so does the same place."""
    _, same = np.unique(points, axis=0, return_inverse=True)
    same = same.reshape(-1)
    ends = same[edges]
    # Each place refers to another one of its part, with a lower number; in the end to the lowest.
    found = np.arange(len(points))
    while True:
        one, other = found[ends].T
        apart = one != other
        if not apart.any():
            return np.unique(found[same], return_inverse=True)[1].reshape(-1)
        np.minimum.at(found, np.maximum(one, other)[apart], np.minimum(one, other)[apart])
        while not np.array_equal(found, found[found]):
            found = found[found]


def feet(points: np.ndarray, parts: np.ndarray, farthest: float, skin: np.ndarray, triangles: np.ndarray) -> np.ndarray:
    """The centre of each part's foot on the skin, (parts, 3), a mean of vertices; that of all vertices where a part is
    farther from the skin than `farthest`."""
    tree = BVHTree.FromPolygons(skin.tolist(), triangles.tolist(), all_triangles=True)
    found = [tree.find_nearest(point, farthest)[3] for point in points.tolist()]
    away = np.array([np.inf if distance is None else distance for distance in found])
    centres = _means(points, parts)
    number = len(centres)
    nearest, radius = np.full(number, np.inf), np.zeros(number)
    np.minimum.at(nearest, parts, away)
    np.maximum.at(radius, parts, np.linalg.norm(points - centres[parts], axis=1))
    stands = away <= (nearest + FOOT * radius)[parts]
    return _means(points[stands], parts[stands])


def _means(points: np.ndarray, parts: np.ndarray) -> np.ndarray:
    sums = np.stack([np.bincount(parts, values) for values in points.T], -1)
    return sums / np.bincount(parts)[:, None]
