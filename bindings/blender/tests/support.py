"""Shared by the tests: Blender as a Python module with the installed extension, and a model, an arm that bends."""

from __future__ import annotations

import contextlib
import dataclasses
import functools
import os
import sys
import tempfile
import types
import unittest
from collections.abc import Iterator

import numpy as np
import pytest

bpy = pytest.importorskip("bpy", reason="skipped: bpy cannot be imported", exc_type=ImportError)
# The sample file's script lies beside this folder.
sys.path.append(os.path.dirname(os.path.dirname(os.path.abspath(__file__))))
from sample import add_key, add_mesh, add_texture, bones, node_of, nodes_of, rgba, tube  # noqa: E402

EXTENSION = "bl_ext.user_default.vrtm"
ICONS = set(bpy.types.UILayout.bl_rna.functions["prop"].parameters["icon"].enum_items.keys())
PANELS = ("main", "quality", "advanced", "strain", "material", "bake", "status", "view")
MENUS = ("rigidity", "begin", "object")


class Layout:
    """Takes what UILayout takes, as far as the panels use it, and writes down what would be shown."""

    def __init__(self, shown):
        self.shown = shown

    def _part(self, **options):
        return Layout(self.shown)

    row = column = box = _part

    def _icon(self, icon):
        if icon not in ICONS:
            raise ValueError(f"icon {icon}")

    def label(self, text="", icon="NONE"):
        self._icon(icon)
        self.shown.append(text)

    def prop(self, data, name, text=None, icon="NONE", toggle=-1, expand=False):
        self._icon(icon)
        self.shown.append(data.bl_rna.properties[name].name)

    def prop_search(self, data, name, other, collection, text=None):
        len(getattr(other, collection))
        self.prop(data, name)

    def separator(self):
        pass

    def template_icon(self, icon_value, scale):
        self.shown.append(icon_value)

    def menu(self, name, icon="NONE"):
        self._icon(icon)
        self.shown.append(getattr(bpy.types, name).bl_label)

    def template_ID(self, data, name, new="", open=""):
        for operator in (new, open):
            self.operator(operator)
        self.prop(data, name)

    def operator(self, name, text=None, icon="NONE", depress=False):
        self._icon(icon)
        module, function = name.split(".")
        rna = getattr(getattr(bpy.ops, module), function).get_rna_type()
        self.shown.append(text or rna.name)
        return types.SimpleNamespace(**{p.identifier: None for p in rna.properties})


def start() -> None:
    """An empty scene, with the extension as conftest.py installed it."""
    import addon_utils

    bpy.ops.wm.read_homefile(use_factory_startup=True, use_empty=True)
    if EXTENSION not in bpy.context.preferences.addons:
        if addon_utils.enable(EXTENSION, default_set=True) is None:
            raise RuntimeError(f"{EXTENSION} cannot be enabled: these checks are run by pytest, which installs it")


def part(name: str):
    """A module of the add-on."""
    return sys.modules[f"{EXTENSION}.{name}"]


def each(names: str, values):
    """As pytest.mark.parametrize, for a method of a Case: with each value it begins with an empty scene."""

    def decorated(test):
        @functools.wraps(test)
        def run(self, **others):
            for value in values:
                given = dict(zip(names.split(", "), value if ", " in names else [value], strict=True))
                with self.subTest(**given):
                    self.setUp()
                    test(self, **others, **given)

        return run

    return decorated


