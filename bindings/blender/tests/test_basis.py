"""Basis maps of `vrtm bake --basis` in a material: shape keys drive them, and Cycles looks up what the sum of the maps
is, computed here."""

import json
import os
import tempfile

import numpy as np

from support import bpy, mesh_object, nodes_of, sampled
from test_render import Scene, render

SIDE, MAPS = 16, 3
CONTROLS = ("smile", 'jaw "open"')
# Cycles looks up, as GPUs do, in single precision: UVs up to 2, in sums of a few terms.
NEAR = 4e-6


class Files:
    """A basis as `vrtm bake` writes it: maps (tiles, MAPS, SIDE, SIDE, 2), and poses of controls."""

    def __init__(self, folder, form="half", tiles=(1001,), poses=None):
        from vrtm.basis.controls import drive
        from vrtm.basis.stored import numbers, stored, values

        random = np.random.default_rng(3)
        maps = random.uniform(-0.1, 0.25, (MAPS, len(tiles) * SIDE * SIDE, 2)).astype(np.float32)
        found, ranges = stored(maps, form)
        codes = [numbers(one, of, form) for one, of in zip(found, ranges)]
        # As stored, in f64.
        self.maps = {
            udim: [
                values(code, of).astype(float).reshape(len(tiles), SIDE, SIDE, 2)[k] for code, of in zip(codes, ranges)
            ]
            for k, udim in enumerate(tiles)
        }
        self.path = os.path.join(folder, "basis.json")
        poses = np.array([(1.0, 0.0), (0.0, 0.5), (1.0, 1.0)]) if poses is None else np.array(poses, float)
        weights = random.uniform(-1, 1, (len(poses), MAPS))
        self.drive = drive(CONTROLS, poses, weights)
        ending = ".exr" if form == "half" else ".png"
        files = []
        for k, udim in enumerate(tiles):
            names = [f"basis.{number:04}.{udim}{ending}" for number in range(MAPS)]
            for name, code in zip(names, codes):
                write(os.path.join(folder, name), code.reshape(len(tiles), SIDE, SIDE, 2)[k])
            files.append({"udim": udim, "layer": 0, "size": [SIDE, SIDE], "maps": names})
        rows = [{"frame": frame, "weights": row.tolist()} for frame, row in enumerate(weights, 1)]
        self.document = {
            "maps": MAPS,
            "format": form,
            "ranges": [{"offset": of.offset.tolist(), "scale": of.scale.tolist()} for of in ranges],
            "driver": self.drive.document(),
            "frames": rows[::2],
            "held_out": rows[1::2],
            "files": files,
        }
        self.weights = weights
        self.save()

    def save(self):
        with open(self.path, "w") as file:
            json.dump(self.document, file)

    def redirected(self, uv, weights):
        """(..., 2): UV + sum of weights times maps."""
        total = uv.copy()
        for udim, maps in self.maps.items():
            place = np.array([(udim - 1001) % 10, (udim - 1001) // 10], float)
            here = (np.floor(uv - place) == 0).all(axis=-1) | (len(self.maps) == 1 and udim == 1001)
            for weight, one in zip(weights, maps):
                total += here[..., None] * weight * sampled(one, uv - place)
        return total


def write(path, numbers):
    """As OpenImageIO's writers do, which are not in each Blender: three channels, none of them alpha."""
    values = np.zeros((SIDE, SIDE, 4), np.float32)
    most = 1 if numbers.dtype.kind == "f" else np.iinfo(numbers.dtype).max
    values[..., :2], values[..., 3] = numbers.astype(float) / most, 1
    deep = numbers.dtype != np.uint8
    image = bpy.data.images.new("written", SIDE, SIDE, float_buffer=deep, is_data=True)
    image.pixels.foreach_set(values.ravel())
    scene = bpy.context.scene
    settings = scene.render.image_settings
    kept = settings.file_format, settings.color_depth, settings.color_mode
    settings.file_format = "PNG" if path.endswith(".png") else "OPEN_EXR"
    settings.color_mode, settings.color_depth = "RGB", "16" if deep else "8"
    image.save_render(path, scene=scene)
    settings.file_format, settings.color_depth, settings.color_mode = kept
    bpy.data.images.remove(image)


class Basis(Scene):
    def setUp(self):
        super().setUp()
        self.folder = self.scratch()

    def plane(self, wide=1, keys=CONTROLS):
        """A rectangle with UVs as its places; and the socket of what it shows."""
        corners = np.array([(0, 0, 0), (wide, 0, 0), (wide, 1, 0), (0, 1, 0)])
        obj = mesh_object("plane", corners, [(0, 1, 2, 3)], corners[:, :2])
        for name in ("Basis", *keys):
            obj.shape_key_add(name=name)
        self.camera((wide / 2, 0.5), wide)
        scene = bpy.context.scene
        scene.render.resolution_x, scene.render.resolution_y = 24 * wide, 24
        material, texture, shown = self.material(obj)
        return obj, material, texture, shown

    def looked_up(self, texture, shown):
        """The UVs at which Cycles looks the texture up: (height, width, 2)."""
        tree = texture.id_data
        tree.links.new(texture.inputs["Vector"].links[0].from_socket, shown)
        return render()[..., :2].astype(float)

    def compare(self, files, wide=1):
        """With several values of the controls; returns what was looked up last."""
        obj, material, texture, shown = self.plane(wide)
        tree = nodes_of(material)
        node = tree.nodes.new("ShaderNodeUVMap")
        tree.links.new(node.outputs["UV"], texture.inputs["Vector"])
        own = self.looked_up(texture, shown)
        tree.links.new(texture.outputs["Color"], shown)
        self.assertEqual(bpy.ops.vrtm.add_basis(filepath=files.path), {"FINISHED"})
        keys = obj.data.shape_keys.key_blocks
        for values in ((0.0, 0.0), (1.0, 0.0), (0.3, 0.8), (1.0, 1.0)):
            for name, value in zip(CONTROLS, values):
                keys[name].value = value
            found = self.looked_up(texture, shown)
            expected = files.redirected(own, files.drive(np.array([values]))[0])
            np.testing.assert_allclose(found, expected, atol=NEAR)
            if values == (0.0, 0.0):
                np.testing.assert_allclose(found, own, atol=NEAR)
        self.assertGreater(np.abs(found - own).max(), 0.02)
        return material

    def test_products_of_shape_keys_drive_maps_of_16_bit_floats(self):
        files = Files(self.folder)
        self.assertEqual(files.document["driver"]["form"], "products")
        self.compare(files)

    def test_integers_of_a_range(self):
        for form in ("unorm8", "unorm16"):
            with self.subTest(form), tempfile.TemporaryDirectory() as folder:
                bpy.ops.wm.read_homefile(use_factory_startup=True, use_empty=True)
                super().setUp()
                self.compare(Files(folder, form))

    def test_distances_of_many_poses_and_tiles_side_by_side(self):
        """An expression is not long enough for a weight of so many terms. A tile without maps stays as it is."""
        poses = np.random.default_rng(5).uniform(0, 1, (14, 2))
        files = Files(self.folder, tiles=(1001, 1003), poses=poses)
        self.assertEqual(files.document["driver"]["form"], "distances")
        material = self.compare(files, wide=3)
        (group,) = [node.node_tree for node in nodes_of(material).nodes if node.bl_idname == "ShaderNodeGroup"]
        drivers = [curve.driver for curve in group.animation_data.drivers]
        self.assertGreater(len(drivers), MAPS)
        # Blender evaluates these where scripts may not run, too.
        self.assertTrue(all(driver.is_simple_expression and len(driver.expression) < 256 for driver in drivers))

    def test_without_controls_weights_are_keyframes(self):
        files = Files(self.folder)
        files.document["driver"] = None
        files.save()
        _, material, _, _ = self.plane(keys=())
        self.assertEqual(bpy.ops.vrtm.add_basis(filepath=files.path), {"FINISHED"})
        (group,) = [node.node_tree for node in nodes_of(material).nodes if node.bl_idname == "ShaderNodeGroup"]
        for frame, weights in enumerate(files.weights, 1):
            bpy.context.scene.frame_set(frame)
            found = [group.nodes[f"weight {k}"].outputs[0].default_value for k in range(MAPS)]
            np.testing.assert_allclose(found, weights, rtol=1e-6)

    def test_given_again_it_takes_the_place_and_it_can_be_removed(self):
        files = Files(self.folder)
        _, material, texture, _ = self.plane()
        before = len(nodes_of(material).nodes)
        for _ in range(2):
            self.assertEqual(bpy.ops.vrtm.add_basis(filepath=files.path), {"FINISHED"})
            groups = [node for node in nodes_of(material).nodes if node.bl_idname == "ShaderNodeGroup"]
            self.assertEqual((len(groups), len(bpy.data.node_groups)), (1, 1))
        self.assertEqual(bpy.ops.vrtm.clear_material(), {"FINISHED"})
        self.assertEqual((len(nodes_of(material).nodes), len(bpy.data.node_groups)), (before, 0))
        self.assertFalse(texture.inputs["Vector"].is_linked)

    def test_what_is_wrong_is_told_and_nothing_is_changed(self):
        files = Files(self.folder)
        obj, material, _, _ = self.plane(keys=CONTROLS[:1])
        count = len(nodes_of(material).nodes)

        def refused(text):
            with self.assertRaisesRegex(RuntimeError, text):
                bpy.ops.vrtm.add_basis(filepath=files.path)
            self.assertEqual((len(nodes_of(material).nodes), len(bpy.data.node_groups)), (count, 0))

        refused("plane has no shape key 'jaw \"open\"', a control of basis.json")
        obj.shape_key_add(name=CONTROLS[1])
        os.rename(os.path.join(self.folder, "basis.0001.1001.exr"), os.path.join(self.folder, "away"))
        refused("basis.0001.1001.exr is missing, which basis.json names")
        os.rename(os.path.join(self.folder, "away"), os.path.join(self.folder, "basis.0001.1001.exr"))
        files.document["files"][0]["layer"] = 1
        files.save()
        refused("faces that share UVs, in layers")
        files.document["files"] = 3
        files.save()
        refused("is no basis.json of vrtm bake --basis")
