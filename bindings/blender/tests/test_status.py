"""The panel tells the truth: of frames, rigid texels, baked files, and the library's warnings."""

import os
import types

import numpy as np

from support import Arm, Case, bpy, part, rgba


class Status(Case):
    def headline(self, arm):
        if part("session").live_in_background:
            self.idle()
        return super().headline(arm.object)

    def notes(self, arm):
        return super().notes(arm.object)

    def test_frames(self):
        part("session").live_in_background = True
        arm = Arm()
        self.assertEqual(self.headline(arm), "Nothing is rigid yet")
        image = arm.paint_image()
        self.assertEqual(self.headline(arm), "Not solved yet: press Update Now")
        scene, settings = bpy.context.scene, arm.object.vrtm
        scene.frame_set(3)
        bpy.ops.vrtm.update()
        self.assertEqual(self.headline(arm), "Up to date")
        scene.frame_set(4)
        self.assertEqual(self.headline(arm), "Out of date: shows frame 3")
        scene.frame_set(3)
        self.assertEqual(self.headline(arm), "Up to date")
        for edit in (
            lambda: setattr(settings, "grid", 64),
            lambda: arm.rig.pose.bones["lower"].rotation_euler.__setitem__(2, 0.1),
            lambda: (image.pixels.foreach_set(rgba(arm.painted[1001] * 0.5).ravel()), image.update_tag()),
        ):
            edit()
            bpy.context.view_layer.update()
            self.assertEqual(self.headline(arm), "Out of date: press Update Now")
            bpy.ops.vrtm.update()
            self.assertEqual(self.headline(arm), "Up to date")
        # What changes nothing that the result depends on.
        for edit in (
            lambda: part("handlers").undone(),
            lambda: setattr(arm.object, "show_name", True),
            lambda: setattr(settings, "in_renders", False),
            lambda: arm.mesh.update_tag(),
            lambda: setattr(settings, "live", True) or setattr(settings, "live", False),
        ):
            edit()
            bpy.context.view_layer.update()
            self.assertEqual(self.headline(arm), "Up to date")
        # What no update of the object's geometry tells of.
        key = arm.mesh.shape_keys.key_blocks["swell"]
        arm.mesh.shape_keys.animation_data_clear()
        key.driver_add("value").driver.expression = "0.77"
        bpy.context.view_layer.update()
        self.assertEqual(self.headline(arm), "Out of date: press Update Now")
        # An undo that takes what was written back.
        bpy.ops.vrtm.update()
        arm.mesh.uv_layers["vrtm"].uv[0].vector = (0, 0)
        part("handlers").undone()
        self.assertEqual(self.headline(arm), "Out of date: press Update Now")
        settings.live = True
        for frame in (1, 5):
            scene.frame_set(frame)
            self.idle()
            self.assertEqual(self.headline(arm), "Up to date")
        arm.object.vrtm.image = None
        self.assertEqual(self.headline(arm), "Result is missing: see Status")

    def test_a_mesh_that_no_frame_changes_is_up_to_date_at_all(self):
        part("session").live_in_background = True
        arm = Arm.with_studs()
        arm.rig.animation_data_clear()
        arm.mesh.shape_keys.animation_data_clear()
        bpy.ops.vrtm.update()
        bpy.context.scene.frame_set(4)
        self.assertEqual(self.headline(arm), "Up to date")

    def test_what_is_rigid(self):
        arm = Arm()
        image, state = arm.paint_image(), part("states").state_of(arm.object)
        quarter = np.repeat(np.float32([[1, 0, 0, 0]]), 32, 1).repeat(128, 0)
        for values, rigid, note in (
            (0 * quarter, "0 %", "Nothing is rigid"),
            (0 * quarter + 1, "100 %", "All is rigid"),
            (quarter, "25 %", ""),
        ):
            image.pixels.foreach_set(rgba(values).ravel())
            bpy.ops.vrtm.update()
            self.assertEqual(dict(state.figures)["Rigid"], rigid)
            self.assertIn(note, self.notes(arm))
            self.assertEqual(bool(state.notes), bool(note))
            self.assertIn(f"{rigid} rigid", part("status").summary(arm.object))
        # Greys are weights, and neither nothing nor all.
        for value, note in ((0.25, "0.25 at most"), (0.75, "0.75 at least")):
            image.pixels.foreach_set(rgba(np.full((128, 128), value, np.float32)).ravel())
            bpy.ops.vrtm.update()
            self.assertIn(note, self.notes(arm))
        # After an error the figures of another map would be wrong.
        name, arm.object.vrtm.uv_map = arm.object.vrtm.uv_map, "nobody"
        with self.assertRaises(RuntimeError):
            bpy.ops.vrtm.update()
        self.assertEqual(part("status").summary(arm.object), "-")
        arm.object.vrtm.uv_map = name
        # An image with few texels.
        small = bpy.data.images.new("small", 7, 3)
        values = np.zeros((3, 7), np.float32)
        values[1, 3] = 1
        small.pixels.foreach_set(rgba(values).ravel())
        arm.object.vrtm.rigidity_image = small
        bpy.ops.vrtm.update()
        # The charts are v from .04 to .96.
        share = float(dict(state.figures)["Rigid"].split()[0])
        self.assertAlmostEqual(share, 100 / 7 / 3 / 0.92, delta=0.3)
        arm.object.vrtm.rigidity_image = image
        # The wrong channel, and a group.
        arm.object.vrtm.rigidity_channel = "A"
        bpy.ops.vrtm.update()
        self.assertIn("All is rigid", self.notes(arm))
        group = arm.object.vertex_groups.new(name="half")
        group.add(list(range(0, len(arm.mesh.vertices), 2)), 1.0, "REPLACE")
        arm.object.vrtm.rigidity_source, arm.object.vrtm.rigidity_name = "VERTEX_GROUP", "half"
        bpy.ops.vrtm.update()
        self.assertEqual(dict(state.figures)["Rigid"], "50 %")
        percent = part("outcome").percent
        words = {1e-6: "under 0.1 %", 0.012: "1.2 %", 0.5: "50 %", 0.996: "99.6 %", 0.99999: "over 99.9 %"}
        self.assertEqual({share: percent(share) for share in words}, words)

    def test_what_the_library_warns_of(self):
        arm = Arm.with_studs()
        arm.rig.animation_data_clear()
        arm.mesh.shape_keys.key_blocks["swell"].value = 0
        arm.rig.scale = (10, 10, 10)
        bpy.ops.vrtm.update()
        self.assertIn("times as long as at rest", self.notes(arm))
        arm.rig.scale = (1, 1, 1)
        bpy.ops.vrtm.update()
        self.assertNotIn("times as long", self.notes(arm))

    def test_baked_files(self):
        arm = Arm.with_studs()
        scene = bpy.context.scene
        scene.frame_start, scene.frame_end = 2, 4
        folder = self.scratch()
        bpy.ops.wm.save_as_mainfile(filepath=os.path.join(folder, "file.blend"))
        arm.object = bpy.data.objects["arm"]
        bpy.context.view_layer.objects.active = arm.object
        bpy.ops.vrtm.update()
        self.assertEqual(bpy.ops.vrtm.bake(), {"FINISHED"})
        names = sorted(os.listdir(os.path.join(folder, "vrtm")))
        self.assertEqual(names, [f"arm.redirect.1001.{frame:04d}.exr" for frame in (2, 3, 4)])
        # Compressed: differences of neighbours are small.
        size = os.path.getsize(os.path.join(folder, "vrtm", names[1]))
        self.assertLess(size, 0.6 * 128 * 128 * 16)
        self.assertEqual(bpy.ops.vrtm.use_baked(), {"FINISHED"})
        image = next(iter(part("nodes").baked_images()))
        self.assertEqual(image.filepath.replace("\\", "/"), "//vrtm/arm.redirect.1001.0002.exr")
        scene.frame_set(3)
        self.assertEqual(self.headline(arm), "Shows baked files")
        for frame, nearest in ((1, 2), (9, 4)):
            scene.frame_set(frame)
            self.assertEqual(self.headline(arm), "Frame is not baked: see Status")
            told = f"Frame {frame} is not in the baked files of frames 2 to 4: frame {nearest}"
            self.assertIn(told, self.notes(arm))
        # Files that are gone.
        scene.frame_set(3)
        os.remove(os.path.join(folder, "vrtm", names[1]))
        self.assertEqual(self.headline(arm), "Frame is not baked: see Status")
        self.assertIn(f"{names[1]} is not there", self.notes(arm))

    def test_lines_are_as_wide_as_the_panel(self):
        context = types.SimpleNamespace(region=types.SimpleNamespace(width=300), preferences=bpy.context.preferences)
        text = "Nothing is rigid: the map is 0 everywhere. Is it the right image, channel or group?"
        lines = part("status")._wrapped(text, context)
        self.assertGreater(len(lines), 1)
        self.assertEqual(" ".join(lines), text)
        context.region.width = 3000
        self.assertEqual(part("status")._wrapped(text, context), [text])

    def test_gaps_are_told_in_an_artists_words(self):
        prepared = part("prepared").Prepared()
        entry = part("session").library().LogEntry
        said = entry("warning", "nodes_at_gaps", 1001, 0, 0, (318.0,), "in other words")
        for _ in range(2):
            [told] = prepared.notes([said])
            self.assertTrue(told.startswith("Tile 1001: 318 points do not move, where UV edges nearly touch"), told)