class Case(unittest.TestCase):
    """Each test begins with an empty scene, and leaves nothing of the live path behind."""

    def setUp(self) -> None:
        start()
        part("session").live_in_background = False

    def tearDown(self) -> None:
        part("session").live_in_background = False
        part("live").stop_timer()
        part("states").clear()

    def idle(self, frame: int | None = None) -> None:
        """Goes to this frame, has Blender hear of edits, and waits until nothing is wanted and no job is under way."""
        if frame is not None:
            bpy.context.scene.frame_set(frame)
        bpy.context.view_layer.update()
        states = part("states").known.values()
        poll_until(lambda: not any(state.wanted or state.doubted or state.job for state in states))

    def update(self, frame: int | None = None) -> None:
        """Update Now, at this frame."""
        if frame is not None:
            bpy.context.scene.frame_set(frame)
        self.assertEqual(bpy.ops.vrtm.update(), {"FINISHED"})

    def refused(self, words: str, operator=bpy.ops.vrtm.update, **options) -> None:
        """Checks that the operator is cancelled, and says `words`, a regular expression."""
        with self.assertRaisesRegex(RuntimeError, words):
            operator(**options)

    @contextlib.contextmanager
    def set(self, settings: bpy.types.PropertyGroup, **given) -> Iterator[None]:
        """Settings that are these until the end of the block."""
        before = {name: getattr(settings, name) for name in given}
        for name, value in given.items():
            setattr(settings, name, value)
        yield
        for name, value in before.items():
            setattr(settings, name, value)

    def headline(self, obj: bpy.types.Object) -> str:
        return self.line(obj)[0]

    def line(self, obj: bpy.types.Object) -> tuple[str, str]:
        """Text and icon of the headline."""
        return dataclasses.astuple(part("status").headline(obj, bpy.context.scene))

    def figures(self, obj: bpy.types.Object) -> dict[str, str]:
        return dict(part("states").find_state(obj).figures)

    def strains(self, obj: bpy.types.Object) -> tuple[float, float]:
        """Before and after, as the panel shows them."""
        return tuple(map(float, self.figures(obj)["Strain"].split()[::2]))

    def notes(self, obj: bpy.types.Object) -> str:
        return " ".join(line.text for line in part("status").notes(obj, bpy.context.scene))

    def shown(self, obj: bpy.types.Object, panels=PANELS, menus=MENUS) -> list[str]:
        """Content of the panels and menus, in a stand-in of Blender's layout. Drawing changes nothing."""
        shown, context = [], types.SimpleNamespace(object=obj, scene=bpy.context.scene)
        states = set(part("states").known)
        for name in panels:
            panel = getattr(bpy.types, f"VRTM_PT_{name}")
            self.assertTrue(panel.poll(context))
            panel.draw(types.SimpleNamespace(layout=Layout(shown)), context)
        for name in menus:
            getattr(bpy.types, f"VRTM_MT_{name}").draw(types.SimpleNamespace(layout=Layout(shown)), context)
        self.assertEqual(set(part("states").known), states)
        return shown

    def scratch(self) -> str:
        """A folder that the test's end removes."""
        return self.enterContext(tempfile.TemporaryDirectory())

    def reopened(self, folder: str | None = None, name: str = "arm") -> bpy.types.Object:
        """The object of this name, active, in the file that is saved and opened again."""
        path = os.path.join(folder or self.scratch(), "file.blend")
        bpy.ops.wm.save_as_mainfile(filepath=path)
        bpy.ops.wm.open_mainfile(filepath=path)
        obj = bpy.context.view_layer.objects.active = bpy.data.objects[name, None]
        return obj

    def bakes_to(self, folder: str, start: int, end: int) -> bpy.types.PropertyGroup:
        """The settings of bakes of these frames."""
        scene = bpy.context.scene
        scene.vrtm_bake.directory, scene.frame_start, scene.frame_end = folder, start, end
        return scene.vrtm_bake

    def check(self, arm: Arm, asset=None, pose: np.ndarray | None = None, obj: bpy.types.Object | None = None) -> float:
        """The object's result is that of the package's asset for the object's pose. Returns the farthest way."""
        obj, asset = obj or arm.object, asset or arm.asset()
        pose, settings = arm.pose(obj) if pose is None else pose, obj.vrtm
        report = asset.solve(pose, quality=settings.quality, scale=settings.scale)
        self.assertEqual(report.folds, 0)
        image, expected = pixels(obj.vrtm.image), arm.delta(asset)
        self.assertSame(np.ascontiguousarray(image[..., :2]), expected)
        self.assertEqual((image[..., 2].max(), image[..., 3].min()), (0, 1))
        self.assertSame(uv_layer(obj.data, obj.vrtm.uv_name), asset.corner_uvs())
        return np.abs(expected).max()

    def assertSame(self, one: np.ndarray, other: np.ndarray) -> None:
        """The same bits."""
        self.assertEqual((one.shape, one.dtype), (other.shape, other.dtype))
        self.assertEqual(one.tobytes(), other.tobytes(), f"they differ by {np.abs(one - other).max()} at most")


