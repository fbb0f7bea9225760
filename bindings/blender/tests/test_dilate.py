"""Seams that go on: what is set of the library, and copies of textures with what lies beyond seams."""

import numpy as np

from support import Arm, Case, add_texture, bpy, fill, node_of, part, picture, pixels, tiled

SIZE = 128


def content(size, inside_only=True):
    """Of the arm's texture, which goes once around it between v = 0.04 and 0.96: (size, size, 4), bottom row first."""
    v = np.broadcast_to(((np.arange(size) + 0.5) / size)[:, None], (size, size))
    around = 2 * np.pi * (v - 0.04) / 0.92
    values = np.stack([0.5 + 0.4 * np.cos(around), 0.5 + 0.4 * np.sin(around), np.full_like(v, 0.25)], -1)
    if inside_only:
        values[(v < 0.04) | (v > 0.96)] = (1, 0, 1)
    return np.concatenate([values, np.ones((size, size, 1))], -1).astype(np.float32)


class Dilate(Case):
    def arm(self, tiles=1, folder=None, dilated=False):
        arm = Arm.with_studs(tiles=tiles)
        arm.texture = arm.add_material(albedo=self.image(folder, tiles))
        arm.object.vrtm.seams = "continue"
        bpy.context.scene.frame_set(4)
        if dilated:
            bpy.ops.vrtm.set_up_material()
            bpy.ops.vrtm.dilate()
        return arm

    def image(self, folder, tiles):
        if folder is None:
            return picture("skin", content(SIZE))
        image = tiled(folder, "skin", dict.fromkeys(range(1001, 1001 + tiles), content(SIZE)))
        image.name = "skin"
        return image

    def check(self, found):
        """Checks that the other side of the seam lies beside the chart, as far as the reach along the surface."""
        v = (np.arange(SIZE) + 0.5) / SIZE
        rows = ((v > 0.025) & (v < 0.04)) | ((v > 0.96) & (v < 0.975))
        inside = (v > 0.04) & (v < 0.96)
        expected = content(SIZE, inside_only=False)
        columns = slice(4, SIZE - 4)
        self.assertGreaterEqual(rows.sum(), 4)
        self.assertLess(np.abs(found[rows, columns] - expected[rows, columns]).max(), 0.02)
        self.assertLess(np.abs(found[inside] - expected[inside]).max(), 0.005)

    def test_a_copy_has_what_lies_beyond_the_seam(self):
        arm = self.arm()
        original = arm.texture.image
        self.refused("set the material up first", bpy.ops.vrtm.dilate)
        bpy.ops.vrtm.set_up_material()
        said = "Textures end at seams: press Dilate Textures"
        self.assertIn(said, self.shown(arm.object))
        self.assertEqual(bpy.ops.vrtm.dilate(), {"FINISHED"})
        self.assertNotIn(said, self.shown(arm.object))
        copy = arm.texture.image
        self.assertEqual((copy.name, copy.vrtm_original), ("skin dilated", original))
        self.check(pixels(copy))
        self.assertSame(
            pixels(original), np.floor(content(SIZE) * np.float32(255) + np.float32(0.5)) * np.float32(1 / 255)
        )
        # Painted over, and pressed again: one copy, of the new picture.
        values = content(SIZE)
        values[..., 2] = 0.75
        fill(original, values)
        bpy.ops.vrtm.dilate()
        self.assertAlmostEqual(float(pixels(arm.texture.image)[2, 60, 2]), 0.75, delta=0.01)
        self.assertEqual([image.name for image in bpy.data.images if image.vrtm_original], ["skin dilated"])
        # It is saved with the file, and the original comes back.
        self.reopened()
        copy = bpy.data.images["skin dilated"]
        self.assertAlmostEqual(float(pixels(copy)[2, 60, 2]), 0.75, delta=0.01)
        bpy.ops.vrtm.clear_material()
        node = node_of(bpy.data.materials["skin"].node_tree, "ShaderNodeTexImage")
        self.assertEqual(node.image.name, "skin")
        self.assertNotIn("skin dilated", bpy.data.images)

    def test_what_is_painted_on_a_copy_is_kept(self):
        arm = self.arm(dilated=True)
        copy = arm.texture.image
        values = pixels(copy)
        values[60, 60] = (1, 1, 1, 1)
        fill(copy, values)
        # Packed again, as when the file is saved: no longer marked as changed.
        copy.pack()
        self.assertFalse(copy.is_dirty)
        bpy.ops.vrtm.dilate()
        self.assertNotEqual(arm.texture.image, copy)
        self.assertTrue(copy.use_fake_user and copy.vrtm_original is None)
        self.assertGreater(pixels(copy)[60, 60, 1], 0.99)
        bpy.ops.vrtm.clear_material()
        self.assertEqual([image.name for image in bpy.data.images if "dilated" in image.name], [copy.name])

    def test_it_is_all_or_nothing(self):
        arm = self.arm()
        tree = arm.object.data.materials[0].node_tree
        gone = tree.nodes.new("ShaderNodeTexImage").image = bpy.data.images.new("gone", 8, 8)
        gone.source, gone.filepath = "FILE", "/nowhere/gone.png"
        bpy.ops.vrtm.set_up_material()
        before = arm.texture.image
        self.refused("'gone' has no pixels", bpy.ops.vrtm.dilate)
        self.assertEqual(arm.texture.image, before)
        self.assertFalse([image.name for image in bpy.data.images if "dilated" in image.name])

    def test_floats_and_normals(self):
        """Floats are linear in memory; directions of a map in tangent space stay where the surface does not turn."""
        arm = self.arm()
        tree = arm.object.data.materials[0].node_tree
        inside = content(SIZE)[..., 2:3] < 0.5
        values = np.where(inside, (0.68, 0.74, 0.9, 1), (0.5, 0.5, 1, 1)).astype(np.float32)
        bump, reroute = tree.nodes.new("ShaderNodeNormalMap"), tree.nodes.new("NodeReroute")
        node = add_texture(picture("bumps", values, float_buffer=True, is_data=True), reroute.inputs[0])
        tree.links.new(reroute.outputs[0], bump.inputs["Color"])
        arm.texture.image = picture("linear", content(SIZE), float_buffer=True)
        # Only a map in tangent space is turned, also behind a Reroute; this one's surface does not turn.
        holds_normals = part("dilate")._holds_normals
        self.assertEqual((holds_normals(node), holds_normals(arm.texture)), (True, False))
        bump.space = "OBJECT"
        self.assertFalse(holds_normals(node))
        bump.space = "TANGENT"
        bpy.ops.vrtm.set_up_material()
        bpy.ops.vrtm.dilate()
        self.reopened()
        self.check(pixels(bpy.data.images["linear dilated"]))
        bumps = pixels(bpy.data.images["bumps dilated"])
        self.assertLess(np.abs(bumps[4, 8:-8, :3] - (0.68, 0.74, 0.9)).max(), 0.03)

    def test_tiles(self):
        folder = self.scratch()
        arm = self.arm(2, folder, dilated=True)
        copy = arm.texture.image
        self.assertEqual((copy.source, [tile.number for tile in copy.tiles]), ("TILED", [1001, 1002]))
        self.reopened(folder)
        tiles = part("maps").read_image(bpy.data.images["skin dilated"])
        self.assertEqual(sorted(tiles), [1001, 1002])
        for found in tiles.values():
            self.check(found)
