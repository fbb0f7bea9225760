"""Makes docs/images/face.webp: a mouth opens with its own UVs, and a wipe goes from them to vrtm.

    python benches/paper/hero.py FACEXMODEL OUT.webp [FOLDER]     # a folder keeps what is rendered

FACEXMODEL is that folder of ICT-FaceKit (https://github.com/ICT-VGL/ICT-FaceKit, MIT). The face is painted here: studs,
brows and lips. Rings lie on the surface: what is as far from a stud's centre in the pose as its rim is at rest.
"""

import math
import pathlib
import sys
import tempfile

HERE = pathlib.Path(__file__).resolve().parent
sys.path[:0] = [str(HERE), str(HERE.parent / "peers"), str(HERE.parents[1] / "tests" / "renderers")]

import blender  # noqa: E402
import bpy  # noqa: E402
import numpy as np  # noqa: E402
import obj  # noqa: E402
import paint  # noqa: E402
import solve  # noqa: E402
import vrtm  # noqa: E402
import warp  # noqa: E402
from mathutils import Vector  # noqa: E402
from PIL import Image, ImageDraw, ImageFilter, ImageFont  # noqa: E402
from shapes import Model, smooth  # noqa: E402
from stage import upright  # noqa: E402

TEXTURE, GRID, MAP, DRAWN = 2048, 768, 1024, 4096
SIZE, SAMPLES = (800, 640), 5
RINGED = 24, 15, 7
# The shapes of the pose, and the first vertices, which are the face's.
POSE = {"jawOpen": 1.12, "mouthStretch": 0.35, "mouthUpperUp": 0.35, "noseSneer": 0.35, "browInnerUp": 0.5}
POSE |= {"browOuterUp": 0.3, "eyeWide": 0.6}
FACE = 9409
# Landmarks, as the kit's page lists them: the brows, and around the lips.
BROWS = (268, 493, 1914, 2044, 1401), (3615, 4240, 4114, 2734, 2509)
LIPS = 5708, 5695, 2081, 0, 4275, 6200, 6213, 6346, 6461, 5518, 5957, 5841
# What is drawn of the kit: materials of the file, and levels of subdivision.
PARTS = (("M_Face",), 2), (("M_BackHead",), 1), (("M_GumsTongue",), 1), (("M_Teeth",), 1)
PARTS += ((("M_IrisLeft", "M_IrisRight"), 2),)
HELD = 392  # where the wipe rests, between two rings
OPENED, CLOSED = (0.1, 0.25, 0.5, 0.75, 0.9), (0.8, 0.5, 0.15)


def load(folder):
    """Vertices, UVs, the polygons of each material as corners (vertex, UV), and the way to the pose."""
    vertices, uvs, _, _ = obj.read(folder / "generic_neutral_mesh.obj")
    polygons, move = {}, 0
    for line in (folder / "generic_neutral_mesh.obj").read_text().splitlines():
        kind, *words = line.split() or [""]
        if kind == "usemtl":
            of_this = polygons.setdefault(words[0], [])
        elif kind == "f":
            of_this.append([[int(i) - 1 for i in word.split("/")[:2]] for word in words])
    for name, weight in POSE.items():
        for path in sorted(folder.glob(f"{name}*.obj")):
            move = move + weight * (obj.read(path)[0] - vertices)
    return vertices, uvs, polygons, move


