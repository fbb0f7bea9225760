"""Seams and Open Borders that are left to Auto: what they come to, what is kept of it, and what is said."""

import numpy as np

import test_dilate
from support import Case, add_mesh, bpy, delta, each, part, select


class Borders(Case):
    scene, image = test_dilate.Dilate.arm, test_dilate.Dilate.image

    def arm(self, dilated=True):
        arm = self.scene()
        arm.object.vrtm.property_unset("seams")
        # A stud on the seam, besides.
        self.dot(arm, (0.4, 0.04))
        bpy.ops.vrtm.set_up_material()
        if dilated:
            bpy.ops.vrtm.dilate()
        return arm

    def dot(self, arm, *centres):
        """Paints discs, too."""
        at = (np.arange(arm.size) + 0.5) / arm.size
        for u, v in centres:
            arm.painted[1001][np.hypot(at[None] - u, at[:, None] - v) < 0.04] = 1
        arm.repaint()

    def solved(self, arm, **settings):
        asset = arm.asset()
        for tile in asset.tiles:
            tile.set_settings(tile.settings, seam_reach=arm.object.vrtm.seam_reach, **settings)
        asset.solve(arm.pose(), measure=True)
        return asset

    def check_solved(self, arm, **settings):
        self.update()
        self.assertSame(delta(arm.object), arm.delta(self.solved(arm, **settings)))

    def test_dilated_textures_go_on(self):
        arm = self.arm()
        settings = arm.object.vrtm
        self.assertEqual((settings.seams, settings.open_borders), ("auto", "auto"))
        said = "Seams continue, open borders slide: all textures are dilated"
        self.assertIn(said, self.shown(arm.object))
        self.check_solved(arm, seams="continue", open_borders="slide")
        # It is saved with the file.
        self.assertEqual(part("borders").chosen(self.reopened()).why, said)

    def test_features_on_seams_are_counted_and_continue(self):
        arm = self.arm(dilated=False)
        settings = arm.object.vrtm
        settings.seams = "shut"
        said = "1 feature on seams, which do not continue: set Seams to Auto, and press Dilate Textures"
        self.update()
        self.assertIn(said, self.shown(arm.object))
        # More of them, of which two touch the other side of the seam alone, and what is elsewhere.
        self.dot(arm, (0.1, 0.04), (0.55, 0.96), (0.9, 0.97), (0.7, 0.5))
        self.update()
        self.assertIn(said.replace("1 feature", "4 features"), self.shown(arm.object))
        settings.seams = "auto"
        self.assertEqual(bpy.ops.vrtm.dilate(), {"FINISHED"})
        self.assertEqual(part("borders").chosen(arm.object).seams, "continue")
        self.check_solved(arm, seams="continue", open_borders="slide")
        self.assertFalse([text for text in self.shown(arm.object) if "on seams" in text])

    @each(
        "given, expected",
        (
            ({"seams": "shut"}, ("shut", "fixed")),
            ({"seams": "continue"}, ("continue", "fixed")),
            ({"open_borders": "fixed"}, ("continue", "fixed")),
            ({"seams": "keep", "open_borders": "slide"}, ("keep", "slide")),
        ),
    )
    def test_what_is_set_by_hand_is_obeyed(self, given, expected):
        arm = self.arm(dilated=False)
        for name, value in given.items():
            setattr(arm.object.vrtm, name, value)
        bpy.ops.vrtm.dilate()
        found = part("borders").chosen(arm.object)
        self.assertEqual((found.seams, found.open_borders), expected)
        self.assertEqual(bool(found.why), "seams" not in given)

    def test_the_better_one_where_a_texture_is_not_dilated(self):
        arm = self.arm()
        node = arm.object.data.materials[0].node_tree.nodes.new("ShaderNodeTexImage")
        node.image = bpy.data.images.new("new", 8, 8)
        bpy.ops.vrtm.set_up_material()
        reports = {seams: self.solved(arm, seams=seams).tiles[0].report() for seams in ("shut", "keep")}
        better, why = part("session").library("vrtm.borders").kept_or_shut(lambda seams: [reports[seams]])
        self.check_solved(arm, seams=better)
        line = f"Seams {better}, open borders fixed: new is not dilated; at frame 4 {why}"
        self.assertIn(line, self.shown(arm.object))
        # Other frames have the same.
        bpy.context.scene.frame_set(1)
        self.assertIn(line, self.shown(arm.object))
        bpy.ops.vrtm.dilate()
        self.check_solved(arm, seams="continue", open_borders="slide")

    def test_nothing_slides_where_another_mesh_begins(self):
        arm = self.arm(dilated=False)
        hand = add_mesh("hand", arm.rest()[-24:])
        select(arm.object)
        for apart in (1, 0):
            hand.location = (0, 0, apart)
            bpy.context.view_layer.update()
            bpy.ops.vrtm.dilate()
            found = part("borders").chosen(arm.object)
            self.assertEqual((found.seams, found.open_borders), ("continue", "slide" if apart else "fixed"))
        self.assertIn("but open borders lie at vertices of another mesh", found.why)
