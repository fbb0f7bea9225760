"""Makes docs/images/carried_*.webp: geometry on a skin, bound in three ways, while its paint is redirected.

    python benches/paper/carried.py head|fish|arm OUT.webp [FOLDER]     # a folder keeps what is rendered

Rivets on the face of the assets beside the checkout, spikes on a fish, scales on an arm. Left they are bound by
barycentric coordinates, in the middle by Surface Deform of Blender, and the paint, with a rim around each foot, has the
mesh's own UVs; right vrtm redirects the paint and carries the geometry.
"""

import os
import pathlib
import sys
import tempfile
from dataclasses import dataclass, field

HERE = pathlib.Path(__file__).resolve().parent
sys.path[:0] = [str(HERE), str(HERE.parent / "peers"), str(HERE.parents[1] / "tests" / "renderers")]

import blender  # noqa: E402
import bpy  # noqa: E402
import numpy as np  # noqa: E402
import paint  # noqa: E402
import sheet  # noqa: E402
import solve  # noqa: E402
import stage  # noqa: E402
import vrtm  # noqa: E402
import warp  # noqa: E402
from mathutils import Vector  # noqa: E402
from mathutils.bvhtree import BVHTree  # noqa: E402
from PIL import Image, ImageDraw, ImageFont  # noqa: E402
from scenes import arm, face, fish  # noqa: E402

SAMPLES, SIZE = 8, (400, 400)
METHODS = "barycentric binding", "Surface Deform", "vrtm"
PAINT = "own UVs", "own UVs", "redirected UVs"
STEPS = 10  # poses from rest to the largest one
AT_REST, A_STEP, LARGEST = 900, 95, 2600  # milliseconds


@dataclass
class Subject:
    """A model, what stands on it, and how it moves: `pose` takes a share of the way, 0 to 1."""

    model: object
    pose: object
    centres: np.ndarray
    radii: np.ndarray
    shape: tuple  # vertices of one piece with a radius of 1 (z up), and its polygons
    along: np.ndarray  # the direction in which a piece's x axis goes
    view: stage.View
    ground: list  # two colours of the skin
    rim: list
    piece: dict
    texture: int
    grid: int
    instances: bool = False
    rounded: bool = False
    colour: np.ndarray = field(init=False)
    here: np.ndarray = field(init=False)  # the texels that charts cover

    def __post_init__(self):
        surface = paint.Surface(self.model, 1001, self.texture)
        distance, _ = paint.nearest(surface.points, self.centres, self.radii, 1.9)
        grain = paint.noise(surface.points, self.radii.max() * 3, 3, 3)
        colour = paint.mixed(*self.ground, np.clip(0.5 + 0.5 * grain, 0, 1))
        self.here = surface.here
        rim = paint.edge(distance, 1.30, 0.06) * (1 - paint.edge(distance, 1.10, 0.06))
        colour = paint.mixed(colour, [0.02, 0.02, 0.02], paint.edge(distance, 1.06, 0.10))
        self.colour = surface.image(paint.mixed(colour, self.rim, rim))
        self.model.rigidity = {1001: surface.image(paint.edge(distance, 1.38, 0.08))}


def lathe(profile, around=28, outline=None):
    """Vertices and polygons of a piece: radius and height from the foot to the tip."""
    angle = 2 * np.pi * np.arange(around) / around
    wide = np.ones(around) if outline is None else outline(angle)
    rings = [np.stack([r * wide * np.cos(angle), r * wide * np.sin(angle), np.full(around, h)], -1) for r, h in profile]
    count = len(rings)
    quads = [
        [k * around + i, k * around + (i + 1) % around, (k + 1) * around + (i + 1) % around, (k + 1) * around + i]
        for k in range(count - 1)
        for i in range(around)
    ]
    return np.concatenate(rings), [*quads, [(count - 1) * around + i for i in range(around)]]


class Skin:
    """The mesh at rest, nearest points on it, and its smooth frames in a pose."""

    def __init__(self, model):
        self.faces, self.rest = model.triangles()[0], model.rest
        self.tree = BVHTree.FromPolygons(model.rest.tolist(), self.faces.tolist())

    def nearest(self, points):
        """Triangles and weights of their corners."""
        found = [self.tree.find_nearest(Vector(p)) for p in points]
        at, triangle = np.array([f[0] for f in found]), np.array([f[2] for f in found])
        a, b, c = np.moveaxis(self.rest[self.faces[triangle]], 1, 0)
        normal = np.cross(b - a, c - a)
        size = (normal * normal).sum(1)
        weights = [(np.cross(q - p, at - p) * normal).sum(1) / size for p, q in ((b, c), (c, a), (a, b))]
        return triangle, np.stack(weights, -1)

    def frames(self, pose, triangle, weights):
        """Places, and axes as columns: along the triangle's first side, across, and the smooth normal."""
        a, b, c = np.moveaxis(pose[self.faces], 1, 0)
        normals = np.zeros_like(pose)
        for k in range(3):
            np.add.at(normals, self.faces[:, k], np.cross(b - a, c - a))
        corners = self.faces[triangle]
        normal = unit((weights[..., None] * normals[corners]).sum(1))
        side = pose[corners[:, 1]] - pose[corners[:, 0]]
        side = unit(side - (side * normal).sum(1, keepdims=True) * normal)
        return (weights[..., None] * pose[corners]).sum(1), np.stack([side, np.cross(normal, side), normal], -1)


