"""Results of the add-on against the Python package, bit for bit: frames, sources of rigidity and masks, rest shapes,
tiles, settings."""

import os
from unittest import mock

import numpy as np

from support import Arm, Case, bpy, part, pixels, rgba


class Solve(Case):
    def test_two_tiles_painted_in_files_and_in_memory(self):
        arm = Arm(tiles=2)
        folder = self.scratch()
        image = arm.paint_tiles(folder)
        self.update(5)
        self.check(arm)
        # A stroke on the first tile that is not saved; the second tile is read as well.
        arm.painted[1001] = arm.painted[1001] * 0
        arm.painted[1001][20:60, 20:100] = 0.6
        arm.repaint()
        self.assertTrue(image.is_dirty)
        names = set(bpy.data.images.keys())
        self.update()
        self.check(arm)
        path = os.path.join(folder, "rigidity.<UDIM>.png")
        self.assertEqual((image.is_dirty, image.file_format, image.filepath), (True, "PNG", path))
        self.assertEqual(set(bpy.data.images.keys()), names)
        self.assertEqual(sorted(os.listdir(folder)), ["rigidity.1001.png", "rigidity.1002.png"])

    def test_unsaved_tiles_of_floats(self):
        """Tiles that were never saved, with numbers that 8 bits cannot hold."""
        image = bpy.data.images.new("floats", 16, 16, float_buffer=True, tiled=True, is_data=True)
        values = np.random.default_rng(0).uniform(-1, 2, (16, 16, 4)).astype(np.float32)
        values[..., 3] = 1
        image.pixels.foreach_set(values.ravel())
        image.tiles.new(1002)
        image.tiles.active_index = 1
        window = bpy.context.window_manager.windows[0]
        area = window.screen.areas[0]
        kind, area.type = area.type, "IMAGE_EDITOR"
        area.spaces[0].image = image
        colour = (0.123456, 1.5, 0, 1)
        with bpy.context.temp_override(window=window, area=area, region=area.regions[-1]):
            bpy.ops.image.tile_fill(color=colour, width=8, height=4, float=True)
        area.type = kind
        for _ in range(2):
            found = part("maps").read_image(image)
            self.assertEqual(sorted(found), [1001, 1002])
            self.assertSame(found[1001], values)
            self.assertSame(found[1002], np.broadcast_to(np.float32(colour), (4, 8, 4)).copy())
            self.assertEqual((image.is_dirty, image.filepath, len(image.tiles)), (True, "", 2))

    def test_vertex_group_attribute_and_mask(self):
        arm = Arm()
        obj, number = arm.object, len(arm.mesh.vertices)
        weights = (np.arange(number) % 7 < 2).astype(np.float32)
        group = obj.vertex_groups.new(name="stiff")
        group.add(np.flatnonzero(weights).tolist(), 1.0, "REPLACE")
        colours = arm.mesh.attributes.new("colour", "FLOAT_COLOR", "CORNER")
        by_corner = weights[arm.faces.ravel()]
        colours.data.foreach_set("color", rgba(by_corner).ravel())
        mask = (arm.rest()[:, 0] < 1.2).astype(np.float32)
        arm.mesh.attributes.new("mask", "FLOAT", "POINT").data.foreach_set("value", mask)
        bpy.context.scene.frame_set(5)
        asset = arm.asset(painted=False)
        asset.set_vertex_rigidity(weights)
        settings = obj.vrtm
        # An image that was there before leaves nothing behind.
        arm.paint_image()
        self.update()
        self.check(arm)
        for source, name in (("VERTEX_GROUP", "stiff"), ("ATTRIBUTE", "colour")):
            settings.rigidity_source, settings.rigidity_name = source, name
            self.update()
            self.assertGreater(self.check(arm, asset), 0)
        settings.mask_source, settings.mask_name = "ATTRIBUTE", "mask"
        self.update()
        before = pixels(settings.image).copy()
        asset.set_vertex_mask(mask)
        self.check(arm, asset)
        settings.mask_source = "NONE"
        self.update()
        self.assertFalse(np.array_equal(before, pixels(settings.image)))

    def test_rest_shapes(self):
        arm = Arm.with_studs()
        scene, settings = bpy.context.scene, arm.object.vrtm
        scene.frame_set(3)
        third = arm.pose()
        key = np.array([point.co[:] for point in arm.mesh.shape_keys.key_blocks["swell"].data], np.float32)
        scene.frame_set(5)
        settings.rest_source, settings.rest_key = "SHAPE_KEY", "swell"
        self.update()
        self.check(arm, arm.asset(key))
        scene.frame_set(3)
        bpy.ops.vrtm.capture_rest()
        self.update(5)
        self.check(arm, arm.asset(third))
        self.update(3)
        self.assertEqual(np.abs(pixels(settings.image)[..., :2]).max(), 0)
        # Captured at another pose, one without keys.
        settings.rest_source = "MESH"
        arm.rig.pose.bones["lower"].rotation_euler[2] = 0.3
        bpy.context.view_layer.update()
        bpy.ops.vrtm.capture_rest()
        captured = arm.pose()
        self.assertEqual(settings.rest_source, "CAPTURED")
        self.update(5)
        self.check(arm, arm.asset(captured))

    def test_map_size_quality_and_figures(self):
        arm = Arm.with_studs()
        settings = arm.object.vrtm
        settings.map_size, settings.quality, settings.measure = 64, "draft", True
        self.update(5)
        asset = arm.asset()
        asset.solve(arm.pose(), quality="draft", measure=True)
        delta = asset.tiles[0].fetch("redirection_delta", 64, channels=2, origin="bottom")
        self.assertSame(np.ascontiguousarray(pixels(settings.image)[..., :2]), delta)
        figures = self.figures(arm.object)
        strain = asset.tiles[0].report()
        self.assertLess(strain.after.rms, 0.5 * strain.before.rms)
        edges, fixed = strain.segments + strain.segments_fixed, strain.segments_fixed * strain.strain_fixed**2
        before, after = (
            ((strain.segments * rms**2 + fixed) / edges) ** 0.5 for rms in (strain.before.rms, strain.after.rms)
        )
        self.assertEqual(figures["Strain"], f"{before:.3f} before, {after:.3f} after")
        self.assertEqual(figures["Folds"], "0")

    def test_what_is_advanced(self):
        arm = Arm.with_studs(size=64)
        settings, asset = arm.object.vrtm, arm.asset()
        bpy.context.scene.frame_set(5)
        for given, of in (
            ({"harm": 0}, {"harm": 0}),
            ({"calm": 1}, {"smoothness": 0.08}),
            ({"calm": -1}, {"smoothness": 0.005}),
            ({"keep_direction": 0.5}, {"orientation_density": 0.5}),
            ({"room": 2}, {"room": 2}),
            ({"scale": "follow"}, {}),
            # The defaults are the library's.
            ({}, {}),
            ({"seams": "keep"}, {"seams": "keep"}),
            ({"open_borders": "slide"}, {"open_borders": "slide"}),
            ({"seams": "continue", "seam_reach": 0.05}, {"seams": "continue", "seam_reach": 0.05}),
        ):
            with self.subTest(given):
                with self.set(settings, **given):
                    self.update()
                    [tile] = asset.tiles
                    tile.set_settings(grid_width=arm.size, grid_height=arm.size, **of)
                    self.check(arm, asset)
        # What it does not go with: said in words, and Auto knows.
        settings.keep_direction, settings.seams = 0.2, "continue"
        self.refused("Keep Direction does not go with seams that continue")
        settings.seams = "auto"
        self.update()

    def test_a_stroke_of_a_brush(self):
        arm = Arm.with_studs()
        self.update(5)
        asset = arm.asset()
        self.check(arm, asset)
        state = part("states").find_state(arm.object)
        kept = state.asset
        tile = type(kept.tiles[0])
        with mock.patch.object(tile, "update_rigidity", autospec=True, side_effect=tile.update_rigidity) as update:
            arm.painted[1001][30:50, 60:70] = 1
            arm.painted[1001][55, 64] = 0.5
            arm.repaint()
            self.update()
        # The rectangle that has changed, and the same result as that of a map which is set as a whole.
        [call] = update.call_args_list
        self.assertLessEqual(call.args[4:6], (10, 26))
        self.assertIs(state.asset, kept)
        self.check(arm)
