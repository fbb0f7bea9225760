"""Seams of the UV map: the features on them, and vertices that are double along them. All of it on arrays."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from . import session
from .geometry import Topology

# Points along each edge at which the rigidity is looked at, its ends among them.
POINTS = 9
# Vertices that are nearer to one another than that share of a mesh's size are at one place.
NEAR = 1e-5
# UVs that are nearer to one another are one, as the library has it.
ONE_UV = 1 / 2048


@dataclass(frozen=True)
class Doubles:
    """Vertices that lie at the place of another one at rest, as files for games have them along seams."""

    corner_vertices: np.ndarray  # (corners,) int64: the first vertex at the place of each corner
    seams: np.ndarray  # (2, edges, 2): the vertices of both sides of edges with vertices and UVs for each side
    cuts: int  # edges with vertices for each side, and the same UVs
    elsewhere: int  # vertices that are at no such edge, as where shells touch

    @property
    def edges(self) -> int:
        return self.seams.shape[1] + self.cuts

    @property
    def are_of_seams(self) -> bool:
        """True if they follow from the seams of the UV map alone."""
        return self.seams.size > 0 and not self.cuts and not self.elsewhere

    def apart(self, pose: np.ndarray) -> int:
        """The number of those seams' edges whose sides do not lie together in a pose."""
        away = np.abs(np.subtract(*pose[self.seams].astype(np.float64))).max((-1, -2), initial=0)
        return int((away > 10 * NEAR * np.ptp(pose, axis=0).max(initial=0)).sum())


def places(*meshes: np.ndarray) -> list[np.ndarray]:
    """Numbers of the places of meshes' vertices, (vertices, 3) each: equal at one place, by the first mesh's size."""
    near = NEAR * max(float(np.ptp(meshes[0], axis=0).max(initial=0)), 1e-30)
    return [session.library("vrtm.borders").places(np.rint(of.astype(np.float64) / near)) for of in meshes]


def doubles(topology: Topology, rest: np.ndarray) -> Doubles:
    """The doubled vertices of a mesh with this rest shape, (vertices, 3)."""
    _, first, of = np.unique(places(rest)[0], return_index=True, return_inverse=True)
    of = of.reshape(-1)
    # Vertices without faces do not count.
    used = np.bincount(topology.corner_vertices, minlength=topology.vertices) > 0
    double = used & (np.bincount(of[used], minlength=len(first))[of] > 1)
    at = first[of][topology.corner_vertices]
    if not double.any():
        return Doubles(at, np.zeros((2, 0, 2), int), 0, 0)
    corners, _, begins = _pairs(topology, at)
    vertices = topology.corner_vertices[corners]
    # Faces that lie beside one another, and have no vertex in common at one end at least.
    beside = (corners[0, :, 0] == begins[0]) != (corners[1, :, 0] == begins[1])
    split = beside & (vertices[0] != vertices[1]).any(-1)
    corners, vertices, begins = corners[:, split], vertices[:, split], begins[:, split]
    double[vertices.ravel()] = False
    # Also mirrored halves, which have their UVs in common.
    turns = np.sign(_turns(topology)[begins])
    seams = _apart(topology, corners, ONE_UV) | (turns[0] * turns[1] < 0)
    return Doubles(at, vertices[:, seams], int((~seams).sum()), int(double.sum()))


def _turns(topology: Topology) -> np.ndarray:
    """Twice the area in the UV map, with its sign, between each corner and the two after it, (corners,)."""
    following, uvs = _next_corners(topology), topology.uvs.astype(np.float64)
    one, other = uvs[following] - uvs, uvs[following[following]] - uvs
    return one[:, 0] * other[:, 1] - one[:, 1] * other[:, 0]


def _next_corners(topology: Topology) -> np.ndarray:
    return session.library("vrtm.bake.scene.topology").next_corners(topology.face_counts)


def _pairs(topology: Topology, vertices: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """The edges that two faces share, and no third one, by the vertices of the corners: the corners at their ends in
    both faces, (2, edges, 2), with the ends in one order; the vertices there, (edges, 2); and the corners at which they
    begin, (2, edges)."""
    following = _next_corners(topology)
    corners = np.stack([np.arange(len(following)), following], -1)
    ends = vertices[corners].astype(np.int64)
    turned = ends[:, 0] > ends[:, 1]
    corners[turned], ends[turned] = corners[turned, ::-1], ends[turned, ::-1]
    order = np.lexsort(ends.T)
    corners, ends = corners[order], ends[order]
    same = (ends[:-1] == ends[1:]).all(-1)
    alone = ~np.append(same[1:], False) & ~np.append(False, same[:-1])
    first = np.flatnonzero(same & alone)
    each = np.stack([first, first + 1])
    return corners[each], ends[first], order[each]


def _apart(topology: Topology, corners: np.ndarray, tolerance: float) -> np.ndarray:
    """True for edges, with corners (2, edges, 2), whose two sides have different UVs."""
    sides = topology.uvs[corners]
    return (np.abs(sides[0] - sides[1]) > tolerance).any((-1, -2))


def features(topology: Topology, vertices: np.ndarray, rigidity: Callable[[np.ndarray], np.ndarray]) -> int:
    """The number of connected rigid parts of all seams, by the rigidity of UVs (n, 2): a feature on a seam has one, as
    a rule. A seam is an edge of two faces with different UVs, by the vertices of the corners."""
    corners, vertices, _ = _pairs(topology, vertices)
    apart = _apart(topology, corners, 1e-6)
    sides, vertices = topology.uvs[corners[:, apart]], vertices[apart]
    at = np.linspace(0, 1, POINTS)[:, None]
    points = sides[:, :, None, 0] * (1 - at) + sides[:, :, None, 1] * at
    # A feature may end at the seam on one of its sides.
    rigid = (rigidity(points.reshape(-1, 2)) > 0.5).reshape(2, -1, POINTS).any(0)
    runs = rigid[:, 0].sum() + (rigid[:, 1:] & ~rigid[:, :-1]).sum()
    # Runs that meet at a vertex are one.
    meeting = np.bincount(np.concatenate([vertices[rigid[:, 0], 0], vertices[rigid[:, -1], 1]]), minlength=1)
    return int(runs - np.maximum(meeting - 1, 0).sum())
