"""No tick over a wrong picture: where what is drawn is not as the result is, the panel has no tick, and says why."""

from support import Arm, Case, add_texture, bpy, each, node_of, nodes_of, part, picture, studs


class Picture(Case):
    def arm(self, name="arm", by="image", **options):
        """An arm at frame 5 whose material is redirected."""
        arm = Arm(name, **{"along": 20, "around": 12, "size": 64, **options})
        arm.object.vrtm.grid = arm.object.vrtm.render_grid = 0
        arm.paint_image(f"{name} rigidity")
        self.tree = arm.add_material(f"{name} skin", picture(f"{name} albedo", studs(64))).id_data
        bpy.context.scene.frame_set(5)
        self.assertEqual(bpy.ops.vrtm.set_up_material(by=by), {"FINISHED"})
        return arm

    def updated(self, arm):
        """Text and icon of the headline after an update."""
        bpy.context.view_layer.objects.active = arm.object
        self.update()
        return self.line(arm.object)

    def ticked(self, arm):
        self.assertEqual(self.updated(arm)[1], "CHECKMARK", self.notes(arm.object))

    def wrong(self, arm, words):
        self.assertEqual(self.updated(arm), ("Not what it should be: see Status", "ERROR"))
        self.assertIn(words, self.notes(arm.object))

    def source(self):
        """The node that the group has its UVs from."""
        group = next(node for node in self.tree.nodes if part("nodes").is_ours(node))
        return group.inputs["UV"].links[0].from_node

    def test_a_uv_map_that_is_renamed_or_replaced(self):
        arm = self.arm()
        layers = arm.mesh.uv_layers
        self.ticked(arm)
        self.assertEqual(self.source().bl_idname, "ShaderNodeTexCoord")
        layers["UVMap"].name = "Main"
        self.ticked(arm)
        other = layers.new(name="other")
        other.active_render = True
        self.ticked(arm)
        layers.remove(layers["Main"])
        layers["other"].active_render = True
        self.ticked(arm)
        self.assertEqual(part("geometry").source_uv_layer(arm.object).name, "other")
        # The result in the place of the texture's.
        layers["vrtm"].active_render = True
        self.wrong(arm, "UV map 'vrtm', which is a result, is the one that renders")

    def test_nodes_that_name_a_map_which_is_not_there(self):
        arm = self.arm()
        settings, layers = arm.object.vrtm, arm.mesh.uv_layers
        bpy.ops.vrtm.clear_material()
        # A map that is chosen is named.
        settings.uv_map = "UVMap"
        bpy.ops.vrtm.set_up_material()
        self.assertEqual(self.source().uv_map, "UVMap")
        self.ticked(arm)
        layers["UVMap"].name = settings.uv_map = "Main"
        self.wrong(arm, "reads UV map 'UVMap', which the mesh does not have: press Set Up by Image")
        bpy.ops.vrtm.set_up_material()
        self.assertEqual(self.source().uv_map, "Main")
        self.ticked(arm)
        # The artist's own nodes, also in groups, and by attribute.
        group = bpy.data.node_groups.new("own", "ShaderNodeTree")
        self.tree.nodes.new("ShaderNodeGroup").node_tree = group
        own = group.nodes.new("ShaderNodeUVMap")
        own.uv_map = "gone"
        self.wrong(arm, "of 'own' reads UV map 'gone', which the mesh does not have: choose another one there")
        own.uv_map = "Main"
        attribute = self.tree.nodes.new("ShaderNodeAttribute")
        attribute.attribute_name = "lost"
        self.ticked(arm)
        ours = next(node for node in self.tree.nodes if part("nodes").is_ours(node))
        self.tree.links.new(attribute.outputs["Vector"], ours.inputs["UV"])
        self.wrong(arm, "reads UV map 'lost'")
        # Geometry Nodes may make it.
        arm.object.modifiers.new("it", "NODES")
        self.ticked(arm)

    def test_modifiers_in_front_of_the_armature(self):
        for kind in ("MIRROR", "SUBSURF", "ARRAY", "SOLIDIFY"):
            with self.subTest(kind):
                arm = self.arm(kind, along=10, around=8)
                obj, modifiers = arm.object, arm.object.modifiers
                obj.vrtm.measure = True
                modifiers.new("it", kind)
                modifiers.move(1, 0)
                # In front of what deforms.
                tap = modifiers.new("vrtm pose", "NODES")
                tap.node_group = part("tap").GROUP.tree()
                modifiers.move(2, 0)
                self.wrong(arm, "'Armature' deforms behind the one that stores the pose: press Read Pose")
                self.assertEqual(bpy.ops.vrtm.insert_tap(), {"FINISHED"})
                self.assertEqual([m.name for m in modifiers], ["it", "Armature", "vrtm pose"])
                self.ticked(arm)
                before, after = self.strains(obj)
                self.assertGreater(before, 0.08)
                self.assertLess(after, 0.5 * before)
                self.assertEqual("makes copies" in self.notes(arm.object), kind in ("MIRROR", "ARRAY"))
                # Where it stands already, and one that is added later, behind it.
                modifiers.new("late", "CAST").factor = 0.1
                self.wrong(arm, "'late' deforms behind")
                bpy.ops.vrtm.insert_tap()
                self.assertEqual([m.name for m in modifiers], ["it", "Armature", "late", "vrtm pose"])
                self.ticked(arm)

    def test_modifiers_that_keep_no_vertices_first(self):
        arm = self.arm()
        modifiers = arm.object.modifiers
        for kind, change in (
            ("MIRROR", lambda it: setattr(it, "use_bisect_axis", (True, False, False))),
            ("SOLIDIFY", lambda it: setattr(it, "use_rim_only", True)),
            ("NODES", lambda it: None),
            ("BEVEL", lambda it: None),
        ):
            it = modifiers.new("it", kind)
            change(it)
            modifiers.move(1, 0)
            self.assertIsNone(part("tap").place(arm.object), kind)
            # In renders alone.
            it.show_viewport = False
            self.assertIsNone(part("tap").place(arm.object), kind)
            self.assertTrue(part("tap").topology_modifiers(arm.object))
            modifiers.remove(it)

    def test_a_uv_map_on_faces_as_large_as_features(self):
        words = "Faces are larger than features, which the UV map cannot follow: press Set Up by Image"
        for along, around, wrong in ((12, 8, True), (60, 40, False)):
            with self.subTest(along=along):
                arm = self.arm(by="uv_map", along=along, around=around)
                arm.object.vrtm.measure = True
                self.assertEqual(self.updated(arm)[1], "INFO" if wrong else "CHECKMARK")
                self.assertEqual(words in self.notes(arm.object), wrong)
                before, after = self.strains(arm.object)
                # With the own UVs it is about what the library has measured, which has more points and directions.
                prepared = part("states").find_state(arm.object).prepared
                own = prepared.strain_of(arm.pose(), prepared.mesh.topology.uvs)
                self.assertAlmostEqual(own, before, delta=0.2 * before)
                # What follows at once, and what the image has.
                bpy.ops.vrtm.set_up_material(by="image")
                self.assertNotIn(words, self.notes(arm.object))
                same, image = self.strains(arm.object)
                self.assertEqual(same, before)
                self.assertLess(image, 0.25 * before)
                self.assertEqual(after > 0.7 * before, wrong)
                self.assertEqual(after < 0.4 * before, not wrong)

    def test_what_is_said_of_mesh_and_maps_lasts(self):
        arm = self.arm()
        settings = arm.object.vrtm
        settings.grid, words = 16, "16 x 16 cells are too few"
        arm.mesh.uv_layers["UVMap"].uv[0].vector = (-0.01, 0.06)
        for frame in (4, 3, 2):
            bpy.context.scene.frame_set(frame)
            self.assertEqual(self.updated(arm)[1], "INFO")
            for said in (words, "faces reach out of their tile"):
                self.assertEqual(self.notes(arm.object).count(said), 1, frame)
        settings.grid = 0
        self.update()
        self.assertNotIn(words, self.notes(arm.object))
        self.assertIn("faces reach out of their tile", self.notes(arm.object))
        arm.mesh.uv_layers["UVMap"].uv[0].vector = (0, 0.04)
        self.ticked(arm)

    def test_nothing_is_said_of_overlaps_that_hold_nothing(self):
        arm = self.arm()
        arm.object.vrtm.overlaps = "fixed"
        # A face over another of the hundreds.
        uvs = arm.mesh.uv_layers["UVMap"].uv
        for corner in range(4):
            uvs[corner].vector = uvs[4 + corner].vector
        self.ticked(arm)
        self.assertNotIn("overlapped", self.notes(arm.object))

    def test_an_uneven_scale(self):
        arm = self.arm()
        arm.object.parent = arm.rig
        for scale, words in (
            ((2, 2, 2), None),
            ((-1, 1, 1), None),
            ((1, 1.5, 1), "Scaled unevenly by its parents or constraints (arm rig)"),
        ):
            arm.rig.scale = scale
            self.ticked(arm) if words is None else self.wrong(arm, words)
        # As much the other way: even in the scene.
        arm.object.scale = (1, 1 / 1.5, 1)
        self.ticked(arm)
        arm.rig.scale = (1, 1, 1)
        self.wrong(arm, "Scaled unevenly, which vrtm does not see")

    @each("by", ("image", "uv_map"))
    def test_a_material_of_another_object(self, by):
        fine = {"along": 60, "around": 40} if by == "uv_map" else {"along": 10, "around": 8}
        arm, other = self.arm("one", by=by, **fine), Arm("other", size=64, **fine)
        other.paint_image("other rigidity")
        other.object.vrtm.grid = 0
        if by == "uv_map":
            other.object.data = other.mesh = arm.mesh
        skin = arm.object.active_material
        other.object.data.materials.append(skin) if by == "image" else None
        bpy.context.view_layer.objects.active = other.object
        self.ticked(other)
        self.assertNotEqual(other.object.active_material, skin)
        self.assertFalse(part("materials").of_others(other.object))
        self.assertEqual(arm.object.active_material, skin)
        self.assertFalse(part("materials").of_others(arm.object))
        # Given to it afterwards, without an update.
        other.object.material_slots[0].material = skin
        self.assertIn("A material shows the redirection of another", self.notes(other.object))
        self.ticked(other)
        self.assertNotEqual(other.object.active_material, skin)

    def test_a_duplicate_after_edits_and_undo(self):
        session = part("session")
        session.live_in_background = True
        arm = self.arm()
        arm.object.vrtm.live = True

        self.idle()
        bpy.ops.ed.undo_push(message="set up")
        bpy.ops.object.duplicate()
        bpy.ops.ed.undo_push(message="duplicate")
        name = bpy.context.view_layer.objects.active.name
        self.idle()
        for step in range(3):
            bpy.data.objects[name].data.vertices[0].co.x += 0.01
            bpy.data.objects[name].data.update_tag()
            bpy.context.view_layer.update()
            bpy.ops.ed.undo_push(message=f"edit {step}")
            self.idle()
        for step in (*[bpy.ops.ed.undo] * 4, *[bpy.ops.ed.redo] * 4, *[bpy.ops.ed.undo] * 3):
            step()
            self.idle()
            for obj in [obj for obj in bpy.data.objects if obj.type == "MESH"]:
                self.assertEqual(part("materials").of_others(obj), [], step)
                self.assertEqual(self.line(obj)[1], "CHECKMARK")
            if name in bpy.data.objects:
                one, two = bpy.data.objects["arm"], bpy.data.objects[name]
                self.assertNotEqual(one.vrtm.image, two.vrtm.image)
                self.assertNotEqual(one.active_material, two.active_material)

    @each("wired", (False, True))
    def test_textures_inside_of_groups(self, wired):
        arm = self.arm()
        bpy.ops.vrtm.clear_material()
        own = part("materials")
        # The texture is in a group in a group; its UVs come from there, or from outside.
        old = node_of(self.tree, "ShaderNodeTexImage")
        image, colour = old.image, old.outputs["Color"].links[0].to_socket
        self.tree.nodes.remove(old)
        trees = [self.tree]
        for name in ("outer", "inner"):
            group = bpy.data.node_groups.new(name, "ShaderNodeTree")
            group.interface.new_socket("Color", in_out="OUTPUT", socket_type="NodeSocketColor")
            group.interface.new_socket("UV", in_out="INPUT", socket_type="NodeSocketVector")
            node = trees[-1].nodes.new("ShaderNodeGroup")
            node.node_tree = group
            begin, end = group.nodes.new("NodeGroupInput"), group.nodes.new("NodeGroupOutput")
            before = trees[-1].nodes.get("Group Input") or trees[-1].nodes.new("ShaderNodeTexCoord")
            if wired:
                trees[-1].links.new(before.outputs["UV"], node.inputs["UV"])
            trees[-1].links.new(node.outputs[0], colour)
            trees.append(group)
            colour = end.inputs[0]
        texture = add_texture(image, colour)
        if wired:
            group.links.new(begin.outputs["UV"], texture.inputs["Vector"])
        self.assertEqual(part("textures").colour_image(arm.object), image)
        self.assertEqual(bpy.ops.vrtm.set_up_material(), {"FINISHED"})
        self.assertEqual(own.redirected(self.tree), [texture])
        count = [len([n for n in tree.nodes if part("nodes").is_ours(n)]) for tree in trees]
        self.assertEqual(count, [1, 0, 0] if wired else [0, 0, 1])
        bpy.ops.vrtm.set_up_material()
        self.assertEqual(sum(len(own._instances(tree)) for tree in trees[:1]), 1)
        # A duplicate has groups of its own.
        bpy.ops.object.duplicate()
        other = bpy.context.view_layer.objects.active
        self.update()
        self.assertEqual(own.of_others(other), [])
        self.assertEqual(own.of_others(arm.object), [])
        self.assertEqual(len(own.redirected(other.active_material.node_tree)), 1)
        bpy.context.view_layer.objects.active = arm.object
        other.select_set(False)
        bpy.ops.vrtm.clear_material()
        self.assertEqual(own.redirected(self.tree), [])
        # Others use it, too: it is named.
        keep = bpy.data.materials.new("keep")
        nodes_of(keep).nodes.new("ShaderNodeGroup").node_tree = trees[1]
        self.refused("in group 'inner|in group 'outer", bpy.ops.vrtm.set_up_material)