class Arm:
    """A tube along x from 0 to 2, bent by an armature at x = 0.8 and with a shape key that swells it; frames 1 to 5.

    One tile: u runs along the arm. Two tiles: the second begins at x = 1.
    """

    def __init__(self, name: str = "arm", tiles: int = 1, along: int = 40, around: int = 24, size: int = 128) -> None:
        self.tiles, self.size = tiles, size
        x, angle = np.linspace(0, 2, along + 1), np.linspace(0, 2 * np.pi, around + 1)[:-1]
        radius = 0.3 - 0.05 * x
        ring = np.stack([np.zeros_like(angle), np.cos(angle), np.sin(angle)], -1)
        points = ring[None] * radius[:, None, None]
        points[..., 0] = x[:, None]
        points = points.reshape(-1, 3).astype(np.float32)
        # The other way round than the sample's.
        faces, u, v = (of[:, [0, 3, 2, 1]] for of in tube(along, around))
        self.faces = faces.astype(np.uint32)
        self.uvs = np.stack([u * tiles, 0.04 + 0.92 * v], -1).reshape(-1, 2).astype(np.float32)
        self.object = add_mesh(name, points, self.faces, self.uvs)
        self.mesh = self.object.data
        self.mesh.shade_smooth()
        self.rig = bones(self.object, f"{name} rig", 0.8, 2, np.clip((points[:, 0] - 0.55) / 0.5, 0, 1), {1: 0, 5: 80})
        swollen = points.copy()
        swollen[:, 1:] *= 1 + 0.4 * np.exp(-(((points[:, :1] - 1.4) / 0.25) ** 2))
        add_key(self.object, "swell", swollen, 1, 5)
        bpy.context.view_layer.objects.active = self.object
        self.object.select_set(True)
        settings = self.object.vrtm
        settings.device, settings.grid, settings.render_grid = "cpu", size, size
        # UDIM numbers and what is painted on them.
        self.painted = {1001 + tile: studs(size, tile) for tile in range(tiles)}

    @classmethod
    def with_studs(cls, *given, live: bool = False, **options) -> Arm:
        """An arm whose rigidity is the image of its studs."""
        arm = cls(*given, **options)
        arm.paint_image()
        arm.object.vrtm.live = live
        return arm

    def paint_image(self, name: str = "rigidity") -> bpy.types.Image:
        """The first tile's studs as an image for all tiles, painted in memory only."""
        self.painted = dict.fromkeys(self.painted, self.painted[1001])
        return self.take(picture(name, self.painted[1001]))

    def paint_tiles(self, folder: str, name: str = "rigidity") -> bpy.types.Image:
        """The studs as a tiled image, from files."""
        image = tiled(folder, name, {udim: rgba(values) for udim, values in self.painted.items()})
        image.colorspace_settings.name = "Non-Color"
        return self.take(image)

    def take(self, image: bpy.types.Image) -> bpy.types.Image:
        """Has an image as the rigidity."""
        self.object.vrtm.rigidity_source, self.object.vrtm.rigidity_image = "IMAGE", image
        return image

    def repaint(self) -> None:
        """Writes what is painted on the first tile to the rigidity image, without telling Blender of it."""
        fill(self.object.vrtm.rigidity_image, self.painted[1001])

    def find(self, name: str = "arm") -> None:
        """Has its objects anew, after an undo or in another file."""
        self.object, self.rig = bpy.data.objects[name], bpy.data.objects[f"{name} rig"]
        self.mesh = self.object.data

    def add_material(self, name: str = "skin", albedo: bpy.types.Image | None = None) -> bpy.types.Node:
        """Gives the arm a material with a texture in its colour, whose node is returned."""
        material = bpy.data.materials.new(name)
        shader = node_of(nodes_of(material), "ShaderNodeBsdfPrincipled")
        self.mesh.materials.append(material)
        return add_texture(albedo or bpy.data.images.new("albedo", 128, 128), shader.inputs["Base Color"])

    def rest(self) -> np.ndarray:
        return np.array([vertex.co[:] for vertex in self.mesh.vertices], np.float32)

    def pose(self, obj: bpy.types.Object | None = None) -> np.ndarray:
        """The evaluated vertices, read in a plain loop."""
        return np.array([vertex.co[:] for vertex in evaluated(obj or self.object).data.vertices], np.float32)

    def asset(self, rest: np.ndarray | None = None, painted: bool = True):
        """The same by the Python package alone; `painted`: with the rigidity as the image of 8 bits has it."""
        painted = {udim: eight_bits(values) for udim, values in self.painted.items()} if painted else {}
        return asset_of(self.rest() if rest is None else rest, self.faces, self.uvs, self.size, painted)

    def delta(self, asset) -> np.ndarray:
        """The expected result image: the tiles side by side, (height, width, 2)."""
        return np.concatenate(
            [tile.fetch("redirection_delta", self.size, channels=2, origin="bottom") for tile in asset.tiles], 1
        )