def unit(x):
    return x / np.linalg.norm(x, axis=-1, keepdims=True)


def matrices(quaternions):
    """Rotations (n, 3, 3) of quaternions x, y, z, w."""
    x, y, z, w = quaternions.T
    rows = [[1 - 2 * (y * y + z * z), 2 * (x * y - z * w), 2 * (x * z + y * w)],
            [2 * (x * y + z * w), 1 - 2 * (x * x + z * z), 2 * (y * z - x * w)],
            [2 * (x * z - y * w), 2 * (y * z + x * w), 1 - 2 * (x * x + y * y)]]  # fmt: skip
    return np.moveaxis(np.array(rows), -1, 0)


class Bound:
    """All pieces of a subject in one mesh, and where each way of binding takes it."""

    def __init__(self, it):
        self.it, self.skin = it, Skin(it.model)
        place, axes = self.skin.frames(it.model.rest, *self.skin.nearest(it.centres))
        normal = axes[..., 2]
        along = unit(it.along - (it.along * normal).sum(1, keepdims=True) * normal)
        frames = np.stack([along, np.cross(normal, along), normal], -1)
        local = it.shape[0][None] * it.radii[:, None, None]
        self.local, self.count = local, len(it.shape[0])
        self.rest = (place[:, None] + np.einsum("nij,nkj->nki", frames, local)).reshape(-1, 3)
        self.faces = [[k * self.count + v for v in face] for k in range(len(it.centres)) for face in it.shape[1]]
        self.triangle, self.weights = self.skin.nearest(self.rest)
        base, axes = self.skin.frames(it.model.rest, self.triangle, self.weights)
        self.offset = np.einsum("nji,nj->ni", axes, self.rest - base)
        self.device = vrtm.Device("cpu")
        self.asset = solve.opened(self.device, it.model, it.grid)
        if it.instances:
            self.carrier = self.asset.carrier(positions=place, frames=frames)
        else:
            pieces = np.repeat(np.arange(len(it.centres)), self.count)
            self.carrier = self.asset.carrier(positions=self.rest, pieces=pieces)
        self.deform = self.surface_deform()

    def surface_deform(self):
        with blender.quiet():
            bpy.ops.wm.read_factory_settings(use_empty=True)
        made, triangles = [], self.skin.faces.tolist()
        for name, points, faces in ("skin", self.skin.rest, triangles), ("pieces", self.rest, self.faces):
            data = bpy.data.meshes.new(name)
            data.from_pydata(points.tolist(), [], faces)
            made.append(bpy.data.objects.new(name, data))
            bpy.context.scene.collection.objects.link(made[-1])
        modifier = made[1].modifiers.new("deform", "SURFACE_DEFORM")
        modifier.target = made[0]
        with bpy.context.temp_override(object=made[1], active_object=made[1]), blender.quiet():
            bpy.ops.object.surfacedeform_bind(modifier=modifier.name)
        if not modifier.is_bound:
            raise RuntimeError("Surface Deform could not be bound")
        graph = bpy.context.evaluated_depsgraph_get()
        # All poses at once: the stage empties Blender.
        found = {}
        for step in range(STEPS + 1):
            made[0].data.vertices.foreach_set("co", self.pose(step).astype(np.float32).ravel())
            made[0].data.update()
            graph.update()
            points = np.empty(self.rest.size, np.float32)
            made[1].evaluated_get(graph).data.vertices.foreach_get("co", points)
            found[step] = points.reshape(-1, 3).astype(float)
        return found

    def strain(self, points):
        """The largest change of length of a side of the pieces' polygons."""
        ends = np.array([(face[k - 1], face[k]) for face in self.faces for k in range(len(face))])
        rest, now = (np.linalg.norm(np.diff(p[ends], axis=1), axis=-1) for p in (self.rest, points))
        return float(np.abs(now / rest - 1).max())

    def pose(self, step):
        x = step / STEPS
        return self.it.pose(x * x * x * (10 - 15 * x + 6 * x * x))

    def solved(self, step):
        """Paint and pieces by each way of binding: without vrtm the paint keeps its own UVs."""
        pose, it = self.pose(step), self.it
        self.asset.solve(pose)
        map = self.asset.tile(1001).fetch("redirection", it.texture)[it.here][:, :2].astype(float)
        colour = it.colour.copy()
        colour[it.here] = warp.bilinear(it.colour, map)
        base, axes = self.skin.frames(pose, self.triangle, self.weights)
        plain = base + np.einsum("nij,nj->ni", axes, self.offset)
        carried = self.carrier.fetch("positions", "rotations", dtype=np.float64)
        points = carried.positions
        if it.instances:
            turned = np.einsum("nij,nkj->nki", matrices(carried.rotations), self.local)
            points = (points[:, None] + turned).reshape(-1, 3)
        return (it.colour, plain), (it.colour, self.deform[step]), (colour, points)


