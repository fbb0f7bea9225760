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
        return self.group().inputs["UV"].links[0].from_node

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
        # The artist's own nodes, and by attribute.
        second, own = self.second(arm), self.new("UVMap", uv_map="gone")
        self.tree.links.new(own.outputs["UV"], second.inputs["Vector"])
        self.wrong(arm, "reads UV map 'gone', which the mesh does not have: choose another one there")
        self.tree.nodes.remove(second)
        attribute = self.new("Attribute", attribute_name="lost")
        self.ticked(arm)
        self.tree.links.new(attribute.outputs["Vector"], self.group().inputs["UV"])
        self.wrong(arm, "reads UV map 'lost'")
        # Geometry Nodes may make it.
        arm.object.modifiers.new("it", "NODES")
        self.assertEqual(self.updated(arm)[0], "Not known to be right: see Status")

    def group(self):
        return next(node for node in self.tree.nodes if part("nodes").is_ours(node))

    def new(self, kind, **settings):
        return part("trees").node(self.tree, f"ShaderNode{kind}", 0, 0, **settings)

    @property
    def vector(self):
        """The input of the texture that there was at first."""
        return self.tree.nodes["Image Texture"].inputs["Vector"]

    def textured(self, name, tree=None, socket="Base Color"):
        shader = node_of(tree or nodes_of(bpy.data.materials.new(name)), "ShaderNodeBsdfPrincipled")
        return add_texture(picture(name, studs(64)), shader.inputs[socket])

    def second(self, arm, name="tattoo"):
        """A texture that is added to the material."""
        return self.textured(name, self.tree, "Roughness")

    def other_material(self, arm):
        self.textured("tattoo")
        arm.object.material_slots[0].material = bpy.data.materials["tattoo"]

    def on_half_of_the_faces(self, arm):
        self.textured("tattoo")
        arm.mesh.materials.append(bpy.data.materials["tattoo"])
        for face in arm.mesh.polygons[len(arm.mesh.polygons) // 2 :]:
            face.material_index = 1

    def other_map(self, arm, into):
        """The UVs of another map go into this socket."""
        arm.mesh.uv_layers.new(name="other")
        self.tree.links.new(self.new("UVMap", uv_map="other").outputs["UV"], into)

    def another_map_alone(self, arm):
        bpy.ops.vrtm.clear_material()
        self.other_map(arm, self.vector)
        self.refused("no Image Texture that reads UV map 'UVMap'", bpy.ops.vrtm.set_up_material)

    def mixed(self, arm):
        """Half of the way."""
        operate, others = part("trees").operate, self.new("UVMap").outputs["UV"]
        both = operate(self.tree, "VectorMath", "ADD", 0, 0, self.group().outputs["UV"], others)
        half = operate(self.tree, "VectorMath", "MULTIPLY", 0, 0, both, (0.5, 0.5, 0.5))
        self.tree.links.new(half, self.vector)

    def nested(self, arm):
        """The redirection, muted, within a group of the artist's."""
        outside, tree = self.group(), bpy.data.node_groups.new("own", "ShaderNodeTree")
        for in_out in ("OUTPUT", "INPUT"):
            tree.interface.new_socket("UV", in_out=in_out, socket_type="NodeSocketVector")
        end, ours, begin = (tree.nodes.new(kind) for kind in ("NodeGroupOutput", outside.bl_idname, "NodeGroupInput"))
        ours.node_tree, ours.mute, outside.node_tree = outside.node_tree, True, tree
        for one, other in ((begin, ours), (ours, end)):
            tree.links.new(one.outputs[0], other.inputs[0])
        self.tree.links.new(node_of(self.tree, "ShaderNodeTexCoord").outputs["UV"], outside.inputs["UV"])
        self.tree.links.new(outside.outputs["UV"], self.vector)

    @each(
        "change, words, mended",
        (
            (other_material, "'tattoo' is not redirected: press Set Up by Image", True),
            (on_half_of_the_faces, "'tattoo' is not redirected: press Set Up by Image", True),
            (second, "'tattoo' is not redirected: press Set Up by Image", True),
            (
                lambda self, arm: setattr(self.group().inputs["Strength"], "default_value", 0),
                "at Strength 0: press",
                True,
            ),
            (lambda self, arm: setattr(self.group(), "mute", True), "is redirected by a muted node, 'Group'", True),
            (another_map_alone, "while what is rigid is on 'UVMap': choose 'other' as UV Map", False),
            (lambda self, arm: bpy.ops.vrtm.clear_material(), "'arm albedo' is not redirected", True),
            # Ways that are like these.
            (lambda self, arm: setattr(self.vector.links[0], "is_muted", True), "'arm albedo' is not redirected", True),
            (mixed, "'arm albedo' is redirected in part alone: press Set Up by Image", True),
            (
                lambda self, arm: self.other_map(arm, self.group().inputs["UV"]),
                "at UV map 'other' in place of 'UVMap': choose 'UVMap' in node 'UV Map', or 'other' as UV Map",
                False,
            ),
            (nested, "redirected by a muted node", True),
            (lambda self, arm: self.tree.nodes.remove(self.source()), "at no UV map ('Group'): press Set Up", True),
            (lambda self, arm: setattr(arm.object.vrtm, "write_image", False), "switch Image on in Quality", False),
            (lambda self, arm: arm.object.modifiers.new("it", "UV_WARP"), "'it' moves the UVs, which vrtm", False),
        ),
    )
    def test_a_texture_that_is_not_redirected(self, change, words, mended):
        arm = self.arm()
        self.ticked(arm)
        change(self, arm)
        self.wrong(arm, words)
        if mended:
            bpy.ops.vrtm.set_up_material()
            self.ticked(arm)

    @each("by", ("image", "uv_map"))
    def test_what_needs_no_redirection(self, by):
        arm = self.arm(by=by, along=60, around=40)
        # A texture that nothing shows, one of other coordinates, a slot that no face uses, one of the object's own, and
        # nodes behind the group.
        self.new("TexImage", image=picture("unused", studs(64)))
        self.second(arm, "box").projection = "BOX"
        self.textured("other")
        arm.mesh.materials.append(bpy.data.materials["other"])
        slot, material = arm.object.material_slots[0], arm.object.active_material
        slot.link, slot.material = "OBJECT", material
        mapping = self.new("Mapping")
        mapping.inputs["Scale"].default_value = (2, 3, 1)
        self.tree.links.new(self.group().outputs["UV"], mapping.inputs["Vector"])
        self.tree.links.new(mapping.outputs["Vector"], self.vector)
        self.ticked(arm)
        self.assertEqual(bpy.ops.vrtm.check(), {"FINISHED"})
        self.assertLess(max(part("states").find_state(arm.object).measured.values()), 0.2)
        self.ticked(arm)

    def strength_of_nodes(self, value):
        node = self.new("Value")
        node.outputs[0].default_value = value
        self.tree.links.new(node.outputs[0], self.group().inputs["Strength"])

    def mapping_in_front(self, scale):
        mapping = self.new("Mapping")
        mapping.inputs["Scale"].default_value = (scale, scale, 1)
        self.tree.links.new(node_of(self.tree, "ShaderNodeTexCoord").outputs["UV"], mapping.inputs["Vector"])
        self.tree.links.new(mapping.outputs["Vector"], self.group().inputs["UV"])

    @each("change, off", ((strength_of_nodes, 0.25), (mapping_in_front, 2)))
    def test_what_nodes_do_not_tell_is_measured(self, change, off):
        def number():
            return [len(of) for of in (bpy.data.materials, bpy.data.node_groups, bpy.data.meshes, bpy.data.scenes)]

        arm, before = self.arm(), number()
        change(self, 1)
        self.assertEqual(self.updated(arm), ("Not known to be right: see Status", "ERROR"))
        self.assertIn("press Check the Picture", self.notes(arm.object))
        self.assertEqual(bpy.ops.vrtm.check(), {"FINISHED"})
        self.ticked(arm)
        self.assertEqual(before, number())
        change(self, off)
        bpy.context.view_layer.update()
        self.assertNotEqual(self.line(arm.object)[1], "CHECKMARK")
        # A bake measures it, too, where it is not known.
        self.bakes_to(self.scratch(), 5, 5)
        self.assertEqual(bpy.ops.vrtm.bake(), {"FINISHED"})
        self.assertIn("of the way off the result, as measured", self.notes(arm.object))
        self.refused("'arm albedo' is .* of the way off the result, as measured", bpy.ops.vrtm.check)
        self.wrong(arm, "as measured: press Set Up by Image")
        bpy.ops.vrtm.set_up_material()
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
            ("MULTIRES", lambda it: None),
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
        settings.grid, words = 16, "too small for a grid of 16 cells, and take 256: press Final"
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

    def test_layers_have_one_note_unless_it_names_the_layer(self):
        import vrtm

        of, prepared = [("grid_too_coarse", 0), ("grid_too_coarse", 1), ("nothing_moves", 1)], part("prepared").Prepared
        of.append(("nodes_at_gaps", 0))
        entries = [vrtm.LogEntry("warning", code, 1001, 0, layer, (16.0, 16.0, 64.0), "") for code, layer in of]
        begins = ("Features are too small ", "Tile 1001, layer 1: wha", "Tile 1001: 16 points do not move, where UV")
        for text, begin in zip(prepared(welded=True).notes(entries), begins, strict=True):
            self.assertTrue(text.startswith(begin), text)

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
        for step in range(2):
            bpy.data.objects[name].data.vertices[0].co.x += 0.01
            bpy.data.objects[name].data.update_tag()
            bpy.context.view_layer.update()
            bpy.ops.ed.undo_push(message=f"edit {step}")
            self.idle()
        for step in (*[bpy.ops.ed.undo] * 3, *[bpy.ops.ed.redo] * 3, *[bpy.ops.ed.undo] * 2):
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
        self.assertEqual(part("picture").redirected(arm.object.active_material), [texture])
        count = [len([n for n in tree.nodes if part("nodes").is_ours(n)]) for tree in trees]
        self.assertEqual(count, [1, 0, 0] if wired else [0, 0, 1])
        bpy.ops.vrtm.set_up_material()
        self.assertEqual(sum(len(own.instances(tree)) for tree in trees[:1]), 1)
        # A duplicate has groups of its own.
        bpy.ops.object.duplicate()
        other = bpy.context.view_layer.objects.active
        self.update()
        self.assertEqual(own.of_others(other), [])
        self.assertEqual(own.of_others(arm.object), [])
        self.assertEqual(len(part("picture").redirected(other.active_material)), 1)
        bpy.context.view_layer.objects.active = arm.object
        other.select_set(False)
        bpy.ops.vrtm.clear_material()
        self.assertEqual(part("picture").redirected(arm.object.active_material), [])
        # Others use it, too: it is named, unless its UVs come from outside.
        keep = bpy.data.materials.new("keep")
        nodes_of(keep).nodes.new("ShaderNodeGroup").node_tree = trees[1]
        if wired:
            self.assertEqual(bpy.ops.vrtm.set_up_material(), {"FINISHED"})
            self.ticked(arm)
        else:
            self.refused("in group 'inner|in group 'outer", bpy.ops.vrtm.set_up_material)
