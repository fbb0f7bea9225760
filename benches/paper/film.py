"""Makes docs/images/puffer.webp: a fish with round scales that breathes in, and a wipe from its own UVs to vrtm.

    python benches/paper/film.py OUT.webp [FOLDER]     # a folder keeps what is rendered, and goes on from there

Cycles draws the fish as it grows with its own UVs, and as it shrinks with the redirection; where it is largest both
pictures lie side by side, and the border between them moves. A closer view stands beside it, with rings of the size at
rest around three scales.
"""

import dataclasses
import pathlib
import sys
import tempfile

HERE = pathlib.Path(__file__).resolve().parent
sys.path[:0] = [str(HERE), str(HERE.parents[1] / "tests" / "renderers")]

import blender  # noqa: E402
import bpy  # noqa: E402
import numpy as np  # noqa: E402
import paint  # noqa: E402
import sheet  # noqa: E402
import solve  # noqa: E402
import stage  # noqa: E402
import warp  # noqa: E402
from bpy_extras.object_utils import world_to_camera_view  # noqa: E402
from mathutils import Vector  # noqa: E402
from PIL import Image, ImageDraw, ImageFont  # noqa: E402
from scenes import fish  # noqa: E402
from shapes import smooth  # noqa: E402

TEXTURE, GRID, SAMPLES = 2048, 512, 8
RATE, STEPS = 18, 24  # frames a second; poses from rest to the largest one
# Seconds: at rest, largest, the wipe, largest, at rest. Between them it breathes in, and out all at once.
PLAY = (0.7, 0.4, 2.8, 0.9, 0.4)
OUT = 22, 20, 18, 14, 10, 5
WIDTH, HEIGHT, CLOSE = 1280, 640, 400
FISH = stage.View((-0.08, -0.05, 0), 5.1, azimuth=20, elevation=9, size=(860, HEIGHT))
NEAR = stage.View((0, 0, 0), 1.15, azimuth=0, elevation=6, size=(CLOSE, CLOSE))
RINGED = 3
RADIUS = 0.098


def scales(model, size):
    """Domes all over the body, each round at rest, and eyes."""
    surface = paint.Surface(model, 1001, size)
    points, uv = surface.points, surface.uv
    skin = (uv[:, 0] < 0.685) | ((uv[:, 1] < 0.19) & (uv[:, 0] > 0.685))
    x, y, z = points.T
    up = y / np.maximum(np.hypot(y, z), 0.05)
    back = smooth(-0.5, 0.45, up + 0.1 * paint.noise(points, 0.5, 6))
    colour = paint.mixed([0.10, 0.30, 0.33], [0.012, 0.085, 0.13], back)
    colour *= (1 + 0.10 * paint.noise(points, 0.10, 2, 3))[:, None]
    fins = paint.mixed([0.75, 0.36, 0.06], [0.42, 0.14, 0.02], 0.5 + 0.5 * np.sin(110 * uv[:, 1]))
    colour[~skin] = fins[~skin]
    height = 0.003 * paint.noise(points, 0.05, 8, 2) * skin
    centres = fish.centres()
    distance, number = paint.nearest(points, centres, np.full(len(centres), RADIUS), 1.6)
    distance[~skin] = np.inf
    inside = paint.edge(distance, 1.0, 0.10)
    shade = np.append(np.random.default_rng(4).uniform(0.88, 1.08, len(centres)), 1)[number]
    bone = paint.mixed([0.95, 0.62, 0.16], [0.98, 0.80, 0.42], np.clip(1 - distance, 0, 1)) * shade[:, None]
    rim = np.exp(-(((distance - 1.1) / 0.10) ** 2))
    colour = paint.mixed(colour * (1 - 0.55 * rim)[:, None], bone, inside)
    height = height * (1 - inside) + 0.055 * np.sqrt(np.clip(1.03 - distance**2, 0, 1)) * inside - 0.008 * rim
    eye, _ = paint.nearest(points, np.array(fish.EYES), np.array([0.17, 0.17]), 1.5)
    eye[~skin] = np.inf
    for at, width, value in (
        (1.08, 0.06, [0.01, 0.03, 0.05]), (0.92, 0.05, [0.9, 0.88, 0.8]), (0.62, 0.05, [0.85, 0.30, 0.01]),
        (0.36, 0.05, [0.01, 0.01, 0.012]),
    ):  # fmt: skip
        colour = paint.mixed(colour, value, paint.edge(eye, at, width))
    for side in fish.EYES:
        shine = np.linalg.norm(points - side - [0.05, 0.06, 0.02], axis=1)
        colour = paint.mixed(colour, [1, 1, 1], paint.edge(shine, 0.035, 0.012) * skin)
    height = np.where(eye < 1.08, 0.09 * np.sqrt(np.clip(1 - (eye / 1.1) ** 2, 0, 1)), height)
    mouth = np.exp(-(((np.hypot(y, z) - 0.13) / 0.035) ** 2)) * (x > 1.2) * skin
    colour = paint.mixed(colour, [0.80, 0.32, 0.22], mouth)
    colour = paint.mixed(colour, [0.03, 0.01, 0.01], smooth(0.10, 0.05, np.hypot(y, z)) * (x > 1.2) * skin)
    rigid = np.maximum(paint.edge(distance, 1.12, 0.12), paint.edge(eye, 1.15, 0.08))
    model.rigidity = {1001: surface.image(rigid)}
    return paint.Paint({1001: surface.image(colour)}, {1001: surface.image(height + 0.05 * mouth)}, model.rigidity)


