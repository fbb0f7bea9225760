"""Studs that are geometry, carried by vrtm, by a barycentric binding and by Blender's Surface Deform.

    python benches/peers/carried.py /tmp/scenes/arm:3 /tmp/scenes/creature:4 mh_face:1 ict_inner:2

Each painted feature gets a stud of its own shape: a node of the grid is a point of its base, and as much again lies
higher by half of its radius. Two closed forms come before the folders. Writes benches/results/carried.md.
"""

import argparse
import json
import tempfile
import time
from dataclasses import dataclass
from pathlib import Path

import measure
import numpy as np
from case import Scene
from geometry import find
from PIL import Image
from scipy.sparse import coo_matrix
from scipy.sparse.csgraph import connected_components
from scipy.spatial.transform import Rotation

RIGID = 0.75
"""A point whose rigidity is at least this moves with its feature alone."""
SIDE, STUDS = 64, 5
ABOUT = """# Carried studs, beside other ways to bind them

Studs as geometry on painted features: a lattice of points on each feature, at the nodes of the grid, and as many higher
by half of its radius. [benches/peers](../peers/README.md#studs) says how to run it.

- *Length*: |l / L - 1| over the edges of all studs: root mean square, 99 % quantile, largest.
- *Off the rim*: distance of the stud's base from its painted rim, where vrtm puts that in the pose (by the warp at the
  nodes, and the mesh), in cells of the surface there: root mean square, 99 % quantile, largest. The other methods know
  nothing of a redirection; without one, the paint is as strained as their studs are.
- *Turned*: degrees between the rotation that fits a stud best and that of the closed form at its place, the largest;
  *tilted*: those between their normals alone. What vrtm's studs turn in the plane, the warp turns their paint.
- *ms*: CPU per frame, for all studs, the median of 5: of binding to the pose alone. vrtm's solve comes before it, as it
  does for the texture, which is drawn with the same result; it stands below each table.

*Barycentric binding*: weights of the triangle's corners, and a height along the mesh's smooth normal; numpy. *Surface
Deform*: Blender's modifier with its defaults, bound at rest to the same triangles.
"""


