"""Choice of --seams and --open-borders where the user gives none: for `vrtm bake` and the add-on for Blender.

With seams 'continue' redirections lead over the borders of charts: all textures must then be dilated
(`vrtm.dilation`). With open borders 'slide' redirections run along borders at which the surface ends.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable
from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from vrtm._records import TileReport


def kept_or_shut(solved: Callable[[str], Iterable[TileReport]]) -> tuple[str, str]:
    """Returns the better one of the seams 'shut' and 'keep', and the figures that decide: the one with fewer rigid
    edges whose strain rises by over a quarter; if equal, the one with less strain; else 'shut'. `solved` solves with
    either, measures, and returns the tiles' reports."""
    found = {seams: _harm(solved(seams)) for seams in ("shut", "keep")}
    (shut, shut_strain), (keep, keep_strain) = found["shut"], found["keep"]
    told = f"{shut} rigid edges are strained by over a quarter more if shut, {keep} if kept"
    if shut == keep:
        told = f"the strain is {shut_strain:.4f} if shut, {keep_strain:.4f} if kept"
    return min(found, key=lambda seams: found[seams]), told


def _harm(reports: Iterable[TileReport]) -> tuple[int, float]:
    """Number of rigid edges that are strained by over a quarter more than with the mesh's own UVs, and the strain of
    all (RMS)."""
    harmed = edges = 0
    squares = 0.0
    for report in reports:
        harmed += round(report.harm * report.segments)
        edges += report.segments + report.segments_fixed
        squares += report.segments * report.after.rms**2 + report.segments_fixed * report.strain_fixed**2
    return harmed, (squares / max(edges, 1)) ** 0.5


def places(points: np.ndarray) -> np.ndarray:
    """Hashes of (points, 3): equal for points that are equal in f32."""
    found = np.zeros(len(points), np.uint64)
    # With 0 for -0.
    for column in (points.astype(np.float32) + np.float32(0)).T.copy().view(np.uint32):
        found = (found ^ column.astype(np.uint64)) * np.uint64(0x9E3779B97F4A7C15)
        found ^= found >> np.uint64(29)
    return found


def shared(meshes: Iterable[np.ndarray]) -> np.ndarray:
    """The `places` of more than one vertex of some meshes: where meshes meet, and where vertices are doubled."""
    found, counts = np.unique(np.concatenate([np.zeros(0, np.uint64), *meshes]), return_counts=True)
    return found[counts > 1]


def open_border(vertices: np.ndarray, face_counts: np.ndarray, textured: np.ndarray) -> np.ndarray:
    """The vertices of all edges that belong to a single face with texture. `vertices`: (corners,), the vertex of each
    corner; `face_counts` and `textured`: (faces,)."""
    vertices, counts = vertices.astype(np.int64), face_counts.astype(np.int64)
    following = np.arange(1, len(vertices) + 1)
    ends = np.cumsum(counts)[counts > 0]
    following[ends - 1] = ends - counts[counts > 0]
    pairs = np.sort(np.stack([vertices, vertices[following]])[:, np.repeat(textured, counts)], axis=0)
    edges, number = np.unique(pairs[0] * (vertices.max(initial=0) + 1) + pairs[1], return_counts=True)
    return np.unique(np.concatenate(np.divmod(edges[number == 1], vertices.max(initial=0) + 1)))


def connected(nodes: int, one: np.ndarray, other: np.ndarray) -> np.ndarray:
    """(nodes,): the least number among the nodes that links, from `one` to `other`, connect to each."""
    root = np.arange(nodes)
    while True:
        a, b = root[one], root[other]
        apart = a != b
        if not apart.any():
            return root
        root[np.maximum(a, b)[apart]] = np.minimum(a, b)[apart]
        while (root[root] != root).any():
            root = root[root]
