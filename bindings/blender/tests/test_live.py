"""The live path: handlers, jobs and the timer's function, which these tests call by hand, as Blender has no event
loop in background mode."""

import threading
from unittest import mock

import numpy as np

from support import Arm, Case, bpy, delta, fill, part, pixels, poll_until


class Live(Case):
    def setUp(self):
        super().setUp()
        self.live, self.states = part("live"), part("states")
        part("session").live_in_background = True

    def patch(self, owner, name, value):
        self.enterContext(mock.patch.object(owner, name, value))

    def followed(self):
        """An arm with the result of frame 2, and a gate: while it is shut, no job ends that is not cancelled."""
        arm = Arm.with_studs(live=True)
        self.idle(2)
        work, gate = part("work").Work, threading.Event()
        tell = work._tell

        def held(job, fraction):
            while not (gate.is_set() or job._given_up.is_set()):
                gate.wait(0.001)
            return tell(job, fraction)

        self.patch(work, "_tell", held)
        self.addCleanup(gate.set)
        return arm, gate

    def test_own_writes_are_not_followed(self):
        arm = Arm.with_studs(live=True)
        self.idle(3)
        state = self.states.find_state(arm.object)
        written = state.shown
        read, reads = self.live.solve.read, []
        self.patch(self.live.solve, "read", lambda *a: reads.append(a) or read(*a))
        for _ in range(5):
            # What the writes have caused was heard of while they were made.
            self.idle()
        self.assertEqual((reads, state.fresh), ([], True))
        # An edit that changes nothing is looked at, and not solved again.
        self.patch(self.live, "Work", None)
        arm.mesh.update_tag()
        self.idle()
        self.assertEqual((len(reads), state.shown, state.error), (1, written, False))
        self.assertTrue(state.fresh)

    def test_a_newer_pose_cancels_the_job(self):
        arm, gate = self.followed()
        jobs = []
        self.patch(self.live, "PATIENCE", 1e9)
        for frame in (3, 4, 5):
            bpy.context.scene.frame_set(frame)
            state = self.states.find_state(arm.object)
            poll_until(lambda state=state: not state.wanted)
            jobs.append(state.job)
        gate.set()
        self.idle()
        self.assertEqual([job.cancelled() for job in jobs], [True, True, False])
        self.check(arm)

    def test_a_steady_scrub_shows_something(self):
        arm, gate = self.followed()
        self.patch(self.live, "PATIENCE", -1.0)
        bpy.context.scene.frame_set(3)
        state = self.states.find_state(arm.object)
        poll_until(lambda: state.job is not None)
        # The handler and the timer return at once, while the solve cannot go on.
        third, job = state.job.request.stamp, state.job
        bpy.context.scene.frame_set(4)
        self.live.poll()
        gate.set()
        poll_until(lambda: state.shown == third)
        self.assertFalse(job.cancelled())
        self.idle()
        self.check(arm)

    def test_a_draft_while_the_pose_moves(self):
        arm, gate = self.followed()
        gate.set()
        state, scene = self.states.find_state(arm.object), bpy.context.scene
        # A solve that is as quick as a frame is no draft.
        self.patch(self.live, "REST", 1e9)
        self.patch(self.live, "FRAME", 1e9)
        self.idle(3)
        self.check(arm)
        self.live.FRAME = 0
        for frame in (4, 5):
            scene.frame_set(frame)
            poll_until(lambda: state.is_draft)
            self.assertEqual(self.headline(arm.object), "Draft while it moves")
            asset = arm.asset()
            asset.solve(arm.pose(), quality="draft")
            self.assertSame(delta(arm.object), arm.delta(asset))
        # Live is off before it is solved again: there is no tick.
        arm.object.vrtm.live = False
        self.assertEqual(self.headline(arm.object), "Out of date: press Update Now")
        arm.object.vrtm.live = True
        # It rests.
        self.live.REST = 0
        self.idle()
        self.check(arm)
        self.assertEqual(self.headline(arm.object), "Up to date")

    def test_what_a_job_has_not_used_is_kept_for_the_next(self):
        arm = Arm.with_studs()
        prepared = part("prepared").Prepared
        apply = prepared.apply

        def fail(*_):
            prepared.apply = apply
            raise MemoryError("once")

        self.patch(prepared, "apply", fail)
        arm.object.vrtm.live = True
        self.idle()
        state = self.states.find_state(arm.object)
        self.assertEqual((state.message, state.asset), ("MemoryError: once", None))
        # Another pose, and nothing that has mesh or maps read again.
        bpy.context.scene.frame_set(5)
        state.mesh_changed = state.maps_changed = False
        self.idle()
        self.check(arm)

    def test_an_edit_that_is_taken_back_while_its_job_is_cancelled(self):
        arm, gate = self.followed()
        image, settings = arm.object.vrtm.rigidity_image, arm.object.vrtm
        state = self.states.find_state(arm.object)
        self.assertEqual((state.inputs.mesh, state.inputs.maps), (None, None))
        shown, painted = state.shown, pixels(image)
        # The job has other maps in the asset when it is cancelled; and then the maps are those of what is shown.
        fill(image, np.ones_like(painted))
        image.update_tag()
        bpy.context.view_layer.update()
        poll_until(lambda: state.job is not None and state.job.applied)
        settings.live = False
        poll_until(lambda: state.job is None)
        gate.set()
        fill(image, painted)
        image.update_tag()
        self.idle()
        self.assertEqual((state.shown, state.fresh), (shown, True))
        self.update(3)
        self.check(arm)
        settings.live = True
        self.idle(4)
        self.check(arm)

    def test_frames_and_poses_of_two_objects_are_followed(self):
        one, two = Arm.with_studs("one", live=True), Arm.with_studs("two", live=True)
        self.assertTrue(bpy.app.timers.is_registered(self.live.poll))
        two.rig.animation_data_clear()
        bend = two.rig.pose.bones["lower"].rotation_euler
        for step in (
            lambda: bpy.context.scene.frame_set(2),
            lambda: bpy.context.scene.frame_set(5),
            # A pose that is edited, without a key.
            lambda: bend.__setitem__(2, 0.7),
        ):
            step()
            bpy.context.view_layer.update()
            # Nothing is written by the handler itself.
            self.assertTrue(self.states.find_state(two.object).wanted)
            self.idle()
            self.check(one)
            self.check(two)
        self.assertNotEqual(one.object.vrtm.image, two.object.vrtm.image)

    def test_paint_is_followed(self):
        arm = Arm.with_studs(live=True)
        self.idle(5)
        arm.painted[1001][40:70, 30:90] = 1
        arm.repaint()
        arm.object.vrtm.rigidity_image.update_tag()
        self.idle()
        self.check(arm)
        # Strokes in Texture Paint mode come as updates of the object.
        bpy.ops.object.mode_set(mode="TEXTURE_PAINT")
        arm.painted[1001][:] = 0
        arm.painted[1001][20:50, 30:90] = 1
        arm.repaint()
        arm.object.update_tag()
        self.idle()
        bpy.ops.object.mode_set(mode="OBJECT")
        self.check(arm)

    def test_weights_that_are_painted_are_followed(self):
        arm = Arm()
        obj, settings = arm.object, arm.object.vrtm
        group, number = obj.vertex_groups.new(name="stiff"), len(arm.mesh.vertices)
        group.add(list(range(0, number, 3)), 1.0, "REPLACE")
        settings.rigidity_source, settings.rigidity_name, settings.live = "VERTEX_GROUP", "stiff", True
        self.idle(5)
        bpy.ops.object.mode_set(mode="WEIGHT_PAINT")
        group.add(list(range(1, number, 3)), 1.0, "REPLACE")
        arm.mesh.update_tag()
        self.idle()
        asset = arm.asset(painted=False)
        asset.set_vertex_rigidity((np.arange(number) % 3 < 2).astype(np.float32))
        self.check(arm, asset)
        bpy.ops.object.mode_set(mode="OBJECT")

    def test_problems_are_told_and_do_not_end_the_timer(self):
        arm, shown = Arm.with_studs(), []
        self.patch(part("messages"), "status", shown.append)
        settings = arm.object.vrtm
        settings.rigidity_source, settings.rigidity_name = "VERTEX_GROUP", "nobody"
        settings.live = True
        self.idle()
        state = self.states.find_state(arm.object)
        self.assertTrue(state.error)
        self.assertIn("no vertex group 'nobody'", state.message)
        self.assertEqual(shown, [f"vrtm: {state.message}"])
        settings.rigidity_source = "IMAGE"
        self.idle()
        self.assertFalse(state.error, state.message)
        self.assertEqual(shown[-1], None)
        self.check(arm)