def bare(model):
    """Without the fins of its flanks, which hide what is to be seen."""
    owner = np.repeat(np.arange(len(model.counts)), model.counts)
    uvs = model.uvs[model.uv_indices]
    middle = np.stack([np.bincount(owner, uvs[:, k]) for k in (0, 1)], -1) / model.counts[:, None]
    kept = ~((middle[:, 0] > 0.7) & (middle[:, 1] > 0.59))
    model.indices, model.uv_indices = model.indices[kept[owner]], model.uv_indices[kept[owner]]
    model.counts = model.counts[kept]
    return model


class Fish:
    """The model, and its pictures, which are kept in a folder."""

    def __init__(self, folder):
        self.folder, self.model, self.maps = folder, bare(fish.build()), {}
        painted = scales(self.model, TEXTURE)
        painted.write(folder)
        self.vertices, self.uv_vertices = self.model.triangles()

    def pose(self, step):
        """From rest, 0, to the largest, STEPS."""
        x = step / STEPS
        return fish.pose(self.model.rest, x * x * x * (10 - 15 * x + 6 * x * x), 0.0)

    def map(self, step):
        """The redirection that the pictures of a step are drawn with."""
        path = self.folder / f"map.{step:03}.1001.exr"
        if not path.is_file():
            solved = solve.solved(self.model, self.pose(step), GRID)
            map = solved.maps[1001]
            warp.write(path, np.concatenate([map, np.zeros_like(map[..., :1])], -1))
            print(f"step {step}: strain {solved.before:.3f} -> {solved.after:.3f}", flush=True)
        if step not in self.maps:
            self.maps[step] = warp.read(path)[..., :2]
        return self.maps[step]

    def picture(self, step, redirected, close=False):
        """An image, sRGB with alpha."""
        name = f"{step:03}.{'vrtm' if redirected else 'own'}.{'close' if close else 'whole'}"
        path = self.folder / f"{name}.png"
        if not path.is_file():
            map = self.folder / f"map.{step:03}.<UDIM>.exr" if redirected else None
            if redirected:
                self.map(step)
            look = {"samples": SAMPLES, "subdivide": 0, "flat": True, "roughness": 0.32, "coat": 0.35}
            view = self.view(step, close)
            linear = stage.render(self.model, self.pose(step), view, self.folder, map, **look)
            alpha = np.clip(linear[..., 3:], 0, 1)
            colour = sheet.srgb(linear[..., :3] / np.maximum(alpha, 1e-3))
            Image.fromarray(np.rint(np.concatenate([colour, alpha], -1) * 255).astype(np.uint8)).save(path)
        return Image.open(path)

    def view(self, step, close):
        if not close:
            return FISH
        # It stays on the flank as that moves.
        target = np.mean([self.at(centre, self.pose(step))[0] for centre in self.ringed()], 0)
        return dataclasses.replace(NEAR, target=tuple(target))

    def ringed(self):
        """The UVs of scales' centres in the middle of the closer view."""
        rest = self.model.rest[self.vertices]
        centres = fish.centres()
        order = np.argsort(np.linalg.norm(centres - np.array([0.15, -0.05, 0.66]), axis=1))[:RINGED]
        found = []
        for centre in centres[order]:
            triangle = np.argmin(np.linalg.norm(rest.mean(1) - centre, axis=1))
            found.append(self.model.uvs[self.uv_vertices[triangle]].mean(0))
        return found

    def at(self, uv, points):
        """Place of a UV on the posed surface, and the surface's normal there."""
        corners = self.model.uvs[self.uv_vertices]
        a, b, c = corners[:, 0], corners[:, 1], corners[:, 2]
        area = np.cross(b - a, c - a)
        with np.errstate(all="ignore"):
            weights = np.stack([np.cross(b - uv, c - uv), np.cross(c - uv, a - uv), np.cross(a - uv, b - uv)], -1)
            weights = weights / area[:, None]
        one = np.nanargmax(weights.min(-1))
        triangle = points[self.vertices[one]]
        normal = np.cross(triangle[1] - triangle[0], triangle[2] - triangle[0])
        return weights[one] @ triangle, normal / np.linalg.norm(normal)

    def rings(self, step, redirected):
        """Outlines in pixels of the closer view, each as large as a scale at rest."""
        points = self.pose(step)
        with blender.quiet():
            bpy.ops.wm.read_factory_settings(use_empty=True)
        scene = bpy.context.scene
        scene.render.resolution_x = scene.render.resolution_y = CLOSE
        stage.camera_and_light(scene, self.view(step, True))
        bpy.context.view_layer.update()
        out = []
        for uv in self.ringed():
            if redirected:
                # The surface's UV at which the scale's centre is looked up.
                map = self.map(step)
                row, column = np.unravel_index(np.argmin(((map - uv) ** 2).sum(-1)), map.shape[:2])
                uv = np.array([(column + 0.5) / map.shape[1], 1 - (row + 0.5) / map.shape[0]])
            centre, normal = self.at(uv, points)
            one = np.cross(normal, [0, 1, 0])
            one /= np.linalg.norm(one)
            two, angle = np.cross(normal, one), np.linspace(0, 2 * np.pi, 65)[:, None]
            ring = centre + 1.06 * RADIUS * (np.cos(angle) * one + np.sin(angle) * two) + 0.03 * normal
            seen = [world_to_camera_view(scene, scene.camera, Vector(p)) for p in stage.upright(ring)]
            out.append([(p.x * CLOSE, (1 - p.y) * CLOSE) for p in seen])
        return out


