"""An object as a whole: set up at one click, presets, duplicates, strength, and nothing left after Remove All."""

import numpy as np

import sample
from support import Arm, Case, bpy, each, fill, nodes_of, part, picture, pixels, studs


class Objects(Case):
    def arm(self, name="arm", kind=Arm):
        arm = kind(name)
        arm.add_material()
        return arm

    def groups(self, obj):
        return [node for node in obj.active_material.node_tree.nodes if node.bl_idname == "ShaderNodeGroup"]

    def test_one_click(self):
        arm = self.arm()
        obj, settings = arm.object, arm.object.vrtm
        self.assertEqual(bpy.ops.vrtm.set_up(), {"FINISHED"})
        self.assertTrue(settings.live)
        self.assertEqual(tuple(settings.rigidity_image.size), (1024, 1024))
        self.assertEqual(len(self.groups(obj)), 1)
        # Again, with an image that is painted: nothing is made anew.
        arm.paint_image()
        bpy.ops.vrtm.set_up()
        self.assertEqual(len(self.groups(obj)), 1)
        self.assertEqual(settings.rigidity_image.name, "rigidity")

    def test_one_click_takes_what_is_there(self):
        """A rigidity, and of materials those with a texture."""
        arm, image = self.arm(), picture("arm Rigidity mask", studs(128))
        plain = bpy.data.materials.new("plain")
        nodes_of(plain)
        arm.mesh.materials.append(plain)
        self.assertEqual(bpy.ops.vrtm.set_up(), {"FINISHED"})
        self.assertEqual((len(self.groups(arm.object)), arm.object.vrtm.rigidity_image), (1, image))
        other = Arm("other")
        for _ in range(2):
            self.assertEqual(bpy.ops.vrtm.set_up(), {"FINISHED"})
            self.assertTrue(other.object.vrtm.live)
            other.mesh.materials.append(plain)
        # A material that is this object's and another's was not copied for nothing.
        self.assertEqual(other.object.active_material, plain)

    def test_the_sample(self):
        obj = sample.make()
        obj.vrtm.device, obj.vrtm.measure, obj.vrtm.grid = "cpu", True, 256
        bpy.context.scene.frame_set(20)
        self.assertEqual(bpy.ops.vrtm.set_up(), {"FINISHED"})
        self.assertEqual(self.headline(obj), "Up to date")
        report = part("states").find_state(obj).asset.tiles[0].report()
        self.assertLess(report.after.rms, 0.5 * report.before.rms)
        self.assertEqual(report.folds, 0)

    def test_presets(self):
        arm = Arm()
        settings = arm.object.vrtm
        find = part("operators.objects").preset_of
        for name in ("scrub", "work", "final"):
            bpy.ops.vrtm.preset(name=name)
            self.assertEqual(find(settings), name)
        settings.grid = 100
        self.assertIsNone(find(settings))

    @each("by", ("image", "uv_map"))
    @each("linked", (False, True))
    def test_a_duplicate_is_its_own(self, by, linked):
        arm = self.arm(kind=Arm.with_studs)
        obj = arm.object
        bpy.context.scene.frame_set(5)
        bpy.ops.vrtm.set_up_material(by=by)
        first = pixels(obj.vrtm.image)
        bpy.ops.object.duplicate(linked=linked)
        other = bpy.context.view_layer.objects.active
        self.assertNotEqual(other, obj)
        self.assertIn("is that of 'arm'", part("results").missing(other))
        rig = arm.rig.copy()
        bpy.context.collection.objects.link(rig)
        rig.animation_data_clear()
        rig.pose.bones["lower"].rotation_euler[2] = 0.3
        other.modifiers["Armature"].object = rig
        self.update()
        self.assertNotEqual(other.vrtm.image, obj.vrtm.image)
        self.assertSame(pixels(obj.vrtm.image), first)
        self.assertGreater(np.abs(pixels(other.vrtm.image) - first).max(), 1e-3)
        self.check(arm, obj=other)
        self.assertEqual(other.vrtm.uv_name, f"vrtm {other.name}" if linked else "vrtm")
        # Results among the UV maps are never taken for the texture's.
        other.data.uv_layers["vrtm"].active_render = True
        self.assertEqual(part("geometry").source_uv_layer(other).name, "UVMap")
        if by == "image" or linked:
            self.assertNotEqual(other.active_material, obj.active_material)
        nodes = part("nodes")
        for one in (obj, other):
            tree = self.groups(one)[0].node_tree
            if by == "image":
                self.assertEqual(nodes.image_of(tree), one.vrtm.image)
            else:
                self.assertTrue(nodes.is_by_uv_map(tree, one.vrtm.uv_name))

    def test_nothing_is_left(self):
        arm = self.arm()
        obj, mesh = arm.object, arm.mesh

        def names():
            nodes = obj.active_material.node_tree.nodes
            own = (mesh.uv_layers, mesh.attributes, obj.modifiers, bpy.data.images, nodes)
            return [sorted(one.name for one in of) for of in own]

        kept = names()
        image = arm.paint_image()
        obj.vrtm.write_strain = True
        obj.vrtm.seams = "continue"
        obj.modifiers.new("it", "SUBSURF")
        bpy.ops.vrtm.insert_tap()
        bpy.context.scene.frame_set(5)
        bpy.ops.vrtm.capture_rest()
        obj.vrtm.rest_source, obj.vrtm.strain = "MESH", "AFTER"
        bpy.ops.vrtm.set_up_material(by="uv_map")
        bpy.ops.vrtm.set_up_material()
        bpy.ops.vrtm.dilate()
        self.update()
        self.assertIn("vrtm_strain", mesh.attributes)
        self.assertEqual(bpy.ops.vrtm.remove_all(), {"FINISHED"})
        obj.modifiers.remove(obj.modifiers["it"])
        kept[3] = sorted([*kept[3], image.name])
        self.assertEqual(names(), kept)
        self.assertEqual([tree.name for tree in bpy.data.node_groups if tree.get("vrtm_kind")], [])
        self.assertFalse(obj.vrtm.is_set_up)
        self.assertEqual(part("states").known, {})

    def test_one_click_on_all_that_is_selected(self):
        arms = [self.arm("one"), self.arm("two")]
        broken = Arm("broken")
        broken.mesh.uv_layers.remove(broken.mesh.uv_layers[0])
        for obj in [*(arm.object for arm in arms), broken.object]:
            obj.select_set(True)
        # What is wrong with one is told, and the others are set up.
        self.assertEqual(bpy.ops.vrtm.set_up(), {"FINISHED"})
        for arm in arms:
            self.assertEqual(len(self.groups(arm.object)), 1)
            self.assertTrue(arm.object.vrtm.live)
        self.assertNotEqual(*(arm.object.vrtm.rigidity_image for arm in arms))
        self.assertFalse(broken.object.vrtm.is_set_up)
        self.assertIn("no UV map", part("states").find_state(broken.object).message)

    def test_without_a_rigidity_one_is_asked(self):
        arm = self.arm()
        fill(bpy.data.images["albedo"], studs(128))
        # What the menu's buttons do.
        self.assertEqual(bpy.ops.vrtm.rigidity_from_texture(set_up=True), {"FINISHED"})
        self.assertEqual((len(self.groups(arm.object)), arm.object.vrtm.live), (1, True))
        self.assertEqual(self.line(arm.object), ("Up to date", "CHECKMARK"))
        other = self.arm("other")
        self.assertEqual(bpy.ops.vrtm.set_up(paint=True), {"FINISHED"})
        self.assertEqual(other.object.mode, "TEXTURE_PAINT")
        bpy.ops.object.mode_set(mode="OBJECT")
        self.assertEqual(bpy.context.scene.tool_settings.image_paint.canvas, other.object.vrtm.rigidity_image)
        # Blender keeps other properties for the next press, as if the answer were one for good, and for all objects.
        for operator, name in ((bpy.ops.vrtm.set_up, "paint"), (bpy.ops.vrtm.rigidity_from_texture, "image")):
            self.assertTrue(operator.get_rna_type().properties[name].is_skip_save)
        # No tick while nothing is rigid.
        self.assertEqual(self.line(other.object), ("Nothing is rigid yet: see Status", "INFO"))

    def test_what_scripts_do_is_an_undo_step(self):
        self.arm(kind=Arm.with_studs)

        def groups():
            return len(self.groups(bpy.data.objects["arm"]))

        for operator, options, left in (
            ("set_up", {}, 1),
            ("clear_material", {}, 0),
            ("set_up_material", {"by": "uv_map"}, 1),
            ("dilate", {}, 1),
            ("remove_all", {}, 0),
        ):
            with self.subTest(operator):
                before = groups()
                bpy.ops.ed.undo_push(message="before")
                self.assertEqual(getattr(bpy.ops.vrtm, operator)(**options), {"FINISHED"})
                bpy.data.objects["arm"].data.vertices[0].co.x += 0.1
                bpy.ops.ed.undo_push(message="edit")
                # The edit alone is taken back, and then the operator.
                bpy.ops.ed.undo()
                self.assertEqual(groups(), left)
                bpy.ops.ed.undo()
                self.assertEqual(groups(), before)
                bpy.ops.ed.redo()
                self.assertEqual(groups(), left)