class Stage:
    """Skin and pieces in Cycles."""

    def __init__(self, it, bound, folder):
        self.it, self.bound, self.folder = it, bound, folder

    def pictures(self, step):
        """One for each way of binding, sRGB with alpha."""
        paths = [self.folder / f"{step:03}.{k}.png" for k in range(3)]
        if not all(path.is_file() for path in paths):
            warp.write(self.folder / "height.1001.exr", np.zeros((4, 4, 1)), names=["Y"])
            for path, (colour, points) in zip(paths, self.bound.solved(step)):
                if path.is_file():
                    continue
                warp.write(self.folder / "colour.1001.exr", colour, half=True)
                linear = self.render(self.bound.pose(step), points)
                alpha = np.clip(linear[..., 3:], 0, 1)
                shown = sheet.srgb(linear[..., :3] / np.maximum(alpha, 1e-3))
                Image.fromarray(np.rint(np.concatenate([shown, alpha], -1) * 255).astype(np.uint8)).save(path)
        return [Image.open(path) for path in paths]

    def render(self, pose, points):
        it = self.it
        tree = stage.start(it.model, pose, it.view, SAMPLES, None, 2 * it.rounded, 1.0, it.rounded)
        stage.lit(tree, self.folder, None, roughness=0.6)
        cycles = bpy.context.scene.cycles
        cycles.denoising_prefilter, cycles.denoising_quality = "NONE", "FAST"
        data = bpy.data.meshes.new("pieces")
        data.from_pydata(stage.upright(points).tolist(), [], self.bound.faces)
        data.polygons.foreach_set("use_smooth", [True] * len(data.polygons))
        one = bpy.data.objects.new("pieces", data)
        bpy.context.scene.collection.objects.link(one)
        material = bpy.data.materials.new("piece")
        material.use_nodes = True
        for name, value in it.piece.items():
            material.node_tree.nodes["Principled BSDF"].inputs[name].default_value = value
        data.materials.append(material)
        return blender.render()


def bare(model):
    """Without the fins of its flanks, which hide what is to be seen."""
    owner = np.repeat(np.arange(len(model.counts)), model.counts)
    uvs = model.uvs[model.uv_indices]
    middle = np.stack([np.bincount(owner, uvs[:, k]) for k in (0, 1)], -1) / model.counts[:, None]
    kept = ~((middle[:, 0] > 0.7) & (middle[:, 1] > 0.59))
    model.indices, model.uv_indices = model.indices[kept[owner]], model.uv_indices[kept[owner]]
    model.counts = model.counts[kept]
    return model


def head(texture=2048, grid=512):
    model = face.load(pathlib.Path(os.environ.get("VRTM_ASSETS") or HERE.parents[2] / "shared" / "assets") / "mh_face")
    surface = paint.Surface(model, 1001, 1024)
    points, uv = surface.points, surface.uv
    inner = points[surface.inner(8) & (uv[:, 0] > 0.63) & (uv[:, 1] > 0.148)]
    x, y, z = inner.T
    lips, eyes = np.hypot(x / 0.40, (y - 6.22) / 0.13) < 1, np.hypot((np.abs(x) - 0.28) / 0.26, (y - 6.80) / 0.17) < 1
    free = inner[(z > 0.2) & ~lips & ~eyes & (y < 6.75)]
    centres, radii = paint.scattered(free, [0.070, 0.050], 1.75, 5, tries=4000)
    dome = [(1, -0.3), (1.02, 0.1), (0.95, 0.2), (0.82, 0.24), (0.72, 0.42), (0.5, 0.6), (0.25, 0.69), (0.06, 0.71)]
    move = model.frames[0] - model.rest
    return Subject(
        model, lambda share: model.rest + share * move, centres, radii, lathe(dome), np.array([0.0, 1, 0]),
        stage.View((0.20, 6.26, 1.3), 1.05, azimuth=30, elevation=2, size=SIZE),
        [[0.30, 0.135, 0.085], [0.46, 0.23, 0.15]], [0.85, 0.60, 0.05],
        {"Base Color": (0.55, 0.56, 0.60, 1), "Metallic": 1.0, "Roughness": 0.28}, texture, grid, rounded=True,
    )  # fmt: skip


