"""Baking to disk: files, their names and content, frames that are left as they were, and what goes wrong."""

import contextlib
import os
from unittest import mock

import numpy as np

from support import Arm, Case, bpy, each, load, part


class Bake(Case):
    def settings(self, start=2, end=4, step=2):
        """Bakes to a scratch folder, which is returned."""
        folder, bpy.context.scene.frame_step = self.scratch(), step
        self.bakes_to(folder, start, end)
        return folder

    def test_tiles_of_each_frame(self):
        arm = Arm.with_studs(tiles=2, live=True)
        scene = bpy.context.scene
        scene.frame_set(3)
        images = set(bpy.data.images.keys())
        folder = self.settings()
        self.assertEqual(bpy.ops.vrtm.bake(), {"FINISHED"})
        names = {f"arm.redirect.{part}.{frame:04d}.exr" for part in ("1001", "1002", "tiles") for frame in (2, 4)}
        self.assertEqual(set(os.listdir(folder)), names)
        # The scene is as it was, and so is what is shown.
        self.assertEqual(scene.frame_current, 3)
        self.check(arm)
        asset = arm.asset()
        for frame in (2, 4):
            scene.frame_set(frame)
            asset.solve(arm.pose())
            for tile in asset.tiles:
                found = load(os.path.join(folder, f"arm.redirect.{tile.udim}.{frame:04d}.exr"))
                expected = tile.fetch("redirection_delta", 128, channels=2, origin="bottom")
                self.assertSame(np.ascontiguousarray(found[..., :2]), expected)
            both = load(os.path.join(folder, f"arm.redirect.tiles.{frame:04d}.exr"))
            self.assertSame(np.ascontiguousarray(both[..., :2]), arm.delta(asset))
        self.assertEqual(set(bpy.data.images.keys()), images)
        self.assertFalse(part("session").baking)

    @each("hidden", (False, True))
    def test_the_pose_that_is_rendered(self, hidden):
        """A modifier that is on in renders alone is baked as it is rendered, also of an object that is hidden there."""
        arm = Arm.with_studs()
        arm.object.hide_render = hidden
        cast, folder, scene = arm.object.modifiers.new("cast", "CAST"), self.settings(4, 4), bpy.context.scene
        cast.factor = 0.4
        scene.frame_set(4)
        with_it = arm.pose()
        cast.show_viewport = False
        asset, engine, objects = arm.asset(), scene.render.engine, len(bpy.data.objects)
        asset.solve(with_it)
        self.assertEqual(bpy.ops.vrtm.bake(), {"FINISHED"})
        found = load(os.path.join(folder, "arm.redirect.1001.0004.exr"))
        self.assertSame(np.ascontiguousarray(found[..., :2]), arm.delta(asset))
        self.assertEqual((scene.render.engine, len(bpy.data.objects)), (engine, objects))
        self.assertEqual(arm.object.hide_render, hidden)
        self.assertIn("'cast' is on in renders and bakes alone, so the pose is another there", self.notes(arm.object))

    @each("failing", (None, "begin", "bake", "finish", "give_up"))
    def test_given_up_in_the_middle_or_failed(self, failing):
        """A bake is over whatever fails, its end included, and the next one runs."""
        arm, scene = Arm.with_studs(along=12, around=8, size=64), bpy.context.scene
        scene.frame_set(3)
        folder = self.settings(start=1, end=2, step=1)
        steps = part("bake").Bake(scene, [arm.object]).steps()
        self.assertEqual(next(steps)[0], 1)
        steps.close()
        self.assertEqual(os.listdir(folder), ["arm.redirect.1001.0001.exr"])
        self.assertEqual((scene.frame_current, part("session").baking), (3, False))
        if failing is not None:
            with contextlib.ExitStack() as defects:
                for name in {failing, "finish" if failing == "give_up" else failing}:
                    fails = mock.Mock(side_effect=RuntimeError("a defect"))
                    defects.enter_context(mock.patch.object(part("bake").Bake, name, fails))
                self.refused("a defect", bpy.ops.vrtm.bake)
            self.assertEqual((scene.frame_current, part("session").baking), (3, False))
        self.assertEqual(bpy.ops.vrtm.bake(), {"FINISHED"})

    def test_what_is_wrong_is_said(self):
        arm, folder, settings = Arm.with_studs(), self.settings(), bpy.context.scene.vrtm_bake
        file = os.path.join(folder, "file")
        with open(file, "w"):
            pass
        for directory, words in (("//", "never saved"), (os.path.join(file, "under"), "cannot be made")):
            with self.set(settings, directory=directory):
                self.refused(words, bpy.ops.vrtm.bake)
        arm.object.vrtm.rigidity_image = None
        self.refused("choose the rigidity image; 0 frames are written", bpy.ops.vrtm.bake)
        self.assertEqual(os.listdir(folder), ["file"])
        arm.object.vrtm.rigidity_source = "NONE"
        self.assertFalse(bpy.ops.vrtm.bake.poll())
