"""Measures on the mesh, in f64, from their definitions alone.

A segment that is painted from node a to node b lies on the surface where the parameterisation maps it. Its strain is
its chord in the pose over its chord at rest, minus 1. At rest the parameterisation is the original one. Every
function takes the parameterisation of the pose as one of: `uv`, new UVs per UV vertex, in cells; `warp`, a
displacement per node, in cells, as vrtm's; `warped=True`, vrtm's own warp; none of them, the original UVs.
"""

import numpy as np
from case import Case
from geometry import areas, find, invert, warp_folds
from scipy.sparse import coo_matrix
from scipy.sparse.csgraph import connected_components

RIGID = 0.5
EDGES = [(1, 0), (0, 1), (1, 1), (-1, 1)]
# Features with fewer edges are left out.
LEAST_EDGES = 12


def edges(case: Case) -> dict:
    """The painted segments: edges between rigid nodes, one of which may move, and that the surface covers. They
    depend on the case's rest pose alone and are kept with it."""
    if "edges" in case.cache:
        return case.cache["edges"]
    width = case.grid + 1
    nodes = np.flatnonzero(case.rigidity > RIGID)
    at = np.stack([nodes % width, nodes // width], axis=1).astype(float)
    home, weights, least = find(case.uv, case.faces, at)
    covered = least > -1e-6
    chart = np.where(covered, case.chart[case.faces[home, 0]], -1)
    rest = (weights[:, :, None] * case.rest[case.faces[home]]).sum(axis=1)
    place = np.full(width * width, -1)
    place[nodes] = np.arange(len(nodes))
    ends = []
    for di, dj in EDGES:
        inside = (nodes % width + di >= 0) & (nodes % width + di < width) & (nodes // width + dj < width)
        a = nodes[inside]
        b = a + dj * width + di
        a, b = a[place[b] >= 0], b[place[b] >= 0]
        a, b = (x[case.movable[a] | case.movable[b]] for x in (a, b))
        ends.append(np.stack([place[a], place[b]]))
    i, j = np.concatenate(ends, axis=1)
    i, j = (x[covered[i] & covered[j]] for x in (i, j))
    length = np.linalg.norm(rest[i] - rest[j], axis=1)
    i, j, length = i[length > 0], j[length > 0], length[length > 0]
    # A feature: what edges connect within a chart.
    same = chart[i] == chart[j]
    graph = coo_matrix((np.ones(same.sum()), (i[same], j[same])), (len(nodes), len(nodes)))
    feature = connected_components(graph, directed=False)[1][i]
    result = {"nodes": nodes, "at": at, "chart": chart, "i": i, "j": j, "length": length, "feature": feature}
    case.cache["edges"] = result
    return result


def strains(case: Case, *, uv=None, warp=None, warped: bool = False) -> np.ndarray:
    """Strain of each painted segment; not a number where the new UVs do not cover it."""
    painted = edges(case)
    warp = case.displacement if warped else warp
    goal = painted["at"] if warp is None else painted["at"] + warp[painted["nodes"]]
    map_ = case.uv if uv is None else uv
    found, weights, least = find(map_, case.faces, goal, case.chart[case.faces[:, 0]], painted["chart"])
    surface = (weights[:, :, None] * case.pose[case.faces[found]]).sum(axis=1)
    # A point just outside of all triangles, by rounding, is taken from the plane of the nearest one.
    surface[least < -1e-3] = np.nan
    chord = np.linalg.norm(surface[painted["i"]] - surface[painted["j"]], axis=1)
    return chord / painted["length"] - 1


def strain(case: Case, **map_) -> dict:
    """Strain over all painted segments: RMS, 95 %, largest; the number of segments, and of those not covered."""
    values = strains(case, **map_)
    size = np.abs(values[~np.isnan(values)])
    result = {"rms": float(np.sqrt((size**2).mean())), "p95": float(np.quantile(size, 0.95)), "max": float(size.max())}
    return result | {"edges": len(size), "lost": int(np.isnan(values).sum())}


def features(case: Case, **map_) -> np.ndarray:
    """The error of each painted feature, a connected set of nodes with a rigidity over 0.5: the root mean square of the
    strain over its edges. The order is that of the case: results of two methods may be compared feature by feature. A
    feature that the new UVs do not cover has an infinite error."""
    values, feature = strains(case, **map_), edges(case)["feature"]
    lost = np.isnan(values)
    count = np.bincount(feature)
    covered = np.bincount(feature, ~lost)
    total = np.bincount(feature, np.where(lost, 0, values) ** 2)
    with np.errstate(divide="ignore", invalid="ignore"):
        error = np.where(covered > 0, np.sqrt(total / covered), np.inf)
    return error[count >= LEAST_EDGES]


def against(error: np.ndarray, original: np.ndarray) -> dict:
    """Features counted: all, those worse by more than 0.02 than with the original UVs, and those over 0.05."""
    return {
        "features": len(error),
        "worse": int((error > original + 0.02).sum()),
        "over": int((error > 0.05).sum()),
    }


def folds(case: Case, *, uv=None, warp=None, warped: bool = False) -> int:
    """Flipped triangles: of the mesh for new UVs, of the grid for a warp (two per cell); the latter also if flat."""
    warp = case.displacement if warped else warp
    if warp is not None:
        return warp_folds(warp, case.grid)
    return 0 if uv is None else int((areas(uv, case.faces) * areas(case.uv, case.faces) <= 0).sum())


def surface_points(case: Case, count: int = 4000):
    """Random points, the same in every call, evenly spread over the rest surface of the charts in which vrtm may move a
    node: triangles and barycentric weights."""
    generator = np.random.default_rng(1)
    nodes = np.flatnonzero(case.movable)
    at = np.stack([nodes % (case.grid + 1), nodes // (case.grid + 1)], axis=1).astype(float)
    moving = np.unique(case.chart[case.faces[find(case.uv, case.faces, at)[0], 0]])
    a, b, c = (case.rest[case.faces[:, k]] for k in range(3))
    area = np.linalg.norm(np.cross(b - a, c - a), axis=1) * np.isin(case.chart[case.faces[:, 0]], moving)
    triangle = generator.choice(len(area), count, p=area / area.sum())
    return triangle, generator.dirichlet([1, 1, 1], count)


def texture_at(case: Case, points, *, uv=None, warp=None, warped: bool = False) -> np.ndarray:
    """The texture's point, in cells, that shows at each of `surface_points`: interpolated new UVs; or, for a warp, its
    exact inverse at the original UV (what a redirection map holds)."""
    triangle, weights = points
    at = (weights[:, :, None] * (case.uv if uv is None else uv)[case.faces[triangle]]).sum(axis=1)
    warp = case.displacement if warped else warp
    return at if warp is None else invert(warp, case.grid, at)


def second_difference(tracks: list[np.ndarray]) -> dict:
    """Roughness of the texture's motion over frames: `tracks` has `texture_at` of each frame, at the same points
    fixed on the surface. Of |T(k+1) - 2 T(k) + T(k-1)| over all points and inner frames: RMS, 99.9 % and largest, in
    cells."""
    track = np.asarray(tracks)
    if len(track) < 3:
        raise ValueError(f"tracks: {len(track)} frames have no second difference")
    size = np.linalg.norm(track[2:] - 2 * track[1:-1] + track[:-2], axis=-1).ravel()
    return {
        "d2_rms": float(np.sqrt((size**2).mean())),
        "d2_p999": float(np.quantile(size, 0.999)),
        "d2_max": float(size.max()),
    }