def evaluated(obj: bpy.types.Object) -> bpy.types.Object:
    """As Blender draws it now."""
    return obj.evaluated_get(bpy.context.evaluated_depsgraph_get())


def asset_of(
    rest: np.ndarray, faces: np.ndarray, uvs: np.ndarray, size: int, painted: dict[int, np.ndarray], **options
):
    """By the Python package alone: quads with the UVs of their corners, cells per side of a tile, and the rigidity of
    each, if it is painted."""
    import vrtm

    counts = np.full(len(faces), 4)
    asset = vrtm.Asset(vrtm.Device("cpu"), rest, faces.ravel(), face_counts=counts, uvs=uvs, **options)
    for tile in [tile for tile in asset.tiles if tile.layer == 0]:
        tile.set_settings(grid_width=size, grid_height=size)
        if painted:
            tile.set_rigidity(painted[tile.udim], origin="bottom")
    return asset


def select(*objects: bpy.types.Object) -> None:
    """Selects these objects alone; the last one is the active one."""
    for obj in bpy.context.view_layer.objects:
        obj.select_set(obj in objects)
    bpy.context.view_layer.objects.active = objects[-1]


def tiled(folder: str, name: str, tiles: dict[int, np.ndarray]) -> bpy.types.Image:
    """A tiled image of 8 bits, from files."""
    for udim, values in tiles.items():
        one = picture(f"{name} {udim}", values)
        one.file_format = "PNG"
        one.save(filepath=os.path.join(folder, f"{name}.{udim}.png"))
        bpy.data.images.remove(one)
    image = bpy.data.images.load(os.path.join(folder, f"{name}.1001.png"))
    image.source, image.filepath = "TILED", os.path.join(folder, f"{name}.<UDIM>.png")
    return image


def fill(image: bpy.types.Image, values: np.ndarray) -> None:
    """Writes colours (height, width, 4), or greys (height, width), to an image in memory."""
    image.pixels.foreach_set((rgba(values) if values.ndim == 2 else values).ravel())


def picture(name: str, values: np.ndarray, **options) -> bpy.types.Image:
    """A new image with such values, in memory only."""
    image = bpy.data.images.new(name, *values.shape[1::-1], **options)
    fill(image, values)
    return image


def displace(obj: bpy.types.Object) -> None:
    """Puts an object anywhere, and makes it larger."""
    obj.scale, obj.location, obj.rotation_euler = (1.7, 1.7, 1.7), (0.3, -1, 2), (0.2, 0.1, 0.7)
    bpy.context.view_layer.update()


def quads(side: int) -> np.ndarray:
    """The vertices of the faces of a square lattice with so many faces per side, (side * side, 4)."""
    first = np.add.outer(np.arange(side) * (side + 1), np.arange(side)).ravel()
    return first[:, None] + [0, 1, side + 2, side + 1]