class Face:
    def __init__(self, kit, folder):
        self.folder = folder
        self.rest, self.uvs, self.polygons, self.move = load(kit)
        counts = np.array([len(polygon) for polygon in self.polygons["M_Face"]])
        corners = np.array([corner for polygon in self.polygons["M_Face"] for corner in polygon])
        used, uv_indices = np.unique(corners[:, 1], return_inverse=True)
        none = np.zeros((0, FACE, 3))
        self.model = Model("face", self.rest[:FACE], counts, corners[:, 0], self.uvs[used], uv_indices, none)
        self.uv_of = dict(corners.tolist())
        self.triangles, self.uv_triangles = self.model.triangles()
        self.paint()
        self.device, self.maps = vrtm.Device("cpu"), {}
        self.asset = solve.opened(self.device, self.model, GRID)
        self.asset.tile(1001).set_mask(self.mask.astype(np.float32))

    def pose(self, share):
        return self.rest + share * self.move

    def pixels(self, vertices):
        uv = self.uvs[[self.uv_of[i] for i in vertices]]
        return np.stack([uv[:, 0], 1 - uv[:, 1]], -1) * DRAWN

    def drawn(self):
        """Hairs of the brows, the lips, and the area of the brows, drawn in the UV plane."""
        random = np.random.default_rng(5)
        hair, lips, brows = (Image.new("L", (DRAWN, DRAWN)) for _ in range(3))
        lines, area = ImageDraw.Draw(hair), ImageDraw.Draw(brows)
        for vertices in BROWS:
            points = self.pixels(vertices)
            if abs(points[0, 0] - DRAWN / 2) > abs(points[-1, 0] - DRAWN / 2):
                points = points[::-1]  # from the nose outwards
            side = np.sign(points[-1, 0] - points[0, 0])
            curve = np.polyfit(np.linspace(0, 1, 5), points, 3)

            def at(t, curve=curve):
                return (np.array([t**3, t**2, t, 1]) @ curve) + np.array([0, 26])

            area.line([tuple(at(t)) for t in np.linspace(-0.05, 1.05, 30)], 255, 150, joint="curve")
            for t in random.uniform(-0.03, 1.0, 1900):
                half = 52 * (0.35 + 0.65 * smooth(1.0, 0.35, t)) * smooth(-0.08, 0.12, t)
                across = random.uniform(-1, 1)
                lean = np.radians(-78 + 62 * min(max(t * 1.5, 0), 1) + 25 * across + random.normal(0, 7))
                length = random.uniform(45, 85) * (1 - 0.3 * t)
                root = at(t) + np.array([0, across * half])
                bend = root + np.array([side * np.cos(lean), np.sin(lean)]) * length * 0.55
                tip = bend + np.array([side * np.cos(lean / 2), np.sin(lean / 2)]) * length * 0.45
                shade, width = int(random.uniform(110, 225)), int(random.integers(4, 7))
                lines.line([tuple(root), tuple(bend), tuple(tip)], shade, width, joint="curve")
        ImageDraw.Draw(lips).polygon([tuple(point) for point in self.pixels(LIPS)], 255)
        lips, brows = lips.filter(ImageFilter.GaussianBlur(14)), brows.filter(ImageFilter.GaussianBlur(20))
        small = [image.resize((TEXTURE, TEXTURE), Image.Resampling.LANCZOS) for image in (hair, lips, brows)]
        return [np.asarray(image, float) / 255 for image in small]

    def lids(self, points, near):
        """The distance of points to the face's border at the eyes, where they are near it."""
        ends = np.split(self.model.indices, np.cumsum(self.model.counts)[:-1])
        sides = np.stack([self.model.indices, np.concatenate([np.roll(polygon, -1) for polygon in ends])], -1)
        pairs, times = np.unique(np.sort(sides, 1), axis=0, return_counts=True)
        border = self.rest[np.unique(pairs[times == 1])]
        border = border[(border[:, 1] > 2) & (border[:, 1] < 5) & (border[:, 2] > 7)]
        found = np.full(len(points), 9.0)
        for chosen in np.array_split(np.flatnonzero(near), 40):
            found[chosen] = np.linalg.norm(points[chosen, None] - border, axis=2).min(1)
        return found

    def paint(self):
        """Textures into the folder; the rigidity, and a mask that keeps brows, eyes and lips."""
        surface = paint.Surface(self.model, 1001, TEXTURE)
        points = surface.points
        x, y, z = points.T
        hair, lips, brows = (image[surface.here] for image in self.drawn())
        eye = np.hypot((np.abs(x) - 3.15) / 2.15, (y - 3.45) / 1.35)
        mouth = np.hypot(x / 3.2, (y + 3.4) / 1.5)
        nose = (np.abs(x) < 1.75) & (y > -1.7) & (y < 3.5)
        free = surface.inner(40) & (z > 1.2) & (eye > 1) & (mouth > 1) & ~nose & (brows < 0.02)
        free = points[free & (x > 0.66) & (y < 3.2) & (y > -8.2)]
        large, their = paint.scattered(free[free[:, 1] < 1.0], [0.64, 0.52], 1.34, 3, tries=2500)
        small, sizes = paint.scattered(free, [0.38, 0.29], 1.34, 4, taken=list(zip(large, their)), tries=3000)
        half, sizes = np.concatenate([large, small]), np.concatenate([their, sizes])
        self.centres, self.radii = np.concatenate([half, half * [-1, 1, 1]]), np.concatenate([sizes, sizes])
        distance, number = paint.nearest(points, self.centres, self.radii, 1.6)
        grain, spots = paint.noise(points, 0.10, 2, 3), paint.noise(points, 3.0, 3, 4)
        cheeks = np.exp(-(((np.abs(x) - 4.6) / 2.6) ** 2 + ((y - 0.3) / 2.4) ** 2))
        cheeks += 0.8 * np.exp(-((x / 1.6) ** 2 + ((y - 0.6) / 1.8) ** 2))
        colour = paint.mixed([0.46, 0.235, 0.155], [0.60, 0.335, 0.235], np.clip(0.5 + 0.45 * spots, 0, 1))
        colour = paint.mixed(colour, [0.56, 0.20, 0.145], np.clip(0.42 * cheeks, 0, 1)) * (1 + 0.07 * grain)[:, None]
        colour = paint.mixed(colour, [0.34, 0.16, 0.12], 0.45 * np.clip(1.25 - eye, 0, 0.5))
        colour = paint.mixed(colour, [0.44, 0.115, 0.105], 0.8 * lips)
        line = np.clip(1.25 - self.lids(points, eye < 1.2) / 0.22, 0, 0.9) * np.where(y > 3.3, 1, 0.6)
        colour = paint.mixed(colour, [0.03, 0.015, 0.012], line)
        colour = paint.mixed(colour, [0.035, 0.018, 0.013], np.clip(1.25 * hair, 0, 0.96))
        inside, stone = paint.edge(distance, 1.0, 0.08), paint.edge(distance, 0.70, 0.06)
        groove = np.exp(-(((distance - 1.12) / 0.12) ** 2))
        colour = paint.mixed(colour * (1 - 0.5 * groove)[:, None], [0.93, 0.60, 0.20], inside)
        veins = np.clip(0.5 + 0.8 * paint.noise(points, 0.5, 9, 3), 0, 1)
        colour = paint.mixed(colour, paint.mixed([0.0, 0.16, 0.20], [0.01, 0.46, 0.46], veins), stone)
        colour = paint.mixed(colour, [0.10, 0.05, 0.02], 0.8 * np.exp(-(((distance - 0.72) / 0.045) ** 2)))
        collar = np.sqrt(np.clip(1 - ((distance - 0.86) / 0.17) ** 2, 0, 1)) * inside * (1 - stone)
        dome = stone * np.sqrt(np.clip(1 - (distance / 0.74) ** 2, 0, 1))
        height = np.append(self.radii, 0)[number] * (0.22 * collar + 0.20 * inside + 0.50 * dome) - 0.012 * groove
        height += (1 - inside) * (0.0045 * grain + 0.004 * lips * np.sin(70 * x) + 0.008 * hair)
        self.model.rigidity = {1001: surface.image(paint.edge(distance, 1.16, 0.12))}
        kept = np.maximum(brows, (eye < 0.95) | (mouth < 0.9))
        self.mask = surface.image(1 - np.clip(kept, 0, 1), around=1.0)
        kind = np.stack([inside * (1 - stone), stone, lips], -1)
        warp.write(self.folder / "colour.exr", surface.image(colour), half=True)
        warp.write(self.folder / "kind.exr", surface.image(kind), half=True)
        warp.write(self.folder / "height.exr", surface.image(height)[..., None], names=["Y"])

    def map(self, share):
        """The redirection of a pose, and its file."""
        if share not in self.maps:
            self.asset.solve(self.pose(share)[:FACE], quality="normal", measure=True)
            tile = self.asset.tile(1001)
            report, map = tile.report(), tile.fetch("redirection", MAP)[..., :2].astype(float)
            print(f"{share}: strain {report.before.rms:.3f} -> {report.after.rms:.3f}", flush=True)
            path = self.folder / f"map.{share:.3f}.exr"
            warp.write(path, np.concatenate([map, np.zeros_like(map[..., :1])], -1))
            self.maps[share] = path, map
        return self.maps[share]

    def place(self, number, share, redirected):
        """Where the centre of a stud is shown in a pose, and the surface's normal there."""
        centre = self.centres[number]
        nearest = np.argmin(np.linalg.norm(self.rest[self.triangles].mean(1) - centre, axis=1))
        a, b, c = self.rest[self.triangles[nearest]]
        s, t = np.linalg.lstsq(np.stack([b - a, c - a], -1), centre - a, rcond=None)[0]
        uv = np.array([1 - s - t, s, t]) @ self.model.uvs[self.uv_triangles[nearest]]
        if redirected:
            map = self.map(share)[1]
            y, x = np.unravel_index(np.argmin(((map - uv) ** 2).sum(-1)), map.shape[:2])
            slope = np.stack([map[y, x + 1] - map[y, x - 1], map[y + 1, x] - map[y - 1, x]], -1) / 2
            dx, dy = np.linalg.solve(slope, uv - map[y, x])
            uv = np.array([(x + 0.5 + dx) / MAP, 1 - (y + 0.5 + dy) / MAP])
        a, b, c = np.moveaxis(self.model.uvs[self.uv_triangles], 1, 0)
        with np.errstate(all="ignore"):
            weights = [np.cross(p - uv, q - uv) for p, q in ((b, c), (c, a), (a, b))]
            weights = np.stack(weights, -1) / np.cross(b - a, c - a)[:, None]
        one, corners = np.nanargmax(weights.min(-1)), self.pose(share)[self.triangles]
        at = weights[one] @ corners[one]
        normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
        normal = normals[np.linalg.norm(corners.mean(1) - at, axis=1) < 0.45].sum(0)
        return at, normal / np.linalg.norm(normal)


