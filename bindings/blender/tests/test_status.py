"""The panel tells the truth: of frames, rigid texels, baked files, and the library's warnings."""

import os
import types

import numpy as np

from support import Arm, Case, bpy, fill, part, picture


class Status(Case):
    def test_frames(self):
        part("session").live_in_background = True
        arm, scene = Arm(), bpy.context.scene
        settings = arm.object.vrtm

        def says(expected):
            self.idle()
            self.assertEqual(self.headline(arm.object), expected)

        for step, expected in (
            (lambda: None, "Nothing is rigid yet"),
            (arm.paint_image, "Not solved yet: press Update Now"),
            (lambda: self.update(3), "Up to date"),
            (lambda: scene.frame_set(4), "Out of date: shows frame 3"),
            (lambda: scene.frame_set(3), "Up to date"),
        ):
            step()
            says(expected)
        image = settings.rigidity_image
        for edit in (
            lambda: setattr(settings, "grid", 64),
            lambda: arm.rig.pose.bones["lower"].rotation_euler.__setitem__(2, 0.1),
            lambda: (fill(image, arm.painted[1001] * 0.5), image.update_tag()),
        ):
            edit()
            says("Out of date: press Update Now")
            self.update()
            says("Up to date")
        # What changes nothing that the result depends on.
        for edit in (
            lambda: part("handlers").undone(),
            lambda: setattr(arm.object, "show_name", True),
            lambda: setattr(settings, "in_renders", False),
            lambda: arm.mesh.update_tag(),
            lambda: setattr(settings, "live", True) or setattr(settings, "live", False),
        ):
            edit()
            says("Up to date")
        # What no update of the object's geometry tells of.
        key = arm.mesh.shape_keys.key_blocks["swell"]
        arm.mesh.shape_keys.animation_data_clear()
        key.driver_add("value").driver.expression = "0.77"
        says("Out of date: press Update Now")
        settings.live = True
        for frame in (1, 5):
            scene.frame_set(frame)
            says("Up to date")
        # A mesh that no frame changes is up to date at all of them.
        settings.live = False
        arm.rig.animation_data_clear()
        key.driver_remove("value")
        self.update()
        scene.frame_set(4)
        says("Up to date")
        settings.image = None
        says("Result is missing: see Status")

    def test_what_is_rigid(self):
        arm = Arm.with_studs()
        settings, state = arm.object.vrtm, part("states").state_of(arm.object)
        quarter, grey = np.zeros((128, 128), np.float32), np.ones((128, 128), np.float32)
        quarter[:, :32] = 1
        for values, rigid, note in (
            (0 * quarter, "0 %", "Nothing is rigid"),
            (grey, "100 %", "All is rigid"),
            (quarter, "25 %", ""),
            # Greys are weights, and neither nothing nor all.
            (0.25 * grey, "0 %", "0.25 at most"),
            (0.75 * grey, "100 %", "0.75 at least"),
        ):
            fill(settings.rigidity_image, values)
            self.update()
            self.assertEqual(self.figures(arm.object)["Rigid"], rigid)
            self.assertIn(note, self.notes(arm.object))
            self.assertEqual(bool(state.notes), bool(note))
            self.assertIn(f"{rigid} rigid", part("status").summary(arm.object))
        # After an error the figures of another map would be wrong.
        with self.set(settings, uv_map="nobody"):
            self.refused("nobody")
            self.assertEqual(part("status").summary(arm.object), "-")
        # An image with few texels.
        values = np.zeros((3, 7), np.float32)
        values[1, 3] = 1
        with self.set(settings, rigidity_image=picture("small", values)):
            self.update()
            # The charts are v from .04 to .96.
            share = float(self.figures(arm.object)["Rigid"].split()[0])
            self.assertAlmostEqual(share, 100 / 7 / 3 / 0.92, delta=0.3)
        # The wrong channel, and a group.
        settings.rigidity_channel = "A"
        self.update()
        self.assertIn("All is rigid", self.notes(arm.object))
        group = arm.object.vertex_groups.new(name="half")
        group.add(list(range(0, len(arm.mesh.vertices), 2)), 1.0, "REPLACE")
        settings.rigidity_source, settings.rigidity_name = "VERTEX_GROUP", "half"
        self.update()
        self.assertEqual(self.figures(arm.object)["Rigid"], "50 %")
        percent = part("outcome").percent
        words = {1e-6: "under 0.1 %", 0.012: "1.2 %", 0.5: "50 %", 0.996: "99.6 %", 0.99999: "over 99.9 %"}
        self.assertEqual({share: percent(share) for share in words}, words)

    def test_what_the_library_warns_of(self):
        arm = Arm.with_studs()
        arm.rig.animation_data_clear()
        arm.mesh.shape_keys.key_blocks["swell"].value = 0
        arm.rig.scale = (10, 10, 10)
        self.update()
        self.assertIn("times as long as at rest", self.notes(arm.object))
        arm.rig.scale = (1, 1, 1)
        self.update()
        self.assertNotIn("times as long", self.notes(arm.object))

    def test_baked_files(self):
        arm = Arm.with_studs()
        scene = bpy.context.scene
        scene.frame_start, scene.frame_end = 2, 4
        folder = self.scratch()
        bpy.ops.wm.save_as_mainfile(filepath=os.path.join(folder, "file.blend"))
        self.update()
        self.assertEqual(bpy.ops.vrtm.bake(), {"FINISHED"})
        names = sorted(os.listdir(os.path.join(folder, "vrtm")))
        self.assertEqual(names, [f"arm.redirect.1001.{frame:04d}.exr" for frame in (2, 3, 4)])
        # Compressed: differences of neighbours are small.
        size = os.path.getsize(os.path.join(folder, "vrtm", names[1]))
        self.assertLess(size, 0.6 * 128 * 128 * 16)
        self.assertEqual(bpy.ops.vrtm.use_baked(), {"FINISHED"})
        # Also those that are shown are baked again.
        self.assertEqual(bpy.ops.vrtm.bake(), {"FINISHED"})
        image = next(iter(part("nodes").baked_images()))
        self.assertEqual(image.filepath.replace("\\", "/"), "//vrtm/arm.redirect.1001.0002.exr")
        scene.frame_set(3)
        self.assertEqual(self.headline(arm.object), "Shows baked files")
        for frame, nearest in ((1, 2), (9, 4)):
            scene.frame_set(frame)
            self.assertEqual(self.headline(arm.object), "Frame is not baked: see Status")
            told = f"Frame {frame} is not in the baked files of frames 2 to 4: frame {nearest}"
            self.assertIn(told, self.notes(arm.object))
        # Files that are gone.
        scene.frame_set(3)
        os.remove(os.path.join(folder, "vrtm", names[1]))
        self.assertEqual(self.headline(arm.object), "Frame is not baked: see Status")
        self.assertIn(f"{names[1]} is not there", self.notes(arm.object))

    def test_lines_are_as_wide_as_the_panel(self):
        region = types.SimpleNamespace(width=300, type="WINDOW")
        context = types.SimpleNamespace(region=region, preferences=bpy.context.preferences)
        text, longest = "Nothing is rigid: the map is 0 everywhere. Is it the right image, channel or group?", []
        # Tabs take a part of a sidebar.
        for region.type in ("WINDOW", "UI"):
            lines = part("status")._wrapped(text, context)
            self.assertGreater(len(lines), 1)
            self.assertEqual(" ".join(lines), text)
            longest.append(max(map(len, lines)))
        self.assertGreater(*longest)
        context.region.width = 3000
        self.assertEqual(part("status")._wrapped(text, context), [text])
