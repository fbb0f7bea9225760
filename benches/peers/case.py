"""A case as the bench exports it: meshes, maps, and vrtm's own measurements."""

import json
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from PIL import Image
from scipy.sparse import coo_matrix
from scipy.sparse.csgraph import connected_components


@dataclass
class Case:
    facts: dict
    grid: int
    rest: np.ndarray  # per UV vertex, so that charts do not share vertices
    pose: np.ndarray
    uv: np.ndarray  # in cells of the tile
    faces: np.ndarray  # triangles of UV vertices
    chart: np.ndarray  # per UV vertex
    border: np.ndarray  # UV vertices on chart borders
    rigidity: np.ndarray  # per node, row by row from v = 0
    movable: np.ndarray  # per node
    displacement: np.ndarray  # vrtm's, per node, in cells


def load(folder: Path) -> Case:
    facts = json.loads((folder / "case.json").read_text())
    grid = facts["grid"]
    rest, uv, faces, vertex = read_obj(folder / "rest.obj")
    pose = read_obj(folder / "pose.obj")[0]
    uv = uv - [(facts["udim"] - 1001) % 10, (facts["udim"] - 1001) // 10]
    centre = uv[faces].mean(axis=1)
    faces = faces[((centre >= 0) & (centre < 1)).all(axis=1)]
    used, faces = np.unique(faces, return_inverse=True)
    faces = faces.reshape(-1, 3)
    rest, pose, uv = rest[vertex[used]], pose[vertex[used]], uv[used] * grid
    # Triangles without area in UV cannot be parameterised.
    faces = faces[np.abs(areas(uv, faces)) > 1e-9]
    warp = np.fromfile(folder / "warp.f32", "<f4").astype(float).reshape(-1, 2)
    movable = np.fromfile(folder / "movable.u8", np.uint8) != 0
    rigidity = to_nodes(folder / "rigidity.png", grid)
    return Case(facts, grid, rest, pose, uv, faces, charts(faces, len(uv)), border(faces), rigidity, movable, warp)


def areas(points: np.ndarray, faces: np.ndarray) -> np.ndarray:
    """Signed areas of triangles in the plane."""
    a, b, c = (points[faces[:, k]] for k in range(3))
    return 0.5 * ((b - a)[:, 0] * (c - a)[:, 1] - (b - a)[:, 1] * (c - a)[:, 0])


def read_obj(path: Path):
    """Positions, UVs, triangles (of UV indices; polygons as fans), and each UV's position index."""
    positions, uvs, faces = [], [], []
    for line in path.read_text().splitlines():
        kind, *rest = line.split()
        if kind == "v":
            positions.append([float(x) for x in rest])
        elif kind == "vt":
            uvs.append([float(x) for x in rest])
        elif kind == "f":
            corners = [tuple(int(i) - 1 for i in corner.split("/")) for corner in rest]
            faces += [(corners[0], corners[k], corners[k + 1]) for k in range(1, len(corners) - 1)]
    corners = np.array(faces)
    # A UV that two vertices share would connect their charts: each pair of vertex and UV becomes one UV vertex.
    pairs, index = np.unique(corners.reshape(-1, 2), axis=0, return_inverse=True)
    return np.array(positions), np.array(uvs)[pairs[:, 1]], index.reshape(-1, 3), pairs[:, 0]


def charts(faces: np.ndarray, count: int) -> np.ndarray:
    a, b = faces.ravel(), np.roll(faces, 1, axis=1).ravel()
    graph = coo_matrix((np.ones(len(a)), (a, b)), (count, count))
    return connected_components(graph, directed=False)[1]


def border(faces: np.ndarray) -> np.ndarray:
    edges = np.sort(np.stack([faces, np.roll(faces, -1, axis=1)], axis=-1).reshape(-1, 2), axis=1)
    edges, count = np.unique(edges, axis=0, return_counts=True)
    return np.unique(edges[count == 1])


def to_nodes(path: Path, grid: int) -> np.ndarray:
    """Mean over a box of one cell around each node, or of one texel where the map is coarser, as in the library."""
    image = np.asarray(Image.open(path).convert("L"), float)[::-1] / 255
    along = [taps(image.shape[k], grid) for k in range(2)]
    return (along[0] @ image @ along[1].T).ravel()


def taps(texels: int, cells: int) -> np.ndarray:
    per_cell = texels / cells
    half = 0.5 * max(1.0, per_cell)
    weights = np.zeros((cells + 1, texels))
    for node in range(cells + 1):
        low, high = node * per_cell - half, node * per_cell + half
        for texel in range(int(np.floor(low)), int(np.ceil(high))):
            overlap = max(0.0, min(high, texel + 1.0) - max(low, texel)) / (high - low)
            weights[node, min(max(texel, 0), texels - 1)] += overlap
    return weights