def puffer(texture=2048, grid=512):
    model = bare(fish.build())
    centres = fish.centres()
    spike = [(1.0, -0.5), (1.0, 0.0), (0.80, 0.30), (0.52, 0.95), (0.28, 1.9), (0.10, 2.9), (0.02, 3.3)]
    return Subject(
        model, lambda share: fish.pose(model.rest, share, 0.0), centres, np.full(len(centres), 0.074),
        lathe(spike, 18), np.array([1.0, 0.1, 0.05]),
        stage.View((0.0, -0.06, 0.2), 3.2, azimuth=24, elevation=8, size=SIZE),
        [[0.03, 0.17, 0.24], [0.09, 0.33, 0.38]], [0.95, 0.45, 0.05],
        {"Base Color": (0.90, 0.84, 0.68, 1), "Roughness": 0.35}, texture, grid, instances=True,
    )  # fmt: skip


def sleeve(texture=2048, grid=512):
    model = arm.build()
    rows = []
    for k, x in enumerate(np.arange(-2.35, 2.4, 0.31)):
        count = round(2 * np.pi * arm.girth(x) / 0.34)
        angle = 2 * np.pi * (np.arange(count) + 0.5 * (k % 2)) / count
        at = np.stack([np.full(count, x), arm.girth(x) * np.sin(angle), -arm.girth(x) * np.cos(angle)], -1)
        rows.append(at[np.abs(np.angle(np.exp(1j * angle))) > 0.35])
    centres = np.concatenate(rows)
    plate = [(1.1, -0.25), (1.1, 0.1), (1.02, 0.2), (0.8, 0.27), (0.6, 0.32), (0.4, 0.44), (0.15, 0.5), (0.03, 0.51)]

    def leaf(angle):
        return 1 + 0.10 * np.maximum(np.cos(angle), 0) ** 3 - 0.06 * np.cos(4 * angle + np.pi)

    return Subject(
        model, lambda share: arm.pose(model.rest, share), centres, np.full(len(centres), 0.108),
        lathe(plate, 28, leaf), np.array([1.0, 0, 0]),
        stage.View((-0.05, 0.28, 0.0), 3.0, azimuth=0, elevation=4, size=SIZE),
        [[0.22, 0.10, 0.05], [0.33, 0.17, 0.09]], [0.10, 0.55, 0.75],
        {"Base Color": (0.72, 0.46, 0.16, 1), "Metallic": 1.0, "Roughness": 0.3}, texture, grid,
    )  # fmt: skip


SUBJECTS = {"head": head, "fish": puffer, "arm": sleeve}


def backdrop(size, low=(226, 230, 232), high=(250, 251, 252)):
    t = np.linspace(0, 1, size[1])[:, None, None]
    shown = np.array(high) + (np.array(low) - np.array(high)) * t
    return Image.fromarray(np.broadcast_to(np.rint(shown), (size[1], size[0], 3)).astype(np.uint8))


def frame(pictures):
    width, height = SIZE
    out = backdrop((3 * width + 8, height + 66))
    draw, font, small = ImageDraw.Draw(out), ImageFont.load_default(26), ImageFont.load_default(19)
    for k, picture in enumerate(pictures):
        left = k * (width + 4)
        out.paste(picture, (left, 66), picture)
        draw.text((left + width / 2, 20), METHODS[k], (30, 33, 36), font, anchor="mm")
        draw.text((left + width / 2, 49), PAINT[k], (95, 100, 105), small, anchor="mm")
    return out


def main(name, out, folder=None, only=None):
    with tempfile.TemporaryDirectory() as made:
        folder = pathlib.Path(folder or made)
        folder.mkdir(parents=True, exist_ok=True)
        it = SUBJECTS[name]()
        on = Stage(it, Bound(it), folder)
        if only:
            frame(on.pictures(int(only))).save(out)
            return
        frames = [frame(on.pictures(step)) for step in range(STEPS + 1)]
    play = [*range(STEPS + 1), *range(STEPS - 1, 0, -1)]
    times = [AT_REST if step == 0 else LARGEST if step == STEPS else A_STEP for step in play]
    shown = [frames[step] for step in play]
    shown[0].save(out, save_all=True, append_images=shown[1:], duration=times, loop=0, quality=84, method=4)


if __name__ == "__main__":
    main(*sys.argv[1:])
