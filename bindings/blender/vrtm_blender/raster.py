"""Values of a mesh's vertices as images over its UV map. All of it on arrays."""

from __future__ import annotations

import numpy as np

# Texels around islands that have the values at their borders: lookups read a little beyond.
GROWN = 4
# Texels that are filled at a time.
_CHUNK = 1 << 20


class Raster:
    """The triangle under the middle of each texel of an image, and the place in it. Of triangles that lie over one
    another the last one counts."""

    def __init__(self, vertices: np.ndarray, points: np.ndarray, shape: tuple[int, int]) -> None:
        """`vertices` (triangles, 3) and their places in the image in texels, (triangles, 3, 2), y from below; `shape`
        is (height, width)."""
        height, width = self.shape = shape
        self._vertices = vertices
        self._triangle = np.full(height * width, -1, np.int32)
        self._weights = np.zeros((height * width, 2), np.float32)
        area = _cross(points[:, 1] - points[:, 0], points[:, 2] - points[:, 0])
        triangle, rows = _counted(
            np.where(area == 0, 1, np.maximum(np.ceil(points[..., 1].min(1) - 0.5), 0)).astype(np.int64),
            np.where(area == 0, 0, np.minimum(np.floor(points[..., 1].max(1) - 0.5), height - 1)).astype(np.int64),
        )
        # The columns at which each row's middle line enters and leaves the triangle.
        a, b, y = points[triangle], np.roll(points, -1, 1)[triangle], (rows + 0.5)[:, None]
        with np.errstate(all="ignore"):
            share = (y - a[..., 1]) / (b[..., 1] - a[..., 1])
        at = np.where((share >= 0) & (share <= 1), a[..., 0] + share * (b[..., 0] - a[..., 0]), np.nan)
        low, high = np.fmin.reduce(at, 1), np.fmax.reduce(at, 1)
        low, high = np.nan_to_num(low, nan=1.0, posinf=1.0), np.nan_to_num(high, nan=0.0, neginf=0.0)
        line, columns = _counted(
            np.maximum(np.ceil(low - 0.5), 0).astype(np.int64),
            np.minimum(np.floor(high - 0.5), width - 1).astype(np.int64),
        )
        for first in range(0, len(line), _CHUNK):
            some = slice(first, first + _CHUNK)
            of, x, y = triangle[line[some]], columns[some], rows[line[some]]
            one, two = points[of, 1] - points[of, 0], points[of, 2] - points[of, 0]
            offset = np.stack([x + 0.5, y + 0.5], -1) - points[of, 0]
            weights = np.stack([_cross(offset, two), _cross(one, offset)], -1) / area[of, None]
            self._triangle[y * width + x], self._weights[y * width + x] = of, weights
        for _ in range(GROWN):
            self._grow()

    def _grow(self) -> None:
        triangle, weights = self._triangle.reshape(self.shape), self._weights.reshape(*self.shape, 2)
        known = triangle >= 0
        for to, by in ((slice(1, None), slice(None, -1)), (slice(None, -1), slice(1, None))):
            for one, other in (((to,), (by,)), ((slice(None), to), (slice(None), by))):
                new = known[other] & (triangle[one] < 0)
                triangle[one][new], weights[one][new] = triangle[other][new], weights[other][new]

    def image(self, values: np.ndarray) -> np.ndarray:
        """Of values (vertices, 2): (height, width, 4) float32; 0 where there is nothing and in the third channel, 1 in
        the last one."""
        height, width = self.shape
        image = np.zeros((height * width, 4), np.float32)
        image[:, 3] = 1
        there = np.flatnonzero(self._triangle >= 0)
        for first in range(0, len(there), _CHUNK):
            at = there[first : first + _CHUNK]
            a, b, c = np.moveaxis(values[self._vertices[self._triangle[at]]], 1, 0)
            one, two = self._weights[at, :1], self._weights[at, 1:]
            image[at, :2] = a + one * (b - a) + two * (c - a)
        return image.reshape(height, width, 4)


def _cross(one: np.ndarray, two: np.ndarray) -> np.ndarray:
    return one[..., 0] * two[..., 1] - one[..., 1] * two[..., 0]


def _counted(first: np.ndarray, last: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """All numbers from each first to its last: whose they are, and the numbers."""
    count = np.maximum(last - first + 1, 0)
    whose = np.repeat(np.arange(len(count)), count)
    return whose, np.arange(len(whose)) - np.repeat(np.cumsum(count) - count, count) + first[whose]
