"""Rigidity images that are made, changed, painted on and packed."""

import types
from unittest import mock

import numpy as np

from support import Arm, Case, Layout, add_texture, bpy, each, fill, node_of, part, picture, pixels, studs


def overlap(one, other):
    one, other = one > 0.5, other > 0.5
    return (one & other).sum() / (one | other).sum()


class Rigidity(Case):
    def arm(self, tiles=1):
        """An arm with a material: a texture with studs in a colour, and heights of other studs."""
        self.colours = np.zeros((128, 128, 4), np.float32)
        self.colours[:] = (0.1, 0.3, 0.1, 1)
        self.colours[studs(128) > 0.5] = (0.8, 0.6, 0.3, 1)
        self.heights = np.clip(0.3 + 0.3 * np.linspace(0, 1, 128)[None] + 0.2 * studs(128, 1), 0, 1)
        arm = Arm(tiles=tiles)
        tree = arm.add_material(albedo=picture("colour", self.colours)).id_data
        add_texture(picture("height", self.heights), tree.nodes.new("ShaderNodeBump").inputs["Height"])
        return arm

    def painted(self, arm):
        return pixels(arm.object.vrtm.rigidity_image)[..., 0]

    def test_from_the_texture(self):
        arm = self.arm()
        settings = arm.object.vrtm
        self.assertEqual(bpy.ops.vrtm.rigidity_from_texture(), {"FINISHED"})
        image = settings.rigidity_image
        self.assertEqual((settings.rigidity_source, image.colorspace_settings.name), ("IMAGE", "Non-Color"))
        self.assertIsNotNone(image.packed_file)
        self.assertGreater(overlap(self.painted(arm), studs(128)), 0.95)
        for options, expected in (
            ({"by": "colour", "colour": (0.8, 0.6, 0.3), "tolerance": 0.1}, studs(128)),
            ({"by": "colour", "colour": (0.1, 0.3, 0.1), "tolerance": 0.1}, 1 - studs(128)),
            ({"by": "bright"}, studs(128)),
            ({"by": "bright", "threshold": 0.4, "invert": True}, 1 - studs(128)),
            ({"by": "dark"}, 1 - studs(128)),
            ({"by": "bright", "image": "height", "threshold": 0.45}, (self.heights > 0.45).astype(float)),
        ):
            bpy.ops.vrtm.rigidity_from_texture(**options)
            self.assertGreater(overlap(self.painted(arm), expected), 0.9, options)
        # A stud is 14 texels wide.
        bpy.ops.vrtm.rigidity_from_texture(by="bright", threshold=0.4, smallest=20)
        self.assertEqual(self.painted(arm).max(), 0)
        bpy.ops.vrtm.rigidity_from_texture(by="bright", threshold=0.4, size=64)
        self.assertEqual(self.painted(arm).shape, (64, 64))
        self.refused("no image 'nobody'", bpy.ops.vrtm.rigidity_from_texture, image="nobody")
        # And it is solved for.
        self.update(5)
        self.assertEqual(part("states").find_state(arm.object).notes, [])

    def test_the_skin_is_not_taken_for_the_feature(self):
        """Neither by default, on a skin that is bright, nor without a question."""
        arm = self.arm()
        settings, of = arm.object.vrtm, part("operators.from_picture").VRTM_OT_rigidity_from_texture
        self.colours[..., :3] = 0.9 - self.colours[..., :3]
        fill(bpy.data.images["colour"], self.colours)
        bpy.ops.vrtm.rigidity_from_texture()
        self.assertGreater(overlap(self.painted(arm), studs(128)), 0.95)
        # Another texture has a color of its own.
        other = picture("other", np.roll(self.colours, 40, 1)[..., [1, 2, 0, 3]])
        bpy.ops.vrtm.rigidity_from_texture("EXEC_DEFAULT", image="other", proposed_for="colour", colour=(1, 0, 0))
        self.assertGreater(overlap(self.painted(arm), np.roll(studs(128), 40, 1)), 0.95)
        bpy.ops.vrtm.set_up_material()
        self.update(5)
        self.assertEqual(self.line(arm.object), ("Up to date", "CHECKMARK"))
        grown, much, most = (np.zeros((128, 128), np.float32) for _ in range(3))
        grown[10:100, :60], grown[10:40, 80:] = 1, 1
        much[:90], most[:118] = 1, 1
        for values, asked, icon in (
            (studs(128), "", "CHECKMARK"),
            (grown, "One is larger than all others together", "CHECKMARK"),
            (much, " % is rigid. Is it the skin", "CHECKMARK"),
            (most, " % is rigid, so that next to nothing can give way. Is it the skin", "INFO"),
        ):
            given = types.SimpleNamespace(invert=False, smallest=3)
            found, told = of.made(given, {None: values}, dict)
            self.assertEqual("Is it the skin" in told, bool(asked), told)
            if asked.startswith("One"):
                self.assertIn(asked, told)
            self.assertSame(found[None], values)
            fill(settings.rigidity_image, values)
            self.update()
            self.assertEqual(self.line(arm.object), ("Up to date", icon))
            self.assertEqual(asked in self.notes(arm.object), not asked.startswith("One"), self.notes(arm.object))
        self.assertEqual(other.users, 0)

    def test_the_dialog_shows_the_result(self):
        self.arm()
        of, shown = part("operators.from_picture"), []
        cls = of.VRTM_OT_rigidity_from_texture
        rna = bpy.ops.vrtm.rigidity_from_texture.get_rna_type()
        names = ("made", "tiles", "own", "change", "_shown")
        given = types.SimpleNamespace(**{name: getattr(cls, name) for name in names}, bl_rna=rna, layout=Layout(shown))
        given.tiles, given.own = (lambda source: {None: self.colours}), lambda: ("by", "colour")
        given.given = lambda obj: (None, lambda tiles: {1001: studs(128), 1002: studs(64)}, "")
        given.made = lambda *tiles: cls.made(types.SimpleNamespace(invert=False, smallest=3), *tiles)
        cls.check(given, bpy.context)
        cls.draw(given, bpy.context)
        names = ("The texture", "White keeps its shape")
        icons = [of.previews[name] for name in names]
        expected = [icons[0].icon_id, names[0], icons[1].icon_id, names[1]]
        self.assertEqual(shown[:5], [*expected, "48 features, 23 % of the texture"])
        self.assertEqual([tuple(one.image_size) for one in icons], [(256, 256), (512, 256)])
        found = np.reshape(icons[0].image_pixels_float, (256, 256, 4))
        self.assertLess(np.abs(found[::2, ::2] - self.colours).max(), 0.01)
        # What is wrong is told there.
        given.tiles = part("maps").read_image
        cls.check(given, bpy.context)
        self.assertEqual((given._shown, "NoneType" in given._told), ({}, True))

    def test_repeated_tries_have_one_image(self):
        arm = self.arm()
        settings = arm.object.vrtm
        bpy.ops.vrtm.rigidity_from_texture()
        # Whatever shows it goes on with the new one.
        node = arm.object.active_material.node_tree.nodes.new("ShaderNodeTexImage")
        node.image = settings.rigidity_image
        for step in (
            bpy.ops.vrtm.rigidity_from_texture,
            lambda: bpy.ops.vrtm.rigidity_from_heights(feature=0.11),
            lambda: bpy.ops.vrtm.change_rigidity(how="grow"),
            bpy.ops.vrtm.keep_detail,
            bpy.ops.vrtm.keep_detail,
        ):
            self.assertEqual(step(), {"FINISHED"})
            self.assertEqual(node.image, settings.rigidity_image)
            names = sorted(image.name for image in bpy.data.images if image.name.startswith("arm "))
            self.assertEqual(names, ["arm mask", "arm rigidity"] if settings.mask_image else ["arm rigidity"])
        # What was painted on, and what is another object's, is kept.
        other = bpy.data.objects.new("other", arm.mesh)
        other.vrtm.rigidity_source, other.vrtm.rigidity_image = "IMAGE", settings.rigidity_image
        for of in (other, arm.object):
            before = of.vrtm.rigidity_image
            bpy.ops.vrtm.rigidity_from_texture()
            self.assertEqual((before.name, settings.rigidity_image != before), (before.name, True))
            fill(settings.rigidity_image, np.ones((128, 128), np.float32))
        self.assertEqual(len([image for image in bpy.data.images if image.name.startswith("arm rigidity")]), 3)

    def test_from_heights(self):
        arm = self.arm()
        bump = node_of(arm.object.active_material.node_tree, "ShaderNodeBump")
        # Also both ways round at once.
        for sunken, bump.invert in ((False, False), (True, False), (True, True)):
            self.assertEqual(bpy.ops.vrtm.rigidity_from_heights(feature=0.11, sunken=sunken), {"FINISHED"})
            self.assertEqual(overlap(self.painted(arm), studs(128, 1)) > 0.8, sunken == bump.invert)
        arm.object.data.materials.clear()
        self.refused("Bump or Displacement", bpy.ops.vrtm.rigidity_from_heights)

    def test_heights_are_found_behind_other_nodes(self):
        arm = self.arm()
        tree = arm.object.active_material.node_tree
        bump = node_of(tree, "ShaderNodeBump")
        height, found = bump.inputs["Height"].links[0].from_socket, part("textures").height_image
        image = height.node.image

        def ramp(node):
            node.color_ramp.elements[0].color, node.color_ramp.elements[1].color = (1, 1, 1, 1), (0, 0, 0, 1)

        def math(operation, place, value):
            def change(node):
                node.operation = operation
                node.inputs[1 - place].default_value = value

            return change

        for kind, place, turned, change in (
            ("ShaderNodeRGBToBW", 0, False, None),
            ("ShaderNodeInvert", "Color", True, None),
            ("ShaderNodeGamma", 0, False, None),
            ("ShaderNodeBrightContrast", 0, False, None),
            ("ShaderNodeRGBCurve", "Color", False, None),
            ("ShaderNodeClamp", 0, False, None),
            ("ShaderNodeSeparateColor", 0, False, None),
            ("ShaderNodeValToRGB", 0, False, None),
            ("ShaderNodeValToRGB", 0, True, ramp),
            ("ShaderNodeMath", 0, True, math("MULTIPLY", 0, -2)),
            ("ShaderNodeMath", 1, True, math("SUBTRACT", 1, 1)),
            ("ShaderNodeMapRange", 0, False, None),
            ("ShaderNodeMapRange", 0, True, lambda node: setattr(node.inputs["To Max"], "default_value", -1)),
        ):
            with self.subTest(kind=kind, turned=turned):
                node = tree.nodes.new(kind)
                if change is not None:
                    change(node)
                tree.links.new(height, node.inputs[place])
                tree.links.new(node.outputs[0], bump.inputs["Height"])
                self.assertEqual(found(arm.object), (image, turned))
                tree.nodes.remove(node)

    @each("way", ("grow", "new", "texture", "remove"))
    @each("packed", (True, False))
    def test_images_that_nothing_uses_any_more_are_saved(self, way, packed):
        arm = self.arm()
        image = arm.paint_image("mine")
        if packed:
            image.pack()
        {
            "grow": lambda: bpy.ops.vrtm.change_rigidity(how="grow"),
            "new": bpy.ops.vrtm.new_rigidity,
            "texture": bpy.ops.vrtm.rigidity_from_texture,
            "remove": bpy.ops.vrtm.remove_all,
        }[way]()
        before = pixels(image)
        if not packed:
            image.pack()
        self.reopened()
        self.assertSame(pixels(bpy.data.images["mine"]), before)

    def test_changes_leave_what_was_painted(self):
        arm = Arm()
        image, settings = arm.paint_image(), arm.object.vrtm
        before = pixels(image)
        canvas = bpy.context.scene.tool_settings.image_paint
        canvas.canvas = image
        bpy.ops.vrtm.change_rigidity(how="invert")
        self.assertNotEqual(settings.rigidity_image, image)
        self.assertLess(np.abs(self.painted(arm) - (1 - before[..., 0])).max(), 1 / 255)
        self.assertEqual(canvas.canvas, settings.rigidity_image)
        self.assertSame(pixels(image), before)
        bpy.ops.vrtm.change_rigidity(how="invert")
        bpy.ops.vrtm.change_rigidity(how="grow", texels=3)
        grown = self.painted(arm).sum()
        bpy.ops.vrtm.change_rigidity(how="shrink", texels=6)
        self.assertLess(self.painted(arm).sum(), before[..., 0].sum())
        self.assertGreater(grown, before[..., 0].sum())
        settings.rigidity_source = "NONE"
        self.assertFalse(bpy.ops.vrtm.change_rigidity.poll())

    def test_detail_is_kept(self):
        arm = self.arm()
        settings, keep = arm.object.vrtm, bpy.ops.vrtm.keep_detail
        self.assertFalse(keep.poll())
        bpy.ops.vrtm.rigidity_from_texture()
        before, rigid = self.painted(arm), settings.rigidity_image
        self.colours[60:][studs(128)[60:] < 0.5] = (0, 0.1, 0, 1)
        fill(bpy.data.images["colour"], self.colours)
        settings.mask_image = other = bpy.data.images.new("other", 8, 8)
        self.assertEqual(keep(), {"FINISHED"})
        self.assertEqual((settings.mask_source, settings.rigidity_image), ("IMAGE", rigid))
        self.assertTrue(other.use_fake_user)
        mask = pixels(settings.mask_image)[..., 0]
        self.assertEqual((mask.min(), mask[before > 0].min(), mask[:50].min()), (0, 1, 1))
        # Nearer to features on a finer grid.
        of, tile = part("session").library().rigidity, types.SimpleNamespace(grid=(1024, 512))
        asset = types.SimpleNamespace(tiles=[tile], close=lambda: None)
        with (
            mock.patch.object(part("states").state_of(arm.object).prepared, "asset", asset),
            mock.patch.object(of, "of_detail", wraps=of.of_detail) as detail,
        ):
            keep()
        self.assertEqual(detail.call_args.kwargs["cells"], 512)
        arm.object.active_material.node_tree.nodes.clear()
        self.refused("no Image Texture", keep)

    def test_tiles(self):
        arm = Arm(tiles=2)
        self.assertEqual(bpy.ops.vrtm.new_rigidity(size=64), {"FINISHED"})
        image = arm.object.vrtm.rigidity_image
        self.assertEqual([tile.number for tile in image.tiles], [1001, 1002])
        self.assertEqual(part("maps").read_image(image)[1002][..., 0].max(), 0)
        bpy.ops.vrtm.change_rigidity(how="invert")
        found = part("maps").read_image(arm.object.vrtm.rigidity_image)
        self.assertEqual(sorted(found), [1001, 1002])
        self.assertEqual(min(pixels_[..., 0].min() for pixels_ in found.values()), 1)
        arm.add_material(albedo=bpy.data.images.new("whole", 64, 64))
        self.assertEqual(bpy.ops.vrtm.keep_detail(), {"FINISHED"})
        self.assertEqual(sorted(part("maps").read_image(arm.object.vrtm.mask_image)), [1001, 1002])
        # From a texture with tiles.
        folder = self.scratch()
        texture = arm.paint_tiles(folder, "albedo")
        bpy.ops.vrtm.rigidity_from_texture(image=texture.name, by="bright")
        found = part("maps").read_image(arm.object.vrtm.rigidity_image)
        for udim, values in arm.painted.items():
            self.assertGreater(overlap(found[udim][..., 0], values), 0.9)

    def test_painting_and_packing(self):
        arm = Arm()
        self.assertFalse(bpy.ops.vrtm.paint.poll())
        bpy.ops.vrtm.new_rigidity(size=64)
        settings, scene = arm.object.vrtm, bpy.context.scene
        self.assertEqual(bpy.ops.vrtm.paint(), {"FINISHED"})
        self.assertEqual(arm.object.mode, "TEXTURE_PAINT")
        paint = scene.tool_settings.image_paint
        self.assertEqual(tuple(part("versions").unified_paint_settings(scene).color), (1, 1, 1))
        self.assertEqual((paint.mode, paint.canvas), ("IMAGE", settings.rigidity_image))
        bpy.ops.object.mode_set(mode="OBJECT")
        fill(settings.rigidity_image, np.ones((64, 64), np.float32))
        settings.rigidity_image.update()
        self.assertEqual(len(part("keep").unsaved_maps(arm.object)), 1)
        self.assertEqual(bpy.ops.vrtm.pack_maps(), {"FINISHED"})
        self.assertEqual(part("keep").unsaved_maps(arm.object), [])