def bending(
    name: str, rest: np.ndarray, faces: np.ndarray, uvs: np.ndarray, moved: np.ndarray, rigidity: np.ndarray
) -> bpy.types.Object:
    """A mesh with UVs (corners, 2) and a rigidity image, which a shape key moves from frame 1 to frame 5; active."""
    obj = add_mesh(name, rest, faces, uvs)
    add_key(obj, "moved", moved, 1, 5)
    image = picture("rigidity", rigidity)
    image.pack()
    settings = obj.vrtm
    settings.device, settings.grid, settings.render_grid = "cpu", len(rigidity), len(rigidity)
    settings.rigidity_source, settings.rigidity_image = "IMAGE", image
    return obj


def sampled(image: np.ndarray, at: np.ndarray) -> np.ndarray:
    """Bilinear between texel centres, clamped: (height, width, 2) with the bottom row first, at (..., 2)."""
    height, width = image.shape[:2]
    x, y = at[..., 0] * width - 0.5, at[..., 1] * height - 0.5
    left, low = np.floor(x).astype(int), np.floor(y).astype(int)
    total = 0
    for right in (0, 1):
        for up in (0, 1):
            weight = np.abs(1 - right - (x - left)) * np.abs(1 - up - (y - low))
            column, row = (np.clip(v, 0, n - 1) for v, n in ((left + right, width), (low + up, height)))
            total = total + weight[..., None] * image[row, column]
    return total


def studs(size: int, tile: int = 0) -> np.ndarray:
    """Discs, (size, size) float32 with the bottom row first; softened over a texel."""
    at = (np.arange(size) + 0.5) / size
    u, v = np.meshgrid(at, at)
    value = np.zeros((size, size))
    for i in range(6):
        for j in range(4):
            x, y = (i + 0.5 + 0.15 * tile) / 6.2, (j + 0.5 + 0.25 * (i % 2)) / 4.5
            value = np.maximum(value, np.clip((0.055 - np.hypot(u - x, v - y)) * size + 0.5, 0, 1))
    return value.astype(np.float32)


def eight_bits(values: np.ndarray) -> np.ndarray:
    """As an image of 8 bits keeps them, and as Blender makes floats of them: times 1/255."""
    return np.floor(values * np.float32(255) + np.float32(0.5)).astype(np.float32) * np.float32(1 / 255)


def pixels(image: bpy.types.Image) -> np.ndarray:
    values = np.empty(len(image.pixels), np.float32)
    image.pixels.foreach_get(values)
    return values.reshape(image.size[1], image.size[0], -1)


def delta(obj: bpy.types.Object) -> np.ndarray:
    """The content of the object's result image, (height, width, 2)."""
    return np.ascontiguousarray(pixels(obj.vrtm.image)[..., :2])


def load(path: str) -> np.ndarray:
    """The pixels of a file, as data."""
    image = bpy.data.images.load(path)
    image.colorspace_settings.name = "Non-Color"
    found = pixels(image)
    bpy.data.images.remove(image)
    return found


def read(data, name: str, width: int, kind: type = np.float32) -> np.ndarray:
    """A property of all elements of a collection, (elements, width)."""
    values = np.empty(len(data) * width, kind)
    data.foreach_get(name, values)
    return values.reshape(-1, width)


def in_file(values: np.ndarray) -> np.ndarray:
    """A result's pixels as a saved file has them: as floats of 16 bits."""
    return values.astype(np.float16).astype(np.float32)


def uv_layer(mesh: bpy.types.Mesh, name: str) -> np.ndarray:
    return read(mesh.uv_layers[name].uv, "vector", 2)


def poll_until(condition, seconds: float = 300.0) -> None:
    """Calls the timer's function by hand, which nothing else does in background mode. The time is a guard alone."""
    import time

    end = time.monotonic() + seconds
    while not condition():
        if time.monotonic() > end:
            raise AssertionError("the live update did not come to an end")
        part("live").poll()
        time.sleep(0.002)
