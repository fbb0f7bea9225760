"""The life of objects and files: undo, saving and loading, deleting, renaming, duplicates, modifiers, edits, and the
extension being switched off and on."""

from support import EXTENSION, Arm, Case, bpy, part, poll_until


class Life(Case):
    def solved(self, tiles=1):
        arm = Arm.with_studs(tiles=tiles)
        self.update(5)
        return arm

    def running(self):
        """An arm whose job is under way, and its state."""
        part("session").live_in_background = True
        arm = Arm.with_studs(size=640, live=True)
        bpy.context.scene.frame_set(5)
        state = part("states").find_state(arm.object)
        poll_until(lambda: state.job is not None)
        return arm, state

    def test_undo_and_redo(self):
        arm = self.solved()
        part("session").live_in_background = arm.object.vrtm.live = True
        bpy.ops.ed.undo_push(message="solved")
        uid = arm.object.session_uid
        bpy.data.objects.remove(arm.object)
        bpy.ops.ed.undo_push(message="deleted")
        bpy.ops.ed.undo()
        # The object is another one in memory, and the same one to Blender.
        arm.find()
        self.assertEqual(arm.object.session_uid, uid)
        self.idle()
        self.check(arm)
        self.idle(3)
        self.check(arm)
        bpy.ops.ed.redo()
        self.assertNotIn("arm", bpy.data.objects)
        part("live").poll()
        self.assertEqual(part("states").known, {})

    def test_undo_to_before_a_result_was_written(self):
        arm = self.solved()
        part("session").live_in_background = arm.object.vrtm.live = True
        bpy.context.scene.frame_set(3)
        # The result of this pose is written after the undo step, as it is beside an artist's work.
        bpy.ops.ed.undo_push(message="posed")
        self.idle()
        self.check(arm)
        arm.rig.name = "renamed"
        bpy.ops.ed.undo_push(message="something else")
        bpy.ops.ed.undo()
        arm.find()
        self.idle()
        self.check(arm)

    def test_a_file_is_loaded_while_a_job_runs(self):
        job = self.running()[1].job
        bpy.ops.wm.read_homefile(use_factory_startup=True, use_empty=True)
        self.assertTrue(job.done())
        self.assertEqual((part("states").known, part("session").devices), ({}, {}))
        self.assertFalse(bpy.app.timers.is_registered(part("live").poll))

    def test_an_object_is_deleted_while_its_job_runs(self):
        arm, state = self.running()
        bpy.data.objects.remove(arm.object)
        bpy.data.meshes.remove(arm.mesh)
        part("live").poll()
        self.assertEqual(part("states").known, {})
        self.assertIsNone(state.job)

    def test_a_renamed_object_is_followed_with_its_asset(self):
        arm = self.solved()
        asset = part("states").find_state(arm.object).asset
        arm.object.name, arm.mesh.name = "tentacle", "skin"
        arm.object.vrtm.live = True
        moved, expected = [], arm.asset()
        for frame in (1, 3, 5, 2):
            bpy.context.scene.frame_set(frame)
            moved.append(self.check(arm, expected))
        # At rest nothing moves; bent, texels move by half a texel or more.
        self.assertEqual(moved[0], 0)
        self.assertGreater(min(moved[1:]), 0.5 / arm.size)
        self.assertIs(part("states").find_state(arm.object).asset, asset)

    def test_a_mesh_edit_makes_a_new_asset(self):
        arm = self.solved()
        arm.object.vrtm.live = True
        before = part("states").find_state(arm.object).asset
        bpy.ops.object.mode_set(mode="EDIT")
        self.refused("Edit Mode")
        bpy.ops.mesh.select_all(action="SELECT")
        bpy.ops.mesh.quads_convert_to_tris()
        bpy.context.scene.frame_set(4)
        self.assertIn("Edit Mode", part("states").find_state(arm.object).message)
        bpy.ops.object.mode_set(mode="OBJECT")
        bpy.context.scene.frame_set(5)
        state = part("states").find_state(arm.object)
        self.assertIsNot(state.asset, before)
        self.assertEqual(state.asset.info.faces, 2 * len(arm.faces))
        # A vertex that is moved at rest changes no count.
        before = state.asset
        arm.mesh.shape_keys.key_blocks["Basis"].data[100].co.z += 0.05
        arm.mesh.vertices[100].co.z += 0.05
        arm.mesh.update()
        self.update()
        self.assertIsNot(state.asset, before)
        # Another number of vertices is noticed in any case.
        arm.object.shape_key_clear()
        self.update()
        before = state.asset
        arm.mesh.vertices.add(1)
        arm.mesh.update()
        # As if no handler had heard of it.
        state.mesh_changed = False
        part("solve").run(arm.object, bpy.context.evaluated_depsgraph_get())
        self.assertIsNot(state.asset, before)
        self.assertEqual(state.asset.info.vertices, len(arm.mesh.vertices))

    def test_modifiers_that_change_the_topology(self):
        arm = self.solved()
        modifiers, pose = arm.object.modifiers, arm.pose()
        for kind, works in (
            ("SUBSURF", True),
            ("MIRROR", True),
            ("SOLIDIFY", True),
            ("ARRAY", True),
            ("TRIANGULATE", True),
            ("SCREW", True),
            ("EDGE_SPLIT", True),
            ("BEVEL", False),
            ("REMESH", False),
        ):
            with self.subTest(kind):
                modifiers.new("it", kind)
                self.refused("'it' changes the topology: " + ("press Read Pose" if works else "hide it, or apply it"))
                # In another place than its own where it is not offered.
                if works:
                    self.assertEqual(bpy.ops.vrtm.insert_tap(), {"FINISHED"})
                else:
                    self.refused("hide it, or apply it", bpy.ops.vrtm.insert_tap)
                    tap = modifiers.new("vrtm pose", "NODES")
                    tap.node_group = part("tap").GROUP.tree()
                    modifiers.move(2, 1)
                self.assertEqual([m.name for m in modifiers], ["Armature", "vrtm pose", "it"])
                # In another pose, so that there is something to be done.
                bpy.context.scene.frame_set(2)
                bpy.context.scene.frame_set(5)
                if not works:
                    self.refused("hide it, or apply it")
                    # Hidden, it is out of the way.
                    modifiers["it"].show_viewport = False
                self.update()
                self.check(arm, pose=pose)
                modifiers.remove(modifiers["it"])
                modifiers.remove(modifiers["vrtm pose"])

    def test_what_is_wrong_is_said(self):
        arm, gone = Arm.with_studs(), bpy.data.images.new("gone", 4, 4)
        gone.source, gone.filepath = "FILE", "//nowhere.png"
        settings, mesh = arm.object.vrtm, arm.mesh
        for given, words in (
            ({"rigidity_source": "NONE"}, "choose where the rigidity is painted"),
            ({"rigidity_image": None}, "choose the rigidity image"),
            ({"rigidity_image": gone}, "'gone' has no pixels"),
            ({"uv_map": "other"}, "no UV map 'other'"),
            ({"rest_source": "SHAPE_KEY", "rest_key": "none"}, "no shape key 'none'"),
            ({"rest_source": "CAPTURED"}, "press Capture Rest"),
            ({"mask_source": "ATTRIBUTE", "mask_name": "nothing"}, "no attribute 'nothing'"),
        ):
            with self.set(settings, **given):
                self.refused(words)
        while len(mesh.uv_layers) < 8:
            mesh.uv_layers.new()
        self.refused("eight UV maps already")
        mesh.uv_layers.remove(mesh.uv_layers[7])
        self.update()
        self.assertFalse(part("states").find_state(arm.object).error)
        bpy.context.view_layer.objects.active = arm.rig
        self.assertFalse(bpy.ops.vrtm.update.poll())

    def test_switched_off_nothing_is_left(self):
        import addon_utils

        def ours():
            lists = [getattr(bpy.app.handlers, name) for name in dir(bpy.app.handlers)]
            found = [handler for handlers in lists if isinstance(handlers, list) for handler in handlers]
            return [handler for handler in found if handler.__module__.startswith(EXTENSION)]

        arm, state = self.running()
        job, prepared = state.job, state.prepared
        for again in (False, True):
            session, states, live = part("session"), part("states"), part("live")
            self.assertEqual(len(ours()), len(part("handlers").HANDLERS))
            addon_utils.disable(EXTENSION)
            self.assertEqual(ours(), [])
            self.assertFalse(bpy.app.timers.is_registered(live.poll))
            self.assertEqual((states.known, session.devices), ({}, {}))
            self.assertFalse(hasattr(bpy.types.Object, "vrtm"))
            self.assertFalse(hasattr(bpy.types, "VRTM_PT_main"))
            if not again:
                self.assertTrue(job.done())
                self.assertIsNone(prepared.asset)
            bpy.context.scene.frame_set(4)
            addon_utils.enable(EXTENSION)
            self.assertEqual(arm.object.vrtm.rigidity_image.name, "rigidity")
        if bpy.app.version >= (5, 0, 0):
            # Reload Scripts, with the add-on's modules loaded again. (As a module, Blender 4.2 crashes at its end after
            # this, without any add-on, too.)
            bpy.ops.script.reload()
            self.assertEqual(len(ours()), len(part("handlers").HANDLERS))
            self.assertIsNot(part("states").State, type(state))
        part("session").live_in_background = False
        bpy.context.scene.frame_set(3)
        self.check(arm)
