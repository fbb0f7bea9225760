"""A case: a mesh at rest and in a pose, what is rigid, and vrtm's warp for it.

It comes from what the bench exports (`load`), or from the folder of an asset (`of_asset`, `Scene`), and is then solved
through the Python package `vrtm`.
"""

import json
import statistics
import time
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
from geometry import areas, grid_nodes
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
    vertex: np.ndarray  # vertex of the OBJ, per UV vertex
    cache: dict = field(default_factory=dict, repr=False)  # of measure.py

    def inner(self) -> np.ndarray:
        """Mask of the UV vertices that are off the chart borders."""
        inner = np.ones(len(self.uv), bool)
        inner[self.border] = False
        return inner

    def charts(self):
        """Each chart with vertices off its border: its UV vertices, and its triangles in their numbering, turned so
        that their areas are positive in sum."""
        of_face = self.chart[self.faces[:, 0]]
        inner = self.inner()
        for chart in np.unique(of_face):
            vertices, faces = np.unique(self.faces[of_face == chart], return_inverse=True)
            faces = faces.reshape(-1, 3)
            if inner[vertices].any():
                turned = areas(self.uv[vertices], faces).sum() < 0
                yield vertices, faces[:, ::-1] if turned else faces


def load(folder: Path) -> Case:
    """A case that `cargo bench --bench speed_error -- --export` wrote."""
    facts = json.loads((folder / "case.json").read_text())
    grid = facts["grid"]
    mesh = Mesh(folder / "rest.obj", facts["udim"], grid)
    pose = read_obj(folder / "pose.obj")[0]
    warp = np.fromfile(folder / "warp.f32", "<f4").astype(float).reshape(-1, 2)
    movable = np.fromfile(folder / "movable.u8", np.uint8) != 0
    return mesh.case(facts, pose, to_nodes(read_map(folder / "rigidity.png"), grid), movable, warp)


def of_asset(folder: Path, frame: int, grid: int, udim: int | None = None, pose: np.ndarray | None = None) -> Case:
    """A case from an asset's folder: frame 1 is the first of frames.f32. `pose`, if given, replaces it: positions of
    the vertices of the OBJ. `udim`: the first tile with a map of rigidity, if none is given."""
    return Scene(folder, grid, udim).case(frame, pose)


class Scene:
    """An asset's folder with a device that solves its poses one after the other, each by itself."""

    def __init__(self, folder: Path, grid: int, udim: int | None = None, threads: int = 0):
        import vrtm

        folder = Path(folder)
        facts = json.loads((folder / "asset.json").read_text())
        maps = facts["rigidity"]
        udim = udim if udim is not None else int(min(maps))
        if str(udim) not in maps:
            raise ValueError(f"udim: {folder / 'asset.json'} names no rigidity for {udim}, only for {', '.join(maps)}")
        self.name, self.grid, self.udim, self.threads = facts.get("name", folder.name), grid, udim, threads
        self.mesh = Mesh(folder / "rest.obj", udim, grid)
        count = len(self.mesh.positions)
        frames = np.fromfile(folder / "frames.f32", "<f4")
        if len(frames) == 0 or len(frames) % (3 * count):
            raise ValueError(f"{folder / 'frames.f32'}: {len(frames)} numbers are no whole frames of {count} vertices")
        self.frames = frames.reshape(-1, count, 3).astype(float)
        painted = read_map(folder / maps[str(udim)])
        self.rigidity = to_nodes(painted, grid)
        self.device = vrtm.Device("cpu", threads=threads)
        corners = self.mesh.corners
        self.asset = vrtm.Asset(
            self.device,
            self.mesh.positions,
            np.ascontiguousarray(corners[:, :, 0]),
            uvs=self.mesh.all_uvs,
            uv_indices=np.ascontiguousarray(corners[:, :, 1]),
        )
        self.tile = self.asset.tile(udim)
        self.tile.set_rigidity(painted, origin="bottom")
        self.tile.set_settings(grid_width=grid, grid_height=grid)
        if (self.tile.settings.grid_width, self.tile.settings.grid_height) != (grid, grid):
            raise ValueError(f"grid: {grid} is no multiple of 16")
        # A node that may move does so in a stretched pose: charts that keep their lengths are left as they are.
        x, y, z = self.mesh.positions.T
        self.movable = self.warp(np.stack([1.3 * x + 0.2 * y, y - 0.1 * z, 0.8 * z], axis=1)).any(axis=1)

    def warp(self, pose: np.ndarray, **options) -> np.ndarray:
        """vrtm's displacements for a pose, per node, in cells."""
        self.asset.solve(np.ascontiguousarray(pose, np.float32), tiles=[self.tile], **options)
        warp = self.tile.fetch("warp", origin="bottom")[..., :2].astype(float).reshape(-1, 2)
        nodes = grid_nodes(self.grid)
        displacement = warp * self.grid - nodes
        # The fetched positions are rounded to f32.
        displacement[np.abs(displacement) < self.grid * 2.0**-23] = 0
        return displacement

    def pose(self, frame: int) -> np.ndarray:
        if not 1 <= frame <= len(self.frames):
            raise ValueError(f"frame: {frame} is not in 1..{len(self.frames)}")
        return self.frames[frame - 1]

    def case(self, frame: int, pose: np.ndarray | None = None, repeats: int = 1, **options) -> Case:
        """The case of a frame, or of a pose; vrtm's time is the median of `repeats` solves."""
        pose = self.pose(frame) if pose is None else np.asarray(pose, float)
        if pose.shape != self.mesh.positions.shape:
            raise ValueError(f"pose: of shape {pose.shape}, where the mesh has {self.mesh.positions.shape}")
        seconds = []
        for k in range(repeats):
            # An asset keeps its result for a pose that did not change; another one in between makes it solve again.
            if k:
                self.asset.solve(np.ascontiguousarray(self.mesh.positions, np.float32), tiles=[self.tile])
            start = time.process_time()
            self.asset.solve(np.ascontiguousarray(pose, np.float32), tiles=[self.tile], **options)
            seconds.append(time.process_time() - start)
        displacement = self.warp(pose, **options)
        facts = {"scene": self.name, "frame": frame, "udim": self.udim, "grid": self.grid}
        facts |= {"vrtm_seconds": statistics.median(seconds), "threads": self.device.info.threads}
        return self.mesh.case(facts, pose, self.rigidity, self.movable, displacement)


