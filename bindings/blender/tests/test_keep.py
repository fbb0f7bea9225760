"""Nothing is lost when a file is saved and opened again: results and their users, node groups, and what is told of maps
that are not in the file."""

import os
import tempfile

import numpy as np

from support import Arm, Case, bpy, delta, each, in_file, nodes_of, part, pixels


class Keep(Case):
    def arm(self):
        """An arm that is solved, and whose material is set up by image."""
        arm = Arm.with_studs(along=20, around=12, size=64)
        arm.object.vrtm.rigidity_image.pack()
        arm.add_material()
        self.update(5)
        self.assertEqual(bpy.ops.vrtm.set_up_material(), {"FINISHED"})
        return arm

    def group(self):
        return next(tree for tree in bpy.data.node_groups if tree.get("vrtm_kind") == "image")

    def read(self, tree):
        """The image that is looked up: that of the node with links."""
        return next(node.image for node in tree.nodes if "Color" in node.outputs and node.outputs["Color"].is_linked)

    def saved(self, handlers=True):
        """Saves the file and opens it again; without the add-on's handlers, as an earlier version or Blender by itself
        saves it."""
        kept = list(bpy.app.handlers.save_pre)
        if not handlers:
            bpy.app.handlers.save_pre.clear()
        obj = self.reopened()
        bpy.app.handlers.save_pre[:] = kept
        return obj

    def test_no_tree_holds_a_data_block(self):
        arm = self.arm()
        bpy.ops.vrtm.set_up_material(by="uv_map")
        arm.object.modifiers.new("it", "SUBSURF")
        bpy.ops.vrtm.insert_tap()
        self.bakes_to(self.scratch(), 1, 2)
        bpy.ops.vrtm.bake()
        bpy.ops.vrtm.use_baked()
        trees = [*bpy.data.node_groups, *(material.node_tree for material in bpy.data.materials)]
        self.assertGreaterEqual(len(trees), 4)
        for tree in trees:
            for owner in (tree, *tree.nodes):
                self.assertEqual([key for key, value in owner.items() if isinstance(value, bpy.types.ID)], [])
        # What is registered on a tree would be kept in the same way.
        self.assertEqual([name for name in dir(bpy.types.NodeTree) if "vrtm" in name], [])

    @each(
        "lose",
        (
            lambda obj, tree: bpy.data.images.remove(obj.vrtm.image),
            lambda obj, tree: setattr(tree.nodes["Image Texture"], "image", None),
            lambda obj, tree: tree.nodes.clear(),
            lambda obj, tree: setattr(obj.vrtm, "image", bpy.data.images["albedo"]),
        ),
    )
    def test_a_group_that_lost_its_image_is_built_again(self, lose):
        obj = self.arm().object
        tree, expected = self.group(), pixels(obj.vrtm.image)
        lose(obj, tree)
        self.assertNotIn("Up to date", self.shown(obj))
        self.assertTrue(any("press Update Now" in text for text in self.shown(obj)))
        # Without Update Now, too: nothing else has changed.
        part("solve").run(obj, bpy.context.evaluated_depsgraph_get())
        self.assertEqual(self.read(tree), obj.vrtm.image)
        self.assertSame(pixels(obj.vrtm.image), expected)
        self.assertIn("Up to date", self.shown(obj))
        self.assertEqual(np.abs(pixels(bpy.data.images["albedo"])[..., :3]).max(), 0)
        self.assertEqual(len([t for t in bpy.data.node_groups if t.get("vrtm_kind") == "image"]), 1)

    def test_a_duplicate_takes_no_group_of_the_original(self):
        arm = self.arm()
        obj, tree = arm.object, self.group()
        copy = obj.copy()
        bpy.context.collection.objects.link(copy)
        depsgraph = bpy.context.evaluated_depsgraph_get()
        part("solve").run(copy, depsgraph)
        self.assertNotEqual(copy.vrtm.image, obj.vrtm.image)
        self.assertEqual(self.read(tree), obj.vrtm.image)
        bpy.data.images.remove(obj.vrtm.image)
        part("states").state_of(copy).shown = b""
        part("solve").run(copy, depsgraph)
        self.assertIsNone(part("nodes").image_of(tree))
        part("solve").run(obj, depsgraph)
        self.assertEqual(self.read(tree), obj.vrtm.image)

    def test_names_do_not_matter(self):
        arm = self.arm()
        obj, tree = arm.object, self.group()
        obj.vrtm.image.name, tree.name, bpy.data.materials["skin"].name = "a", "b", "c"
        image = obj.vrtm.image
        obj.vrtm.map_size = 32
        self.update()
        self.assertEqual((obj.vrtm.image, self.read(tree), tuple(image.size)), (image, image, (32, 32)))
        expected = pixels(image)
        obj = self.saved()
        # Resized, and in the file as it was.
        self.assertSame(pixels(obj.vrtm.image), in_file(expected))
        self.assertEqual((obj.vrtm.image.name, self.read(self.group())), ("a", obj.vrtm.image))

    @each("by_artist", (False, True))
    def test_a_result_whose_pixels_are_gone_is_written_again(self, by_artist):
        image = self.arm().object.vrtm.image
        with tempfile.TemporaryDirectory() as folder:
            if by_artist:
                # The result was saved to a file of its own, which is gone then.
                image.filepath_raw = os.path.join(folder, "mine.exr")
                image.save()
            # As Blender's own saves on a timer do, and those without the add-on.
            obj = self.saved(handlers=False)
        image = obj.vrtm.image
        self.assertIn("The result image is empty: press Update Now", self.shown(obj))
        self.update()
        self.assertIn("Up to date", self.shown(obj))
        self.assertEqual(obj.vrtm.image, image)
        self.assertGreater(np.abs(delta(obj)).max(), 0)
        expected = pixels(image)
        obj = self.saved()
        self.assertSame(pixels(obj.vrtm.image), in_file(expected))

    def test_a_result_is_packed_small(self):
        arm = self.arm()
        obj, image = arm.object, arm.object.vrtm.image
        obj.vrtm.map_size = 512
        self.update()
        expected, tree = pixels(image), nodes_of(arm.mesh.materials[0])
        links = sorted((link.from_node.name, link.to_node.name) for link in tree.links)
        interpretation = image.alpha_mode, image.colorspace_settings.name
        obj = self.saved()
        image, found = obj.vrtm.image, pixels(obj.vrtm.image)
        # Blender itself packs 16 bytes for each texel.
        self.assertLess(image.packed_file.size, 16 * 512 * 512 / 8)
        self.assertEqual((image.is_dirty, image.source, image.is_float), (False, "FILE", True))
        off = np.abs(found - expected)
        self.assertLess((off - np.abs(expected) / 2048).max(), 2.0**-25)
        # In texels of a texture of 4096.
        self.assertLess(4096 * off.max(), 2 * np.abs(expected[..., :2]).max())
        self.assertSame(found[..., 2:], expected[..., 2:])
        tree = nodes_of(obj.data.materials[0])
        self.assertEqual(sorted((link.from_node.name, link.to_node.name) for link in tree.links), links)
        self.assertEqual(interpretation, (image.alpha_mode, image.colorspace_settings.name))
        self.assertEqual(self.read(self.group()), image)
        self.assertFalse(part("nodes").stale_groups(obj))
        # Saved again without a change it is the same file, and what is solved then is written as ever.
        data = image.packed_file.data
        obj = self.saved()
        self.assertEqual(obj.vrtm.image.packed_file.data, data)
        self.update()
        self.assertSame(pixels(obj.vrtm.image), expected)
        # Another result is packed anew.
        self.update(3)
        expected = pixels(obj.vrtm.image)
        obj = self.saved()
        self.assertSame(pixels(obj.vrtm.image), in_file(expected))
        self.assertNotIn("press Update Now", " ".join(self.shown(obj)))

    def test_painted_maps_that_are_not_saved_are_told(self):
        arm = self.arm()
        painted = arm.object.vrtm.rigidity_image
        text = "Rigidity 'rigidity' is not saved: save or pack the image"
        self.assertNotIn(text, self.shown(arm.object))
        painted.pixels[0] = 0.5
        self.assertIn(text, self.shown(arm.object))
        with self.assertLogs("vrtm.blender", "WARNING") as logged:
            obj = self.saved()
        self.assertIn(f"arm: {text}", logged.output[0])
        # Packed before that, it is as it was then; one that was never packed is lost.
        self.assertNotIn("Rigidity 'rigidity'", " ".join(self.shown(obj)))
        obj.vrtm.rigidity_image = bpy.data.images.new("painted", 8, 8)
        obj.vrtm.rigidity_image.pixels[0] = 0.5
        obj = self.saved()
        self.assertIn("Rigidity 'painted' is black: nothing was painted, or it was not saved", self.shown(obj))
        obj.vrtm.rigidity_image.generated_color = (1, 1, 1, 1)
        self.assertNotIn("'painted'", " ".join(self.shown(obj)))
