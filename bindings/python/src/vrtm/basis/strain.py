"""Strain on the mesh, in f64, of any redirection map: the change of painted lengths that it shows.

Neighbouring texel centres a and b of the map lie on the surface where the mesh's own UVs say, and show the texture at
R(a) and R(b). What is painted from R(a) to R(b) had the chord between these points at rest, and has that from a to b
in the pose. Its strain is the pose's chord over the rest's, minus 1. Both are located in the triangles exactly."""

from dataclasses import dataclass

import numpy as np

from vrtm.bake.raster import cover, weights_at
from vrtm.borders import connected

RIGID = 0.5
"""Segments count if both ends are more rigid than this share of the tile's largest rigidity."""
_BESIDE = 1.0
"""Texels that a point may lie outside of the triangle that it is taken from."""
_STEPS = ((0, 1), (1, 0), (1, 1), (1, -1))


@dataclass(frozen=True)
class Strain:
    """Strain of the segments of a map."""

    rms: float
    p99: float
    """99 % of the magnitudes are below."""
    max: float
    segments: int
    lost: int
    """Segments that the map leads out of their chart, which are left out."""

    @staticmethod
    def of(values: np.ndarray, lost: int = 0) -> "Strain":
        """Summary of the strains of segments, of one tile or several."""
        size = np.abs(values)
        if not len(size):
            return Strain(0.0, 0.0, 0.0, 0, lost)
        rms = float(np.sqrt((size**2).mean()))
        return Strain(rms, float(np.quantile(size, 0.99)), float(size.max()), len(size), lost)


class Ruler:
    """A tile's triangles under the texels of its maps."""

    def __init__(self, uvs: np.ndarray, triangles: np.ndarray, vertices: np.ndarray, rigidity: np.ndarray) -> None:
        """`uvs`: (triangles, 3, 2), within the tile, v up. `triangles`: (triangles, 3), the UV of each corner by its
        number: triangles that share two of them are of one chart. `vertices`: (triangles, 3), into positions.
        `rigidity`: (height, width) of the map, 0..1, the first row at the top."""
        self.height, self.width = rigidity.shape
        self.size = np.array([self.width, self.height], float)
        self.vertices = vertices
        # In texels, from the upper left corner.
        u, v = np.moveaxis(uvs.astype(np.float64), -1, 0)
        self.corners = np.stack([u * self.width, (1 - v) * self.height], -1)
        (ax, ay), (bx, by) = np.moveaxis(np.diff(self.corners, axis=1), (1, 2), (0, 1))
        self.across = np.sqrt(np.abs(ax * by - ay * bx))
        depth = np.zeros((*self.corners.shape[:2], 1))
        self.under, self.weights = cover(np.concatenate([self.corners, depth], -1), (self.width, self.height))
        self.rigid = rigidity > RIGID * rigidity.max()
        # Of each triangle, a number for those that hang together with it in UV.
        ends = (triangles[:, sides].ravel() for sides in ([0, 1], [1, 2]))
        self.charts = connected(triangles.max(initial=0) + 1, *ends)[triangles[:, 0]]

    def strains(self, delta: np.ndarray, rest: np.ndarray, pose: np.ndarray) -> tuple[np.ndarray, int]:
        """The strain of each segment of the map `UV + delta`, (height, width, 2), in a pose, and how many are lost.
        `rest`, `pose`: (vertices, 3)."""
        rows, columns = np.nonzero(self.under >= 0)
        home = self.under[rows, columns]
        at = np.stack([columns + 0.5, rows + 0.5], -1) + delta[rows, columns] * self.size * (1, -1)
        found, weights = self._located(at, home)
        painted = self._rigid_at(at) & (found >= 0)
        lost = int((self._rigid_at(at) & (found < 0)).sum())
        place = np.full(self.under.shape, -1)
        place[rows[painted], columns[painted]] = np.flatnonzero(painted)
        shown = _on(pose, self.vertices[home], self.weights[rows, columns])
        held = _on(rest, self.vertices[found], weights)
        values = []
        for down, right in _STEPS:
            one = place[: self.height - down, max(0, -right) : self.width - max(0, right)]
            other = place[down:, max(0, right) : self.width + min(0, right)]
            both = (one >= 0) & (other >= 0)
            a, b = one[both], other[both]
            same = self.charts[home[a]] == self.charts[home[b]]
            a, b = a[same], b[same]
            length = np.linalg.norm(held[a] - held[b], axis=1)
            chord = np.linalg.norm(shown[a] - shown[b], axis=1)
            values.append(chord[length > 0] / length[length > 0] - 1)
        return np.concatenate(values), lost

    def _rigid_at(self, at: np.ndarray) -> np.ndarray:
        x, y = (np.clip(at[:, k].astype(int), 0, n - 1) for k, n in ((0, self.width), (1, self.height)))
        return self.rigid[y, x]

    def _located(self, at: np.ndarray, home: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """The triangle of the same chart as `home` under each point, -1 for none, with the weights of its corners: of
        the triangles under the texels around the point the one that has it deepest inside."""
        best, least, weights = np.full(len(at), -1), np.full(len(at), -np.inf), np.zeros((len(at), 3))
        x, y = np.floor(at).astype(int).T
        for down in (0, -1, 1):
            for right in (0, -1, 1):
                near = self.under[np.clip(y + down, 0, self.height - 1), np.clip(x + right, 0, self.width - 1)]
                near = np.where((near >= 0) & (self.charts[near] == self.charts[home]), near, home)
                tried = weights_at(self.corners[near], at)
                inside = np.nan_to_num(tried.min(axis=1), nan=-np.inf)
                better = inside > least
                best[better], least[better], weights[better] = near[better], inside[better], tried[better]
        # Triangles that cover no texel's centre are never tried: a point there is taken from the plane of the triangle
        # beside it, up to about a texel away.
        near = least * self.across[np.maximum(best, 0)] > -_BESIDE
        return np.where(near & (best >= 0), best, -1), weights


def _on(positions: np.ndarray, vertices: np.ndarray, weights: np.ndarray) -> np.ndarray:
    return np.einsum("tkc,tk->tc", positions.astype(np.float64)[vertices], weights)
