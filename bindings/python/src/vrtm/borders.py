"""Choice of --seams and --open-borders where the user gives none: for `vrtm bake` and the add-on for Blender.

With seams 'continue' redirections lead over the borders of charts: all textures must then be dilated
(`vrtm.dilation`). With open borders 'slide' redirections run along borders at which the surface ends.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

if TYPE_CHECKING:
    from vrtm._records import TileReport

_ALIKE = 0.1
"""Share of all features: where fewer make the difference, some of them are a little above a limit or below it."""


def kept_or_shut(solved: Callable[[str], Iterable[TileReport]]) -> tuple[str, str]:
    """Returns the better one of the seams 'shut' and 'keep', and the figures that decide, in words: the one with fewer
    bad features, if these differ by over a tenth of all features; otherwise the one with less strain; if equal,
    'shut'. A feature is bad if its error is over 0.05, and if it is worse than with the mesh's own UVs; it counts twice
    if it is both. `solved` solves with either, measures, and returns the tiles' reports."""
    totals = {seams: _totals(solved(seams)) for seams in ("shut", "keep")}
    bad = {seams: of.strained + of.worse for seams, of in totals.items()}
    by_features = abs(bad["shut"] - bad["keep"]) > _ALIKE * totals["shut"].features
    told = ", ".join(
        f"{of.strained} of {of.features} features are strained and {of.worse} worse than without vrtm if {how} "
        f"(strain {of.strain:.4f})"
        for how, of in zip(("shut", "kept"), totals.values())
    )
    return min(totals, key=lambda seams: bad[seams] if by_features else totals[seams].strain), told


class _Totals(NamedTuple):
    features: int
    strained: int
    worse: int
    strain: float
    """RMS over all rigid segments, fixed ones included."""


def _totals(reports: Iterable[TileReport]) -> _Totals:
    found = list(reports)
    segments = sum(of.segments + of.segments_fixed for of in found)
    squares = sum(of.segments * of.after.rms**2 + of.segments_fixed * of.strain_fixed**2 for of in found)
    return _Totals(
        sum(of.features for of in found),
        sum(of.features_strained_after for of in found),
        sum(of.features_worse for of in found),
        (squares / max(segments, 1)) ** 0.5,
    )


def places(points: np.ndarray) -> np.ndarray:
    """Hashes of (points, 3): equal for points that are equal in f32."""
    # With 0 for -0.
    return hashes(*(points.astype(np.float32) + np.float32(0)).T.copy().view(np.uint32))


def hashes(*numbers: np.ndarray) -> np.ndarray:
    """A hash of each combination of integers. Hardly ever do two combinations have the same."""
    found = np.zeros(len(numbers[0]), np.uint64)
    for number in numbers:
        found = (found ^ number.astype(np.uint64)) * np.uint64(0x9E3779B97F4A7C15)
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
