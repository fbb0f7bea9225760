"""Strain inside rigid features, on the mesh and in f64, from its definition alone.

A segment that is painted from node a to node b lies on the surface where the parameterisation maps it. Its strain is its
chord in the pose over its chord at rest, minus 1. At rest the parameterisation is the original one.
"""

import numpy as np

from case import Case, areas

RIGID = 0.5
EDGES = [(1, 0), (0, 1), (1, 1), (-1, 1)]


def measure(case: Case, *, uv: np.ndarray | None = None, warped: bool = False) -> dict:
    """Strain of new UVs per UV vertex, in cells; or of vrtm's warp; or of the original UVs."""
    width = case.grid + 1
    nodes = np.flatnonzero(case.rigidity > RIGID)
    at = np.stack([nodes % width, nodes // width], axis=1).astype(float)
    home, rest, _ = locate(case, case.uv, at, None, case.rest)
    chart = np.where(home >= 0, case.chart[case.faces[home, 0]], -1)
    goal = at + case.displacement[nodes] if warped else at
    _, after, outside = locate(case, case.uv if uv is None else uv, goal, chart, case.pose)
    place = np.full(width * width, -1)
    place[nodes] = np.arange(len(nodes))
    strains, lost = [], 0
    for di, dj in EDGES:
        inside = (nodes % width + di >= 0) & (nodes % width + di < width) & (nodes // width + dj < width)
        a = nodes[inside]
        b = a + dj * width + di
        a, b = a[place[b] >= 0], b[place[b] >= 0]
        a, b = (x[case.movable[a] | case.movable[b]] for x in (a, b))
        i, j = place[a], place[b]
        covered = (home[i] >= 0) & (home[j] >= 0)
        i, j = i[covered], j[covered]
        gone = outside[i] | outside[j]
        lost += int(gone.sum())
        i, j = i[~gone], j[~gone]
        length = np.linalg.norm(rest[i] - rest[j], axis=1)
        i, j, length = i[length > 0], j[length > 0], length[length > 0]
        strains.append(np.linalg.norm(after[i] - after[j], axis=1) / length - 1)
    size = np.abs(np.concatenate(strains))
    result = {"rms": float(np.sqrt((size**2).mean())), "p95": float(np.quantile(size, 0.95)), "max": float(size.max())}
    result |= {"edges": len(size), "lost": lost}
    if uv is not None:
        result["flipped"] = int((areas(uv, case.faces) * areas(case.uv, case.faces) <= 0).sum())
    return result


def locate(case: Case, uv: np.ndarray, points: np.ndarray, chart, positions: np.ndarray):
    """The triangle under each point (of its chart, if given), the surface there, and whether it lies outside of all."""
    corners = uv[case.faces]
    low = np.floor(corners.min(axis=1)).astype(int).clip(-1, case.grid + 1)
    high = np.floor(corners.max(axis=1)).astype(int).clip(-1, case.grid + 1)
    # Pairs each cell's triangles, by their bounding boxes, with the points in the cell.
    span = high - low + 1
    count = span[:, 0] * span[:, 1]
    triangle = np.repeat(np.arange(len(case.faces)), count)
    k = np.arange(count.sum()) - np.repeat(np.cumsum(count) - count, count)
    cell = low[triangle] + np.stack([k % span[triangle, 0], k // span[triangle, 0]], axis=1)
    pitch = case.grid + 4
    key = (cell[:, 1] + 1) * pitch + cell[:, 0] + 1
    of_point = np.floor(points).astype(int).clip(-1, case.grid + 1)
    of_point = (of_point[:, 1] + 1) * pitch + of_point[:, 0] + 1
    order = np.argsort(of_point, kind="stable")
    first, end = (np.searchsorted(of_point[order], key, side) for side in ("left", "right"))
    count = end - first
    triangle = np.repeat(triangle, count)
    point = order[np.repeat(first, count) + np.arange(count.sum()) - np.repeat(np.cumsum(count) - count, count)]
    if chart is not None:
        same = case.chart[case.faces[triangle, 0]] == chart[point]
        triangle, point = triangle[same], point[same]
    a, b, c = (corners[triangle, k] for k in range(3))
    cross = lambda p, q: p[:, 0] * q[:, 1] - p[:, 1] * q[:, 0]
    whole = cross(b - a, c - a)
    whole = np.where(whole == 0, 1e-300, whole)
    second = cross(points[point] - a, c - a) / whole
    third = cross(b - a, points[point] - a) / whole
    weights = np.stack([1 - second - third, second, third], axis=1)
    # The triangle with the greatest least barycentric weight; a point on a border may lie outside of all triangles by
    # rounding.
    best = np.lexsort((weights.min(axis=1).round(9), point))
    last = np.flatnonzero(np.append(np.diff(point[best]) != 0, True)) if len(best) else best
    best = best[last]
    found = np.full(len(points), -1)
    surface = np.full((len(points), 3), np.nan)
    outside = np.ones(len(points), bool)
    found[point[best]] = np.where(weights[best].min(axis=1) > -1e-6, triangle[best], -1)
    surface[point[best]] = (weights[best][:, :, None] * positions[case.faces[triangle[best]]]).sum(axis=1)
    outside[point[best]] = weights[best].min(axis=1) < -1e-3
    return found, surface, outside
