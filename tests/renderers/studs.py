"""Round studs on a mesh at rest, painted into its textures."""

import numpy as np


def positions(mesh, rest, size, tile=1001):
    """Place of each texel of a tile on the surface at rest; NaN outside of charts."""
    out = np.full((size, size, 3), np.nan)
    uvs = mesh.uvs - [(tile - 1001) % 10, (tile - 1001) // 10]
    for corners, points in zip(uvs[mesh.uv_triangles] * size - 0.5, rest[mesh.triangles]):
        low = np.maximum(np.ceil(corners.min(0)).astype(int), 0)
        high = np.minimum(np.floor(corners.max(0)).astype(int), size - 1)
        x, y = np.meshgrid(np.arange(low[0], high[0] + 1), np.arange(low[1], high[1] + 1))
        (ax, ay), (bx, by) = corners[1] - corners[0], corners[2] - corners[0]
        det = ax * by - ay * bx
        if not det or not x.size:
            continue
        dx, dy = x - corners[0, 0], y - corners[0, 1]
        s, t = (dx * by - dy * bx) / det, (ax * dy - ay * dx) / det
        inside = (s >= -1e-9) & (t >= -1e-9) & (s + t <= 1 + 1e-9)
        weights = np.stack([1 - s - t, s, t], -1)[inside]
        out[size - 1 - y[inside], x[inside]] = weights @ points
    return out


def centres(candidates, apart):
    """Points, from the first one on, that are farther apart than `apart`."""
    chosen = []
    for point in candidates:
        if all(np.hypot.reduce(point - other) > apart for other in chosen):
            chosen.append(point)
    return chosen


def distances(place, centres, radius):
    """The distance of each texel to the next centre, in radii, infinite beyond two."""
    here = ~np.isnan(place[..., 0])
    points = place[here]
    points, order = points[np.argsort(points[:, 0])], np.argsort(points[:, 0])
    nearest = np.full(len(points), np.inf)
    for centre in centres:
        near = slice(*np.searchsorted(points[:, 0], [centre[0] - 2 * radius, centre[0] + 2 * radius]))
        nearest[near] = np.minimum(nearest[near], np.linalg.norm(points[near] - centre, axis=1) / radius)
    distance = np.full(place.shape[:2], np.inf)
    distance.flat[np.flatnonzero(here)[order]] = np.where(nearest < 2, nearest, np.inf)
    return distance