def backdrop(size, low=(226, 230, 232), high=(250, 251, 252)):
    t = np.linspace(0, 1, size[1])[:, None, None]
    shown = np.array(high) + (np.array(low) - np.array(high)) * t
    return Image.fromarray(np.broadcast_to(np.rint(shown), (size[1], size[0], 3)).astype(np.uint8))


class Film:
    def __init__(self, it):
        self.it, self.kept = it, {}
        self.font, self.small = ImageFont.load_default(30), ImageFont.load_default(20)

    def parts(self, step, redirected):
        """The whole fish and the closer view with rings."""
        if (step, redirected) not in self.kept:
            whole = backdrop(FISH.size)
            picture = self.it.picture(step, redirected)
            whole.paste(picture, (0, 0), picture)
            close = backdrop((CLOSE, CLOSE))
            picture = self.it.picture(step, redirected, close=True)
            close.paste(picture, (0, 0), picture)
            large = close.resize((2 * CLOSE, 2 * CLOSE), Image.Resampling.LANCZOS)
            draw = ImageDraw.Draw(large)
            for ring in self.it.rings(step, redirected):
                draw.line([(2 * x, 2 * y) for x, y in ring], (225, 30, 40), 7, joint="curve")
            self.kept[step, redirected] = whole, large.resize((CLOSE, CLOSE), Image.Resampling.LANCZOS)
        return self.kept[step, redirected]

    def frame(self, step, share):
        """`share` of the picture, from the left, has the redirection."""
        out = backdrop((WIDTH, HEIGHT))
        halves = [self.parts(step, redirected) if wanted else None
                  for redirected, wanted in ((False, share < 1), (True, share > 0))]  # fmt: skip
        draw = ImageDraw.Draw(out)
        boxes = ((0, 0), FISH.size), ((FISH.size[0], 130), (CLOSE, CLOSE))
        for index, (place, size) in enumerate(boxes):
            cut = round(size[0] * share)
            for half, box in (halves[1], (0, 0, cut, size[1])), (halves[0], (cut, 0, size[0], size[1])):
                if half is not None and box[2] > box[0]:
                    out.paste(half[index].crop(box), (place[0] + box[0], place[1]))
            if 0 < cut < size[0]:
                draw.line([(place[0] + cut, place[1]), (place[0] + cut, place[1] + size[1])], (40, 44, 48), 3)
        left, top = FISH.size[0], 130
        draw.rectangle((left, top, left + CLOSE, top + CLOSE), outline=(40, 44, 48), width=3)
        below = (left + CLOSE / 2, top + CLOSE + 28)
        draw.text(below, "rings: the size at rest", (205, 30, 40), self.small, anchor="mm")
        if share in (0, 1):
            title = "at rest" if step == 0 else "vrtm" if share else "its own UVs"
            draw.text((FISH.size[0] / 2, 40), title, (30, 33, 36), self.font, anchor="mm")
        else:
            cut = FISH.size[0] * share
            if cut > 90:
                draw.text((cut - 16, 40), "vrtm", (30, 33, 36), self.font, anchor="rm")
            draw.text((cut + 16, 40), "its own UVs", (30, 33, 36), self.font, anchor="lm")
        return out

    def play(self):
        """The step and the share of each frame."""
        rest, before, wipe, after, end = (round(RATE * seconds) for seconds in PLAY)
        yield from [(0, 0)] * rest
        yield from ((step, 0) for step in range(1, STEPS + 1))
        yield from [(STEPS, 0)] * before
        yield from ((STEPS, (k + 1) / (wipe + 1)) for k in range(wipe))
        yield from [(STEPS, 1)] * after
        yield from ((step, 1) for step in OUT)
        yield from [(0, 0)] * end


def encode(frames, out):
    """One animated picture; equal frames are one that stays longer."""
    pictures, times = [], []
    for number, frame in enumerate(frames):
        picture = frame if not pictures or frame.tobytes() != pictures[-1].tobytes() else None
        if picture is None:
            times[-1] += 1000 // RATE
        else:
            pictures.append(picture)
            times.append(1000 // RATE)
    pictures[0].save(out, save_all=True, append_images=pictures[1:], duration=times, loop=0, quality=62, method=4)


def main(out, folder=None):
    with tempfile.TemporaryDirectory() as made:
        folder = pathlib.Path(folder or made)
        folder.mkdir(parents=True, exist_ok=True)
        film = Film(Fish(folder))
        encode((film.frame(step, share) for step, share in film.play()), out)


if __name__ == "__main__":
    main(*sys.argv[1:])