class Tree:
    """Nodes of a new material."""

    def __init__(self, name):
        self.material = bpy.data.materials.new(name)
        self.material.use_nodes = True
        self.tree = self.material.node_tree
        self.shader = self.tree.nodes["Principled BSDF"]
        self.out = self.tree.nodes["Material Output"]

    def new(self, kind, *inputs, **values):
        node = self.tree.nodes.new(f"ShaderNode{kind}")
        for name, value in values.items():
            setattr(node, name, value)
        for socket, value in zip(node.inputs, inputs):
            self.give(socket, value)
        return node

    def give(self, socket, value):
        if isinstance(value, bpy.types.NodeSocket):
            self.tree.links.new(value, socket)
        else:
            socket.default_value = value

    def math(self, operation, *inputs):
        return self.new("Math", *inputs, operation=operation).outputs[0]

    def set(self, **values):
        for name, value in values.items():
            self.give(self.shader.inputs[name.replace("_", " ").title()], value)


def plain(name, colour, roughness):
    tree = Tree(name)
    tree.set(base_color=(*colour, 1), roughness=roughness)
    return tree.material


def eyes():
    tree = Tree("eyes")
    at = tree.new("SeparateXYZ", tree.new("NewGeometry").outputs["Position"]).outputs
    across = tree.math("SUBTRACT", tree.math("ABSOLUTE", at[0]), 3.13)
    up = tree.math("SUBTRACT", at[2], 3.50)
    squares = tree.math("ADD", tree.math("MULTIPLY", across, across), tree.math("MULTIPLY", up, up))
    ramp = tree.new("ValToRGB", tree.math("SQRT", squares))
    stops = ramp.color_ramp.elements
    rings = (0.48, (0.10, 0.19, 0.13)), (0.61, (0.015, 0.03, 0.03)), (0.66, (0.72, 0.68, 0.63)), (1, (0.62, 0.5, 0.46))
    stops[0].position, stops[0].color = 0.25, (0.004, 0.004, 0.005, 1)
    stops[1].position, stops[1].color = 0.28, (0.16, 0.09, 0.02, 1)
    for place, colour in rings:
        stops.new(place).color = (*colour, 1)
    tree.set(base_color=ramp.outputs[0], roughness=0.08, coat_weight=1.0, coat_roughness=0.02)
    return tree.material


