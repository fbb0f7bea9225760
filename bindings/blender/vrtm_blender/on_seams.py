"""The number of features on seams of the UV map. All of it on arrays."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from . import session
from .geometry import Topology

# Points along each edge at which the rigidity is looked at, its ends among them.
POINTS = 9


def features(topology: Topology, rigidity: Callable[[np.ndarray], np.ndarray]) -> int:
    """The number of connected rigid parts of all seams, by the rigidity of UVs (n, 2): a feature on a seam has one, as
    a rule. A seam is an edge of two faces with different UVs."""
    following = session.library("vrtm.bake.scene.topology").next_corners(topology.face_counts)
    # Each edge as both of its faces have it, with its ends in one order.
    corners = np.stack([np.arange(len(following)), following], -1)
    vertices = topology.corner_vertices[corners].astype(np.int64)
    turned = vertices[:, 0] > vertices[:, 1]
    corners[turned], vertices[turned] = corners[turned, ::-1], vertices[turned, ::-1]
    order = np.lexsort(vertices.T)
    corners, vertices = corners[order], vertices[order]
    first = np.flatnonzero((vertices[:-1] == vertices[1:]).all(-1))
    sides = np.stack([topology.uvs[corners[first]], topology.uvs[corners[first + 1]]])
    apart = (np.abs(sides[0] - sides[1]) > 1e-6).any((-1, -2))
    sides, vertices = sides[:, apart], vertices[first[apart]]
    at = np.linspace(0, 1, POINTS)[:, None]
    points = sides[:, :, None, 0] * (1 - at) + sides[:, :, None, 1] * at
    # A feature may end at the seam on one of its sides.
    rigid = (rigidity(points.reshape(-1, 2)) > 0.5).reshape(2, -1, POINTS).any(0)
    runs = rigid[:, 0].sum() + (rigid[:, 1:] & ~rigid[:, :-1]).sum()
    # Runs that meet at a vertex are one.
    meeting = np.bincount(np.concatenate([vertices[rigid[:, 0], 0], vertices[rigid[:, -1], 1]]), minlength=1)
    return int(runs - np.maximum(meeting - 1, 0).sum())
