"""Objects that are linked from another file and overridden without their mesh, as a studio's characters are: the result
is an image alone, and a copy of the material in the object's own slot."""

import os

import numpy as np

from support import Arm, Case, add_texture, asset_of, bpy, in_file, nodes_of, part, picture, pixels, select, studs


def overridden(path, name):
    """An object of another file, overridden in this one, at frame 5."""
    with bpy.data.libraries.load(path, link=True) as (_, into):
        into.objects, into.images = [name], ["rigidity"]
    obj = into.objects[0].override_create()
    bpy.context.collection.objects.link(obj)
    select(obj)
    bpy.context.scene.frame_set(5)
    assert obj.library is None and obj.data.library is not None
    return obj


class LinkedCase(Case):
    def setUp(self):
        super().setUp()
        self.folder = self.scratch()

    def character(self, prepare=lambda arm: None, keep=False):
        """A character in a file of its own, linked into another one and overridden, and the result of frame 5; what was
        set there stays with `keep`."""
        arm = self.arm = Arm()
        material = bpy.data.materials.new("skin")
        inner = bpy.data.node_groups.new("skin group", "ShaderNodeTree")
        inner.interface.new_socket("Color", in_out="OUTPUT", socket_type="NodeSocketColor")
        add_texture(picture("albedo", studs(64)), inner.nodes.new("NodeGroupOutput").inputs[0]).image.pack()
        tree = nodes_of(material)
        group = tree.nodes.new("ShaderNodeGroup")
        group.node_tree = inner
        tree.links.new(group.outputs[0], tree.nodes["Principled BSDF"].inputs["Base Color"])
        arm.mesh.materials.append(material)
        arm.paint_image().pack()
        prepare(arm)
        expected = arm.asset()
        bpy.context.scene.frame_set(5)
        expected.solve(arm.pose())
        delta = arm.delta(expected)
        if not keep:
            arm.object.vrtm.property_unset("rigidity_image")
            arm.object.vrtm.property_unset("rigidity_source")
        bpy.data.images["rigidity"].use_fake_user = True
        path = os.path.join(self.folder, "character.blend")
        bpy.ops.wm.save_as_mainfile(filepath=path)
        super().setUp()
        return overridden(path, "arm"), delta

    def untouched(self, obj):
        """Nothing of the linked data has changed."""
        mesh, material = obj.data, obj.data.materials[0]
        self.assertEqual([layer.name for layer in mesh.uv_layers], ["UVMap"])
        self.assertFalse([a.name for a in mesh.attributes if "vrtm" in a.name])
        self.assertIsNotNone(material.library)
        self.assertFalse([n for n in material.node_tree.nodes if part("nodes").is_ours(n)])

    def expected(self, obj, rest, **options):
        """By the Python package alone, at frame 5: the deltas of all layers, and the layer of each face."""
        arm, scene = self.arm, bpy.context.scene
        kept, painted = scene.frame_current, {1001: pixels(obj.vrtm.rigidity_image)[..., 0].copy()}
        asset = asset_of(rest, arm.faces, arm.uvs, arm.size, painted, **options)
        scene.frame_set(5)
        asset.solve(arm.pose(obj))
        scene.frame_set(kept)
        deltas = [tile.fetch("redirection_delta", arm.size, channels=2, origin="bottom") for tile in asset.tiles]
        return deltas, asset.face_layers()