class Stage:
    def __init__(self, it):
        self.it = it
        with blender.quiet():
            bpy.ops.wm.read_factory_settings(use_empty=True)
        self.scene, self.meshes = bpy.context.scene, []
        materials = (
            self.skin(), plain("back", (0.50, 0.27, 0.18), 0.5), plain("gums", (0.42, 0.07, 0.07), 0.25),
            plain("teeth", (0.82, 0.76, 0.66), 0.22), eyes(),
        )  # fmt: skip
        for (names, levels), material in zip(PARTS, materials, strict=True):
            self.add(names, levels, material)
        self.light()

    def add(self, names, levels, material):
        polygons = [polygon for name in names for polygon in self.it.polygons[name]]
        corners = np.array([corner for polygon in polygons for corner in polygon])
        used, numbers = np.unique(corners[:, 0], return_inverse=True)
        ends = np.cumsum([len(polygon) for polygon in polygons])[:-1]
        mesh = bpy.data.meshes.new(names[0])
        mesh.from_pydata(upright(self.it.rest[used]).tolist(), [], [part.tolist() for part in np.split(numbers, ends)])
        layer = mesh.uv_layers.new(name="UVMap")
        layer.data.foreach_set("uv", self.it.uvs[corners[:, 1]].astype(np.float32).ravel())
        mesh.shade_smooth()
        mesh.materials.append(material)
        one = bpy.data.objects.new(names[0], mesh)
        self.scene.collection.objects.link(one)
        modifier = one.modifiers.new("finer", "SUBSURF")
        modifier.levels = modifier.render_levels = levels
        modifier.uv_smooth = "NONE"
        self.meshes.append((mesh, used))

    def skin(self):
        it, tree = self.it, Tree("skin")
        tree.material.displacement_method = "BOTH"
        uv = tree.new("UVMap", uv_map="UVMap").outputs[0]
        self.redirection = tree.new("TexImage", uv, extension="EXTEND")
        mix = tree.new("Mix", data_type="VECTOR")
        tree.give(mix.inputs[4], uv)
        tree.give(mix.inputs[5], self.redirection.outputs[0])
        self.share, looked_up = mix.inputs[0], mix.outputs[1]

        def texture(name, interpolation="Linear"):
            node = tree.new("TexImage", looked_up, extension="EXTEND", interpolation=interpolation)
            node.image = bpy.data.images.load(str(it.folder / f"{name}.exr"))
            node.image.colorspace_settings.name = "Non-Color"
            return node.outputs[0]

        metal, stone, lips = tree.new("SeparateColor", texture("kind")).outputs
        roughness = 0.48
        for kind, less in (metal, 0.26), (stone, 0.40), (lips, 0.14):
            roughness = tree.math("SUBTRACT", roughness, tree.math("MULTIPLY", kind, less))
        coat = tree.math("MULTIPLY", stone, 0.8)
        tree.set(base_color=texture("colour"), roughness=roughness, coat_weight=coat, coat_roughness=0.03)
        tree.set(metallic=tree.math("MULTIPLY", metal, 0.75))
        displaced = tree.new("Displacement", texture("height", "Cubic"), 0.0)
        tree.give(tree.out.inputs["Displacement"], displaced.outputs[0])
        shine = tree.new("Emission", (1, 1, 1, 1), 1.15).outputs[0]
        mixed = tree.new("MixShader", self.rings(tree), tree.shader.outputs[0], shine)
        tree.give(tree.out.inputs["Surface"], mixed.outputs[0])
        return tree.material

    def rings(self, tree):
        """1 on a ring around each place, along the plane of its normal."""
        position, found, self.places = tree.new("NewGeometry").outputs["Position"], 0.0, []
        for number in RINGED:
            radius = self.it.radii[number]
            offset = tree.new("VectorMath", position, operation="SUBTRACT")
            high = tree.new("VectorMath", offset.outputs[0], operation="DOT_PRODUCT")
            self.places.append((offset.inputs[1], high.inputs[1]))
            high = high.outputs["Value"]
            far = tree.new("VectorMath", offset.outputs[0], operation="LENGTH").outputs["Value"]
            square = tree.math("SUBTRACT", tree.math("MULTIPLY", far, far), tree.math("MULTIPLY", high, high))
            along = tree.math("SQRT", tree.math("MAXIMUM", square, 0.0))
            ring = tree.math("LESS_THAN", tree.math("ABSOLUTE", tree.math("SUBTRACT", along, 1.05 * radius)), 0.055)
            near = tree.math("LESS_THAN", tree.math("ABSOLUTE", high), 1.2 * radius)
            found = tree.math("MAXIMUM", found, tree.math("MULTIPLY", ring, near))
        return found

    def light(self):
        scene, target = self.scene, Vector(upright([1.2, -1.5, 8.0]))

        def put(data, turn, up, far):
            a, e = math.radians(40 + turn), math.radians(up)
            one = bpy.data.objects.new("one", data)
            way = upright([math.sin(a) * math.cos(e), math.sin(e), math.cos(a) * math.cos(e)])
            one.location = target + far * Vector(way)
            one.rotation_euler = (target - one.location).to_track_quat("-Z", "Y").to_euler()
            scene.collection.objects.link(one)
            return one

        camera = bpy.data.cameras.new("camera")
        camera.sensor_width, camera.lens = 36, 36 * 70 / 23
        scene.camera = put(camera, 0, -6, 70)
        for turn, up, far, energy, size, colour in (
            (-30, 40, 40, 17500, 16, (1, 0.95, 0.88)), (55, 8, 42, 7000, 24, (0.72, 0.86, 1)),
            (150, 35, 40, 16000, 14, (0.75, 0.88, 1)), (-150, 25, 40, 9000, 14, (1, 0.85, 0.7)),
        ):  # fmt: skip
            light = bpy.data.lights.new("light", "AREA")
            light.energy, light.size, light.color = energy, size, colour
            put(light, turn, up, far)
        scene.world = bpy.data.worlds.new("world")
        scene.world.use_nodes = True
        background = scene.world.node_tree.nodes["Background"]
        background.inputs[0].default_value, background.inputs[1].default_value = (0.55, 0.65, 0.8, 1), 0.5
        scene.render.engine, cycles = "CYCLES", scene.cycles
        cycles.samples, cycles.max_bounces, cycles.use_denoising, cycles.seed = SAMPLES, 3, True, 7
        cycles.adaptive_threshold, cycles.denoising_prefilter, cycles.denoising_quality = 0.04, "FAST", "BALANCED"
        scene.render.resolution_x, scene.render.resolution_y = SIZE
        scene.render.film_transparent = True
        scene.view_settings.view_transform, scene.view_settings.exposure = "AgX", 0.35
        scene.view_settings.look = "AgX - Medium High Contrast"
        scene.render.image_settings.file_format, scene.render.image_settings.color_mode = "PNG", "RGBA"

    def picture(self, share, redirected):
        path = self.it.folder / f"{share:.3f}.{'vrtm' if redirected else 'own'}.png"
        if not path.is_file():
            points = self.it.pose(share)
            for mesh, used in self.meshes:
                mesh.vertices.foreach_set("co", upright(points[used]).astype(np.float32).ravel())
                mesh.update()
            if redirected:
                self.redirection.image = bpy.data.images.load(str(self.it.map(share)[0]))
                self.redirection.image.colorspace_settings.name = "Non-Color"
            self.share.default_value = float(redirected)
            for number, sockets in zip(RINGED, self.places):
                for socket, value in zip(sockets, self.it.place(number, share, redirected)):
                    socket.default_value = upright(value)
            self.scene.render.filepath = str(path)
            with blender.quiet():
                bpy.ops.render.render(write_still=True)
        return Image.open(path).convert("RGBA")