class Mesh:
    """The triangles of one tile of an OBJ, with a vertex per pair of vertex and UV."""

    def __init__(self, path: Path, udim: int, grid: int):
        self.grid = grid
        self.positions, self.all_uvs, self.corners = read_obj(path)
        # A UV that two vertices share would connect their charts: each pair of vertex and UV becomes one UV vertex.
        pairs, index = np.unique(self.corners.reshape(-1, 2), axis=0, return_inverse=True)
        uv = self.all_uvs[pairs[:, 1]] - [(udim - 1001) % 10, (udim - 1001) // 10]
        faces = index.reshape(-1, 3)
        centre = uv[faces].mean(axis=1)
        faces = faces[((centre >= 0) & (centre < 1)).all(axis=1)]
        if not len(faces):
            raise ValueError(f"{path}: no face in tile {udim}")
        # Triangles without area in UV cannot be parameterised.
        faces = faces[np.abs(areas(uv * grid, faces)) > 1e-9]
        used, faces = np.unique(faces, return_inverse=True)
        self.vertex, self.uv, self.faces = pairs[used, 0], uv[used] * grid, faces.reshape(-1, 3)

    def case(self, facts: dict, pose, rigidity, movable, displacement) -> Case:
        if pose.shape != self.positions.shape:
            raise ValueError(f"pose: {len(pose)} positions for {len(self.positions)} vertices")
        chart = connected(self.faces, len(self.uv))
        rest, pose = self.positions[self.vertex], pose[self.vertex]
        geometry = (rest, pose, self.uv, self.faces, chart, border(self.faces))
        return Case(facts, self.grid, *geometry, rigidity, movable, displacement, self.vertex)


def read_obj(path: Path):
    """Positions, UVs, and triangles (polygons as fans) as the vertex and the UV of each corner."""
    positions, uvs, faces = [], [], []
    for line in path.read_text().splitlines():
        kind, *rest = line.split() or [""]
        if kind == "v":
            positions.append([float(x) for x in rest[:3]])
        elif kind == "vt":
            uvs.append([float(x) for x in rest[:2]])
        elif kind == "f":
            corners = [tuple(int(i) - 1 for i in corner.split("/")[:2]) for corner in rest]
            faces += [(corners[0], corners[k], corners[k + 1]) for k in range(1, len(corners) - 1)]
    return np.array(positions), np.array(uvs), np.array(faces)


def connected(faces: np.ndarray, count: int) -> np.ndarray:
    a, b = faces.ravel(), np.roll(faces, 1, axis=1).ravel()
    graph = coo_matrix((np.ones(len(a)), (a, b)), (count, count))
    return connected_components(graph, directed=False)[1]


def border(faces: np.ndarray) -> np.ndarray:
    edges = np.sort(np.stack([faces, np.roll(faces, -1, axis=1)], axis=-1).reshape(-1, 2), axis=1)
    edges, count = np.unique(edges, axis=0, return_counts=True)
    return np.unique(edges[count == 1])


def read_map(path: Path) -> np.ndarray:
    """A map of rigidity as 8 bits per texel, row by row from v = 0."""
    return np.ascontiguousarray(np.asarray(Image.open(path).convert("L"))[::-1])


def to_nodes(image: np.ndarray, grid: int) -> np.ndarray:
    """Mean over a box of one cell around each node, or of one texel where the map is coarser, as in the library."""
    along = [taps(image.shape[k], grid) for k in range(2)]
    return (along[0] @ (image.astype(float) / 255) @ along[1].T).ravel()


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
