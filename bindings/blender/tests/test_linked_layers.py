"""Islands over islands of an overridden object whose mesh is linked: a modifier has the layers of faces, which the mesh
cannot keep."""

import os
from unittest import mock

import numpy as np

import test_layers
import test_linked
from support import bpy, evaluated, part, pixels
from test_render import render


class LinkedLayers(test_linked.LinkedCase):
    def stacked(self, arm):
        """Both halves of the arm on the same UVs."""
        arm.uvs[:, 1] = np.where(np.arange(len(arm.uvs)) // 4 % 24 < 12, arm.uvs[:, 1], arm.uvs[:, 1] - 0.46)
        arm.mesh.uv_layers[0].uv.foreach_set("vector", arm.uvs.ravel())

    def seen_layers(self, obj):
        """The layer of each face, as the material reads it."""
        found = evaluated(obj).data.attributes.get("vrtm_layer")
        if found is not None:
            self.assertEqual((found.domain, found.data_type), ("FACE", "INT"))
        return test_layers.attribute(evaluated(obj))

    def test_islands_over_islands_have_layers(self):
        obj, _ = self.character(self.stacked)
        settings = obj.vrtm
        self.assertEqual(bpy.ops.vrtm.set_up(), {"FINISHED"})
        rest = part("geometry").positions(obj.data)
        deltas, faces = self.expected(obj, rest, max_layers=32)
        faces = faces.astype(np.int32)

        def check(obj):
            self.assertSame(self.seen_layers(obj), faces)
            for image, delta in zip(part("layers").images_of(obj.vrtm.image), deltas, strict=True):
                self.assertLess(np.abs(pixels(image)[..., :2] - delta).max(), 1e-4)
            self.assertIn("Up to date", self.shown(obj))
            self.untouched(obj)

        self.assertEqual(sorted(set(faces)), [0, 1])
        check(obj)
        [node] = [n for n in next(iter(part("nodes").groups_of(obj))).nodes if n.bl_idname == "ShaderNodeAttribute"]
        self.assertEqual(node.attribute_name, "vrtm_layer")
        # It stands in front of what makes other faces, also if that was there before.
        settings.overlaps = "fixed"
        self.update()
        self.assertIsNone(self.seen_layers(obj))
        self.assertFalse([image.name for image in bpy.data.images if "layer" in image.name])
        obj.modifiers.new("it", "SUBSURF").levels = 1
        self.assertEqual(bpy.ops.vrtm.insert_tap(), {"FINISHED"})
        settings.overlaps = "each"
        self.update()
        self.assertSame(self.seen_layers(obj), np.repeat(faces, 4))
        self.assertIsNone(part("results").missing(obj))
        made = part("layer_nodes").GROUP.modifier_of(obj)
        for lose in (
            lambda: obj.modifiers.remove(made),
            lambda: bpy.data.images.remove(bpy.data.images["vrtm arm layers"]),
            lambda: obj.modifiers.move(0, len(obj.modifiers) - 1),
        ):
            lose()
            self.assertIn("tells layers apart is not there", part("results").missing(obj))
            self.update()
            self.assertIsNone(part("results").missing(obj))
            self.assertSame(self.seen_layers(obj), np.repeat(faces, 4))
            self.assertEqual(len([image for image in bpy.data.images if "layers" in image.name]), 1)
        for name in ("it", "vrtm pose"):
            obj.modifiers.remove(obj.modifiers[name])
        self.update()
        # As of many faces, in several rows.
        layer_nodes = part("layer_nodes")
        with mock.patch.object(layer_nodes, "WIDTH", 64):
            layer_nodes.insert(obj, "vrtm_layer", faces, layer_nodes.stamp_of(obj))
        self.assertSame(self.seen_layers(obj), faces)
        # Saved and opened, without a solve.
        settings.live = False
        obj = self.reopened(self.folder)
        self.assertSame(self.seen_layers(obj), faces)
        self.assertIsNone(part("results").missing(obj))
        self.update()
        check(obj)
        self.assertEqual(bpy.ops.vrtm.remove_all(), {"FINISHED"})
        self.assertIsNone(self.seen_layers(obj))
        self.assertFalse([image.name for image in bpy.data.images if image.name.startswith("vrtm")])
        self.assertFalse([tree.name for tree in bpy.data.node_groups if tree.get("vrtm_layers_group")])


class Pictures(test_layers.SheetsScene):
    def test_it_looks_as_a_local_object_does(self):
        folder = self.scratch()
        path, scene = os.path.join(folder, "character.blend"), bpy.context.scene
        self.sheets(by=None)
        bpy.ops.wm.save_as_mainfile(filepath=path)
        self.assertEqual(bpy.ops.vrtm.set_up_material(by="image"), {"FINISHED"})
        expected = render()
        self.setUp()
        self.camera((0, 0.6), 2.8)
        obj, scene = test_linked.overridden(path, "sheets"), bpy.context.scene
        self.assertEqual(bpy.ops.vrtm.set_up_material(by="image"), {"FINISHED"})
        self.assertLooksLike(render(), expected)
        # The frame that is rendered is the first to hear of a setting; the shape key is animated.
        obj.vrtm.live = False
        for overlaps, looks in (("fixed", False), ("each", True)):
            obj.vrtm.overlaps = overlaps
            scene.frame_set(3)
            scene.frame_set(5)
            (self.assertLooksLike if looks else self.assertDiffers)(render(), expected)
        scene.vrtm_bake.directory = os.path.join(folder, "baked")
        self.assertEqual(bpy.ops.vrtm.bake(), {"FINISHED"})
        self.assertEqual(bpy.ops.vrtm.use_baked(), {"FINISHED"})
        self.assertLooksLike(render(), expected)
        # With the layers the other way round it is another picture.
        obj.vrtm.in_renders = False
        part("layer_nodes").insert(obj, "vrtm_layer", test_layers.halves(1, 0), "")
        self.assertDiffers(render(), expected)