@dataclass
class Studs:
    """Points, those of the base first, and then as many above them."""

    scene: Scene
    uv: np.ndarray  # (base points, 2), in cells
    triangles: np.ndarray  # (base points, 3), vertices
    weights: np.ndarray
    heights: np.ndarray  # (base points,)
    number: np.ndarray  # (base points,) of the stud
    edges: np.ndarray  # (edges, 2) of all points
    rim: np.ndarray  # of the base
    rest: np.ndarray

    @classmethod
    def of(cls, scene: Scene) -> "Studs":
        rest = scene.mesh.positions
        case = scene.mesh.case(
            {}, rest, scene.rigidity, scene.movable, np.zeros_like(scene.movable[:, None] * [1.0, 1])
        )
        painted = measure.edges(case)
        nodes, i, j = painted["nodes"], painted["i"], painted["j"]
        hard = scene.rigidity[nodes] >= RIGID
        kept = hard[i] & hard[j] & (painted["chart"][i] == painted["chart"][j])
        i, j = i[kept], j[kept]
        number = connected_components(coo_matrix((np.ones(len(i)), (i, j)), (len(nodes),) * 2), directed=False)[1]
        size = np.bincount(number)[number]
        used = np.flatnonzero(size >= measure.LEAST_EDGES)
        kept = size[i] >= measure.LEAST_EDGES
        place = np.full(len(nodes), -1)
        place[used] = np.arange(len(used))
        i, j = place[i[kept]], place[j[kept]]
        uv = painted["at"][used]
        home, weights, _ = find(case.uv, case.faces, uv)
        triangles = case.vertex[case.faces[home]]
        number = np.unique(number[used], return_inverse=True)[1]
        base = (weights[..., None] * rest[triangles]).sum(1)
        middle = np.stack([np.bincount(number, base[:, k]) for k in range(3)], 1) / np.bincount(number)[:, None]
        radius = np.zeros(len(middle))
        np.maximum.at(radius, number, np.linalg.norm(base - middle[number], axis=1))
        heights = radius[number] / 2
        around = np.bincount(np.concatenate([i, j]), minlength=len(used))
        n = len(used)
        ring = np.stack([i, j], 1)
        edges = np.concatenate([ring, ring + n, np.stack([np.arange(n), np.arange(n) + n], 1)])
        top = base + heights[:, None] * smooth_normals(scene, rest, triangles, weights)
        points = np.concatenate([base, top])
        return cls(scene, uv, triangles, weights, heights, number, edges, around < 8, points)

    def lengths(self, points: np.ndarray) -> np.ndarray:
        return np.linalg.norm(points[self.edges[:, 0]] - points[self.edges[:, 1]], axis=1)

    def painted(self, pose: np.ndarray, displacement: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Places in a pose at which the base's paint is shown, and the length of a cell there."""
        scene = self.scene
        mesh, width = scene.mesh, scene.grid + 1
        at = self.uv + displacement[(self.uv[:, 1] * width + self.uv[:, 0]).astype(int)]
        case = mesh.case({}, pose, scene.rigidity, scene.movable, displacement)
        own = find(mesh.uv, mesh.faces, self.uv)[0]
        chart = case.chart[mesh.faces[:, 0]]
        home, weights, _ = find(mesh.uv, mesh.faces, at, chart, chart[own])
        corners = pose[mesh.vertex[mesh.faces[home]]]
        a, b, c = (mesh.uv[mesh.faces[home]][:, k] for k in range(3))
        flat = np.abs((b - a)[:, 0] * (c - a)[:, 1] - (b - a)[:, 1] * (c - a)[:, 0])
        area = np.linalg.norm(np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]), axis=1)
        return (weights[..., None] * corners).sum(1), np.sqrt(area / flat)

    def turned(self, before: np.ndarray, after: np.ndarray) -> tuple[list, list[Rotation]]:
        """Per stud, where the middle of its base is in the pose, and the rotation that fits all of its points best."""
        number, middles, found = np.tile(self.number, 2), [], []
        for k in range(self.number.max() + 1):
            rest, pose = before[number == k], after[number == k]
            middles.append(pose[: len(pose) // 2].mean(0))
            found.append(Rotation.align_vectors(pose - pose.mean(0), rest - rest.mean(0))[0])
        return middles, found


def smooth_normals(scene: Scene, positions, triangles, weights) -> np.ndarray:
    all = scene.mesh.corners[:, :, 0]
    a, b, c = (positions[all[:, k]] for k in range(3))
    of_face, normals = np.cross(b - a, c - a), np.zeros_like(positions)
    for k in range(3):
        np.add.at(normals, all[:, k], of_face)
    found = (weights[..., None] * normals[triangles]).sum(1)
    return found / np.linalg.norm(found, axis=1, keepdims=True)


class Barycentric:
    def __init__(self, studs: Studs):
        self.studs = studs

    def __call__(self, pose: np.ndarray) -> np.ndarray:
        studs = self.studs
        base = (studs.weights[..., None] * pose[studs.triangles]).sum(1)
        normals = smooth_normals(studs.scene, pose, studs.triangles, studs.weights)
        return np.concatenate([base, base + studs.heights[:, None] * normals])


class SurfaceDeform:
    def __init__(self, studs: Studs):
        import bpy

        bpy.ops.wm.read_factory_settings(use_empty=True)
        skin = bpy.data.meshes.new("skin")
        faces = studs.scene.mesh.corners[:, :, 0]
        skin.from_pydata(studs.scene.mesh.positions.tolist(), [], faces.tolist())
        detail = bpy.data.meshes.new("studs")
        detail.from_pydata(studs.rest.tolist(), studs.edges.tolist(), [])
        objects = [bpy.data.objects.new(data.name, data) for data in (skin, detail)]
        for one in objects:
            bpy.context.scene.collection.objects.link(one)
        self.skin, self.bound = objects
        modifier = self.bound.modifiers.new("deform", "SURFACE_DEFORM")
        modifier.target = self.skin
        with bpy.context.temp_override(object=self.bound, active_object=self.bound):
            bpy.ops.object.surfacedeform_bind(modifier=modifier.name)
        if not modifier.is_bound:
            raise RuntimeError("Surface Deform: could not be bound")
        self.graph = bpy.context.evaluated_depsgraph_get()

    def __call__(self, pose: np.ndarray) -> np.ndarray:
        self.skin.data.vertices.foreach_set("co", pose.astype(np.float32).ravel())
        self.skin.data.update()
        self.graph.update()
        found = self.bound.evaluated_get(self.graph).data.vertices
        points = np.empty(3 * len(found), np.float32)
        found.foreach_get("co", points)
        return points.reshape(-1, 3).astype(float)


class Vrtm:
    """Of the pose that was solved last."""

    def __init__(self, studs: Studs, fit: str):
        scene = studs.scene
        uv = studs.uv / scene.grid + [(scene.udim - 1001) % 10, (scene.udim - 1001) // 10]
        heights = np.concatenate([0 * studs.heights, studs.heights])
        self.carrier = scene.asset.carrier(np.tile(uv, (2, 1)), heights=heights, fit=fit)

    def __call__(self, pose: np.ndarray) -> np.ndarray:
        return self.carrier.fetch("positions", dtype=np.float64).positions


def rows(scene: Scene, pose: np.ndarray, exact=None) -> tuple[list[dict], str]:
    """`exact` gives the rotation of the closed form at positions in the pose."""
    studs, rest = Studs.of(scene), scene.mesh.positions
    bound = {
        "barycentric binding": Barycentric(studs),
        "Surface Deform, Blender": SurfaceDeform(studs),
        "vrtm, `surface`": Vrtm(studs, "surface"),
        "vrtm, `feature`": Vrtm(studs, "feature"),
    }
    scene.warp(rest)
    before = {name: method(rest) for name, method in bound.items()}
    seconds = []
    for _ in range(3):
        scene.asset.solve(rest.astype(np.float32), tiles=[scene.tile])
        start = time.process_time()
        scene.asset.solve(pose.astype(np.float32), tiles=[scene.tile])
        seconds.append(time.process_time() - start)
    place, cell = studs.painted(pose, scene.warp(pose))
    n, found = len(studs.uv), []
    for name, method in bound.items():
        method(rest)
        took = []
        for _ in range(5):
            start = time.process_time()
            points = method(pose)
            took.append(time.process_time() - start)
            method(rest)
        strain = np.abs(studs.lengths(points) / studs.lengths(before[name]) - 1)
        off = (np.linalg.norm(points[:n] - place, axis=1) / cell)[studs.rim]
        row = {"method": name, "rms": rms(strain), "p99": np.quantile(strain, 0.99), "max": strain.max()}
        row |= {"off": rms(off), "off99": np.quantile(off, 0.99), "farthest": off.max(), "ms": 1000 * np.median(took)}
        if exact:
            middles, turned = studs.turned(before[name], points)
            wrong = [exact(m).inv() * a for m, a in zip(middles, turned)]
            row["turned"] = np.degrees([a.magnitude() for a in wrong]).max()
            row["tilted"] = np.degrees([np.arccos(min(a.apply([0, 0, 1])[2], 1)) for a in wrong]).max()
        found.append(row)
        print(scene.name, {k: v if k == "method" else float(f"{v:.3g}") for k, v in row.items()}, flush=True)
    note = f"{studs.number.max() + 1} studs of {2 * n} points, {len(rest)} vertices; the solve takes "
    return found, note + f"{1000 * np.median(seconds):.0f} ms of CPU."


def rms(x: np.ndarray) -> float:
    return float(np.sqrt((x**2).mean()))


def stretched(u, v):
    """A plane, drawn out along x, more in its middle, and narrower: studs neither turn nor change."""
    return u + 0.6 * (u - np.sin(2 * np.pi * u) / (2 * np.pi)), 0.9 * v, 0 * u


def bent(u, v):
    """The same around a cylinder with a radius of 1."""
    angle = stretched(u, v)[0]
    return np.sin(angle), v, 1 - np.cos(angle)


FORMS = {
    "plane, stretched": (stretched, lambda at: Rotation.identity()),
    "plane, bent and stretched": (bent, lambda at: Rotation.from_euler("y", -np.arctan2(at[0], 1 - at[2]))),
}


def write(folder: Path, name: str, pose) -> None:
    """A sheet with round studs, as the folder of an asset."""
    line = np.linspace(0, 1, SIDE + 1)
    v, u = (x.ravel() for x in np.meshgrid(line, line, indexing="ij"))
    number = np.arange(len(u)).reshape(SIDE + 1, -1) + 1
    quads = np.stack([number[:-1, :-1], number[:-1, 1:], number[1:, 1:], number[1:, :-1]], -1).reshape(-1, 4)
    lines = [f"v {x:.9g} {y:.9g} 0" for x, y in zip(u, v)] + [f"vt {x:.9g} {y:.9g}" for x, y in zip(u, v)]
    lines += ["f " + " ".join(f"{k}/{k}" for k in quad) for quad in quads]
    (folder / "rest.obj").write_text("\n".join(lines) + "\n")
    np.stack(pose(u, v), -1).astype("<f4").tofile(folder / "frames.f32")
    y, x = (np.mgrid[:1024, :1024] + 0.5) / 1024 * STUDS % 1 - 0.5
    Image.fromarray(np.where(np.hypot(x, y) < 0.24, 255, 0).astype(np.uint8)).save(folder / "rigidity.1001.png")
    facts = {"name": name, "rigidity": {"1001": "rigidity.1001.png"}}
    (folder / "asset.json").write_text(json.dumps(facts))


def table(title: str, found: list[dict], note: str) -> str:
    head = "| method | length: RMS | 99 % | largest | off the rim: RMS | 99 % | largest | turned | tilted | ms |\n"
    head += "|---" * 10 + "|"
    lines = [f"## {title}\n", head]
    for row in found:
        cells = [row["method"], *(f"{row[k]:.2g}" for k in ("rms", "p99", "max"))]
        cells += [f"{row[k]:.2g}" for k in ("off", "off99", "farthest")]
        cells += [f"{row[k]:.2g}" if k in row else "-" for k in ("turned", "tilted")] + [f"{row['ms']:.1f}"]
        lines.append("| " + " | ".join(cells) + " |")
    return "\n".join(lines) + f"\n\n{note}\n"


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("folders", nargs="*", metavar="FOLDER:FRAME", help="assets; frames are numbered from 1")
    parser.add_argument("--grid", type=int, default=512, help="cells along each side (512)")
    parser.add_argument("--out", type=Path, default=Path(__file__).parents[1] / "results" / "carried.md")
    given = parser.parse_args()
    parts = [ABOUT]
    for name, (pose, exact) in FORMS.items():
        with tempfile.TemporaryDirectory() as folder:
            write(Path(folder), name, pose)
            scene = Scene(Path(folder), given.grid // 2)
        parts.append(table(name, *rows(scene, scene.pose(1), exact)))
    for argument in given.folders:
        folder, _, frame = argument.partition(":")
        scene = Scene(Path(folder), given.grid)
        title = f"{scene.name}, frame {frame}, tile {scene.udim}"
        parts.append(table(title, *rows(scene, scene.pose(int(frame or 1)))))
    given.out.write_text("\n".join(parts))


if __name__ == "__main__":
    main()