class Film:
    """Frames of the film, with words and the border between both halves."""

    RED, GREEN, GREY, WHITE = (168, 44, 38), (30, 122, 84), (60, 66, 74), (255, 255, 255)

    def __init__(self, on):
        self.on, self.kept = on, {}
        self.large, self.small = ImageFont.load_default(30), ImageFont.load_default(22)
        width, height = SIZE
        y, x = np.mgrid[:height, :width] / [[[height]], [[width]]]
        shade = np.clip(np.hypot((x - 0.42) * 1.1, y - 0.42) / 0.9, 0, 1)[..., None]
        shown = np.array([74, 84, 96]) * (1 - shade) + np.array([24, 28, 34]) * shade
        shown += np.random.default_rng(0).uniform(-0.5, 0.5, shown.shape)
        self.back = Image.fromarray(np.rint(shown).astype(np.uint8)).convert("RGBA")

    def half(self, share, redirected):
        if (share, redirected) not in self.kept:
            whole = self.back.copy()
            whole.alpha_composite(self.on.picture(share, redirected))
            self.kept[share, redirected] = whole.convert("RGB")
        return self.kept[share, redirected]

    def word(self, draw, text, y, fill):
        left, top, end, bottom = draw.textbbox((30, y), text, self.large, anchor="lm")
        draw.rounded_rectangle((left - 14, top - 8, end + 14, bottom + 8), 10, fill=fill)
        draw.text((30, y), text, self.WHITE, self.large, anchor="lm")

    def frame(self, share, border):
        """vrtm is above the border, in pixels."""
        width, height = SIZE
        out = self.half(share, border == height).copy()
        draw = ImageDraw.Draw(out)
        if 0 < border < height:
            out.paste(self.half(share, True).crop((0, 0, width, border)), (0, 0))
            draw.line([(0, border), (width, border)], self.WHITE, 3)
            x = width - 34
            draw.ellipse((x - 15, border - 15, x + 15, border + 15), fill=self.WHITE)
            for side in (-1, 1):
                tip, foot = border + 10 * side, border + 3 * side
                draw.polygon([(x, tip), (x - 7, foot), (x + 7, foot)], fill=(40, 44, 50))
            if border > 64:
                self.word(draw, "with vrtm", min(border - 34, height - 82), self.GREEN)
            if border < height - 120:
                self.word(draw, "without", border + 36, self.RED)
        elif share == 0:
            self.word(draw, "at rest", 42, self.GREY)
        else:
            self.word(draw, *(("with vrtm", 42, self.GREEN) if border else ("without", 42, self.RED)))
        x, y = 34, height - 36
        draw.ellipse((x - 12, y - 12, x + 12, y + 12), outline=self.WHITE, width=4)
        draw.text((x + 24, y), "its size at rest", (236, 238, 240), self.small, anchor="lm")
        return out


def main(kit, out, folder=None):
    with tempfile.TemporaryDirectory() as made:
        folder = pathlib.Path(folder or made)
        folder.mkdir(parents=True, exist_ok=True)
        film, height = Film(Stage(Face(pathlib.Path(kit), folder))), SIZE[1]
        # Shares of the pose, the border, milliseconds.
        play = [(0, 0, 700), *((share, 0, 75) for share in OPENED), (1, 0, 900)]
        for low, high, count in (0, HELD, 14), (HELD, height, 10):
            play += [(1, round(low + (high - low) * smooth(0, count, k)), 70) for k in range(1, count)]
            play.append((1, high, 1500))
        play += [(share, height, 75) for share in CLOSED]
        frames, times = [film.frame(share, border) for share, border, _ in play], [time for *_, time in play]
    frames[0].save(out, save_all=True, append_images=frames[1:], duration=times, loop=0, quality=92, method=4)


if __name__ == "__main__":
    main(*sys.argv[1:])