class Linked(LinkedCase):
    def test_the_result_is_an_image_alone(self):
        obj, delta = self.character()
        settings = obj.vrtm
        self.assertEqual(bpy.ops.vrtm.set_up(), {"FINISHED"})
        self.assertEqual((settings.rigidity_image.name, settings.live), ("rigidity", True))
        self.assertSame(pixels(settings.image)[..., :2], delta)
        [slot] = obj.material_slots
        self.assertEqual((slot.link, slot.material.library), ("OBJECT", None))
        # The texture lies in a group, which is a copy, too.
        redirected = part("picture").redirected(slot.material)
        self.assertEqual([(node.image.name, node.id_data.library) for node in redirected], [("albedo", None)])
        self.assertEqual(part("nodes").image_of(next(iter(part("nodes").groups_of(obj)))), settings.image)
        self.untouched(obj)
        shown = self.shown(obj)
        self.assertIn("Up to date", shown)
        self.assertIn("The mesh is linked from another file: the result is an image alone", shown)
        # Saved and opened, all of it is there.
        settings.harm = 0.5
        obj = self.reopened(self.folder)
        settings, [slot] = obj.vrtm, obj.material_slots
        self.assertEqual((settings.rigidity_image.name, settings.live, settings.harm), ("rigidity", True, 0.5))
        self.assertEqual((slot.link, slot.material.library), ("OBJECT", None))
        self.assertSame(pixels(settings.image)[..., :2], in_file(delta))
        self.assertIsNone(part("results").missing(obj))
        self.untouched(obj)

    def test_rigidity_from_a_linked_texture(self):
        obj, _ = self.character()
        self.assertEqual(bpy.ops.vrtm.rigidity_from_texture(), {"FINISHED"})
        image = obj.vrtm.rigidity_image
        self.assertEqual((image.library, tuple(image.size)), (None, (64, 64)))
        # The texture is white where studs are.
        self.assertGreater(np.corrcoef(pixels(image)[..., 0].ravel(), studs(64).ravel())[0, 1], 0.9)
        self.untouched(obj)
        # The linked object itself is not for buttons.
        linked = obj.override_library.reference
        with bpy.context.temp_override(object=linked, active_object=linked):
            self.assertFalse(bpy.ops.vrtm.set_up.poll())

    def test_a_character_that_was_set_up_in_its_own_file(self):
        def prepared(arm):
            bpy.ops.vrtm.set_up()
            arm.object.vrtm.live = False

        obj, delta = self.character(prepared, keep=True)
        self.update()
        # The result is the shot's own, which the linked material does not show.
        self.assertIsNone(obj.vrtm.image.library)
        shown = self.shown(obj)
        self.assertIn("Not what it should be: see Status", shown)
        self.assertIn("as its own file has it, since material 'skin' is linked: press Set Up by Image", self.notes(obj))
        self.assertEqual(bpy.ops.vrtm.set_up_material(), {"FINISHED"})
        self.assertIn("Up to date", self.shown(obj))
        [group] = [tree for tree in part("nodes").used_by(obj) if part("nodes").is_ours_tree(tree)]
        self.assertEqual(part("nodes").image_of(group), obj.vrtm.image)
        self.assertSame(pixels(obj.vrtm.image)[..., :2], delta)

    def test_what_a_linked_mesh_cannot_take_is_said(self):
        obj, _ = self.character()
        bpy.ops.vrtm.set_up()
        obj.vrtm.strain, obj.vrtm.write_strain = "AFTER", True
        self.update()
        self.assertIn("Up to date", self.shown(obj))
        self.refused("cannot take a UV map: press Set Up by Image", bpy.ops.vrtm.set_up_material, by="uv_map")
        self.untouched(obj)
        self.assertEqual(bpy.ops.vrtm.remove_all(), {"FINISHED"})
        self.assertFalse(obj.vrtm.is_set_up)
        self.untouched(obj)
        self.assertFalse([image for image in bpy.data.images if image.name.startswith("vrtm")])

    def test_a_captured_rest(self):
        obj, delta = self.character()
        settings, scene = obj.vrtm, bpy.context.scene
        bpy.ops.vrtm.set_up()
        scene.frame_set(3)
        rest = self.arm.pose(obj)
        [expected], _ = self.expected(obj, rest)
        self.assertGreater(np.abs(expected - delta).max(), 1e-3)
        # A shape that is captured replaces the one before.
        for frame in (3, 2, 3):
            scene.frame_set(frame)
            self.assertEqual(bpy.ops.vrtm.capture_rest(), {"FINISHED"})
            self.update(5)
            self.assertIn(f"Captured at frame {frame}", self.shown(obj))
            self.assertEqual(np.array_equal(pixels(settings.image)[..., :2], expected), frame == 3)
            self.assertEqual([mesh.name for mesh in bpy.data.meshes if mesh.library is None], ["vrtm arm rest"])
        self.untouched(obj)
        settings.live = False
        obj = self.reopened(self.folder)
        self.update()
        self.assertSame(pixels(obj.vrtm.image)[..., :2], expected)
        self.assertEqual(bpy.ops.vrtm.remove_all(), {"FINISHED"})
        self.assertFalse([mesh.name for mesh in bpy.data.meshes if mesh.library is None])
        self.untouched(obj)
