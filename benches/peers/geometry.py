"""Triangles in the plane: areas, point location, and the inverse of a warp."""

import numpy as np
from scipy.sparse.linalg import splu


def cross(a: np.ndarray, b: np.ndarray) -> np.ndarray:
    return a[..., 0] * b[..., 1] - a[..., 1] * b[..., 0]


def areas(points: np.ndarray, faces: np.ndarray) -> np.ndarray:
    """Signed areas of triangles in the plane."""
    a, b, c = (points[faces[:, k]] for k in range(3))
    return 0.5 * cross(b - a, c - a)


def find(uv: np.ndarray, faces: np.ndarray, points: np.ndarray, face_label=None, point_label=None):
    """The triangle under each point (of the point's label, if given): its index, or -1 if none is near, the barycentric
    weights, and the least of these, which is negative outside of the triangle. Of several triangles the one with the
    greatest least weight counts, so that a point on a border, which may lie outside by rounding, has one, too."""
    corners = uv[faces]
    origin = np.floor(points.min(axis=0)).astype(int) - 1
    extent = np.floor(points.max(axis=0)).astype(int) - origin + 2
    low, high = (
        (np.floor(bound).astype(int) - origin).clip(0, extent - 1)
        for bound in (corners.min(axis=1), corners.max(axis=1))
    )
    # Pairs each cell's triangles, by their bounding boxes, with the points in the cell.
    span = high - low + 1
    triangle, k = groups(span[:, 0] * span[:, 1])
    cell = low[triangle] + np.stack([k % span[triangle, 0], k // span[triangle, 0]], axis=1)
    key = cell[:, 1] * extent[0] + cell[:, 0]
    of_point = np.floor(points).astype(int) - origin
    of_point = of_point[:, 1] * extent[0] + of_point[:, 0]
    order = np.argsort(of_point, kind="stable")
    first, end = (np.searchsorted(of_point[order], key, side) for side in ("left", "right"))
    pair, k = groups(end - first)
    triangle, point = triangle[pair], order[first[pair] + k]
    if face_label is not None:
        same = face_label[triangle] == point_label[point]
        triangle, point = triangle[same], point[same]
    a, b, c = (corners[triangle, k] for k in range(3))
    whole = cross(b - a, c - a)
    whole = np.where(whole == 0, 1e-300, whole)
    second = cross(points[point] - a, c - a) / whole
    third = cross(b - a, points[point] - a) / whole
    weights = np.stack([1 - second - third, second, third], axis=1)
    best = np.lexsort((weights.min(axis=1).round(9), point))
    if len(best):
        best = best[np.append(np.diff(point[best]) != 0, True)]
    found = np.full(len(points), -1)
    found[point[best]] = triangle[best]
    of_found = np.zeros((len(points), 3))
    of_found[point[best]] = weights[best]
    least = np.full(len(points), -np.inf)
    least[point[best]] = weights[best].min(axis=1)
    return found, of_found, least


def groups(count: np.ndarray):
    """For counts (2, 0, 3): the group (0, 0, 2, 2, 2) and the place in it (0, 1, 0, 1, 2)."""
    group = np.repeat(np.arange(len(count)), count)
    return group, np.arange(len(group)) - np.repeat(np.cumsum(count) - count, count)


def grid_nodes(cells: int) -> np.ndarray:
    """Positions of the nodes of a grid, row by row from v = 0, in cells."""
    n = np.arange((cells + 1) ** 2)
    return np.stack([n % (cells + 1), n // (cells + 1)], axis=1).astype(float)


def grid_triangles(cells: int, cell: np.ndarray | None = None) -> np.ndarray:
    """Two triangles per cell (of those given, or of all), split from corner (0, 0) to (1, 1), as vrtm splits them."""
    cell = np.arange(cells * cells) if cell is None else cell
    a = cell % cells + cell // cells * (cells + 1)
    b, c, d = a + 1, a + cells + 2, a + cells + 1
    return np.concatenate([np.stack([a, b, c], axis=1), np.stack([a, c, d], axis=1)])


def warp_folds(displacement: np.ndarray, cells: int) -> int:
    """Triangles of the warped grid that are flipped or have no area."""
    return int((areas(grid_nodes(cells) + displacement, grid_triangles(cells)) <= 0).sum())


def invert(displacement: np.ndarray, cells: int, points: np.ndarray) -> np.ndarray:
    """Points that a warp takes to `points`, both in cells."""
    nodes, triangles = grid_nodes(cells), grid_triangles(cells)
    # A warp that is one-to-one leaves alone what lies outside of the cells that it changes.
    triangles = triangles[(displacement[triangles] != 0).any(axis=(1, 2))]
    if not len(triangles):
        return points.copy()
    found, weights, least = find(nodes + displacement, triangles, points)
    source = (weights[:, :, None] * nodes[triangles[found]]).sum(axis=1)
    return np.where((least > -1e-6)[:, None], source, points)


def factor(matrix):
    """A symmetric positive definite sparse matrix, factorised."""
    options = {"SymmetricMode": True}
    return splu(matrix.tocsc(), permc_spec="MMD_AT_PLUS_A", diag_pivot_thresh=0.0, options=options)
