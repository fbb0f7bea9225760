"""Triangles as a camera sees them, in numpy."""

from collections.abc import Sequence

import numpy as np

_AT_ONCE = 1 << 20
"""Samples that are looked at together."""
_MARGIN = 1.06
"""Size of the view against that of the mesh."""


class Camera:
    """An orthographic camera that sees all of some positions."""

    def __init__(self, poses: Sequence[np.ndarray], yaw: float, pitch: float) -> None:
        """At 0 degrees y points up, and z at the viewer; yaw moves the viewer to the right, pitch upwards."""
        (ys, ps), (yc, pc) = np.sin(np.radians([yaw, pitch])), np.cos(np.radians([yaw, pitch]))
        self.axes = np.array([[yc, 0, -ys], [-ps * ys, pc, -ps * yc], [pc * ys, ps, pc * yc]])
        """Unit vectors as rows: right, up, toward the viewer."""
        if z_up(poses[0]):
            self.axes = np.stack([self.axes[:, 0], -self.axes[:, 2], self.axes[:, 1]], 1)
        seen = np.concatenate(poses) @ self.axes.T
        self._low, self._high = seen.min(0), seen.max(0)
        self._size = _MARGIN * np.maximum(self._high - self._low, 0.05 * (self._high - self._low)[:2].max() + 1e-30)[:2]
        self.aspect = float(self._size[1] / self._size[0])
        """Height over width of the view."""

    def scale(self, size: tuple[int, int]) -> float:
        """Pixels of a picture of so many per unit of length."""
        return float(min(size[0] / self._size[0], size[1] / self._size[1]))

    def project(self, positions: np.ndarray, size: tuple[int, int]) -> np.ndarray:
        """(points, 3): pixels from the left, from the top, and how near."""
        seen = (positions @ self.axes.T - (self._low + self._high) / 2) * (self.scale(size) * np.array([1, -1, 1]))
        return seen + np.array([size[0] / 2, size[1] / 2, 0])


def z_up(rest: np.ndarray) -> bool:
    """A guess, since not all files say so: whether a mesh that is not flat stands on z = 0, and not on y = 0."""
    low, size = rest.min(0), np.ptp(rest, axis=0)
    stands = np.abs(low) < 0.02 * size
    return bool(stands[2] and not stands[1] and size[2] >= 0.02 * size[:2].max())


def cover(corners: np.ndarray, size: tuple[int, int]) -> tuple[np.ndarray, np.ndarray]:
    """The triangle that is seen at the centre of each pixel, (height, width), -1 for none, and the weights of its
    corners there, (height, width, 3). `corners`: (triangles, 3, 3), in pixels from the left and from the top, and how
    near."""
    width, height = size
    near, found = np.full(width * height, -np.inf), np.full(width * height, -1)
    xy, z = corners[..., :2], corners[..., 2]
    low = np.nan_to_num(np.floor(xy.min(1))).clip(0, size).astype(np.int64)
    high = np.nan_to_num(np.ceil(xy.max(1))).clip(0, size).astype(np.int64)
    extent = (high - low).max(1)
    extent[(high <= low).any(1) | (area(*xy.swapaxes(0, 1)) == 0) | ~np.isfinite(corners).all((1, 2))] = 0
    side = 1
    while side < 2 * max(size):
        chosen = np.flatnonzero((extent <= side) & (extent > side // 2))
        step = np.arange(side)
        for some in np.array_split(chosen, max(-(-len(chosen) * side * side // _AT_ONCE), 1)):
            x = np.broadcast_to(low[some, 0, None, None] + step, (len(some), side, side))
            y = np.broadcast_to(low[some, 1, None, None] + step[:, None], x.shape)
            weights = weights_at(xy[some, None, None], np.stack([x, y], -1) + 0.5)
            # With their edges, so that none is missed between two triangles.
            inside = (weights >= -1e-9).all(-1) & (x < high[some, 0, None, None]) & (y < high[some, 1, None, None])
            which, pixel = np.nonzero(inside)[0], (y * width + x)[inside]
            depth = (weights[inside] * z[some][which]).sum(-1)
            # The nearest last: of several values for one pixel, numpy keeps that.
            order = np.argsort(depth, kind="stable")
            order = order[depth[order] > near[pixel[order]]]
            near[pixel[order]], found[pixel[order]] = depth[order], some[which[order]]
        side *= 2
    found = found.reshape(height, width)
    rows, columns = np.nonzero(found >= 0)
    weights = np.zeros((height, width, 3))
    weights[rows, columns] = weights_at(xy[found[rows, columns]], np.stack([columns, rows], -1) + 0.5)
    return found, weights


def weights_at(xy: np.ndarray, points: np.ndarray) -> np.ndarray:
    """(..., 3): the weights of the corners of triangles, (..., 3, 2), at points, (..., 2)."""
    corners = [xy[..., k, :] for k in range(3)]
    with np.errstate(divide="ignore", invalid="ignore"):
        sides = [area(points, corners[(k + 1) % 3], corners[(k + 2) % 3]) for k in range(3)]
        return np.stack(sides, -1) / area(*corners)[..., None]


def area(a: np.ndarray, b: np.ndarray, c: np.ndarray) -> np.ndarray:
    """Twice the area of triangles, with a sign."""
    return (b[..., 0] - a[..., 0]) * (c[..., 1] - a[..., 1]) - (b[..., 1] - a[..., 1]) * (c[..., 0] - a[..., 0])
