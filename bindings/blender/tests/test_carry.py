"""Things on the skin: objects as a whole, points, hair, instances and detail meshes."""

import os

import numpy as np

from support import Arm, Case, add_mesh, bpy, displace, each, evaluated, part, read, select


def world(obj):
    return np.array(evaluated(obj).matrix_world)


def to_world(obj, points):
    return points @ world(obj)[:3, :3].T + world(obj)[:3, 3]


def drawn(obj):
    """The points of an object in the world."""
    return to_world(obj, read(evaluated(obj).data.attributes["position"].data, "vector", 3))


class Carry(Case):
    def setUp(self):
        super().setUp()
        self.arm = Arm.with_studs()
        self.skin = self.arm.object
        displace(self.skin)
        bpy.context.scene.frame_set(1)

    def on_skin(self, number, height=0.0):
        """Places over the skin at rest, at its faces' centres, and their normals, in its space."""
        faces = self.arm.rest()[self.arm.faces[:: len(self.arm.faces) // number][:number]]
        normals = np.cross(faces[:, 2] - faces[:, 0], faces[:, 3] - faces[:, 1])
        normals /= np.linalg.norm(normals, axis=1, keepdims=True)
        return faces.mean(1) + height * normals, normals

    def in_world(self, places):
        return to_world(self.skin, places)

    def add(self, name, data, place=(0, 0, 0)):
        obj = bpy.data.objects.new(name, data)
        bpy.context.collection.objects.link(obj)
        obj.location = place
        return obj

    def studs(self, number=5, height=0.02):
        places, _ = self.on_skin(number, height)
        return [self.add(f"stud {k}", None, place) for k, place in enumerate(self.in_world(places))]

    def carry(self, *others, operator="carry", **settings):
        select(*others, self.skin)
        return getattr(bpy.ops.vrtm, operator)(**settings)

    def expected(self, places, **settings):
        """By the Python package alone, in the world."""
        asset = self.arm.asset()
        carrier = asset.carrier(positions=places, **settings)
        asset.solve(self.arm.pose(), quality=self.skin.vrtm.quality)
        found = carrier.fetch("positions", "matrices", dtype=np.float64)
        turn = world(self.skin)[:3, :3] / 1.7
        return self.in_world(found.positions), turn @ found.matrices @ turn.T

    def test_objects_follow_the_skin_and_are_put_back(self):
        studs = self.studs()
        studs[1].rotation_mode, studs[1].scale = "QUATERNION", (2, 2, 2)
        bpy.context.view_layer.update()
        before = [(world(stud), stud.matrix_basis.copy(), stud.parent) for stud in studs]
        places, _ = self.on_skin(5, 0.02)
        self.skin.vrtm.live = True
        self.assertEqual(self.carry(*studs), {"FINISHED"})
        for frame in (5, 3):
            bpy.context.scene.frame_set(frame)
            where, turns = self.expected(places)
            for k, stud in enumerate(studs):
                found = world(stud)
                np.testing.assert_allclose(found[:3, 3], where[k], atol=2e-6)
                np.testing.assert_allclose(found[:3, :3], turns[k] @ before[k][0][:3, :3], atol=4e-6)
        # It is carried by what moves the skin as a whole, too.
        self.skin.location.x += 1
        np.testing.assert_allclose(world(studs[0])[:3, 3], where[0] + (1, 0, 0), atol=2e-6)
        self.skin.location.x -= 1
        self.assertEqual(self.carry(*studs[:2], operator="carry_remove"), {"FINISHED"})
        self.assertEqual(len(part("carry").carried_by(self.skin)), 3)
        self.assertEqual(self.carry(operator="carry_remove"), {"FINISHED"})
        for stud, (matrix, basis, parent) in zip(studs, before):
            self.assertEqual((stud.matrix_basis, stud.parent, stud.vrtm_carry.skin), (basis, parent, None))
            self.assertSame(world(stud), matrix)

    @each("frame", (1, 5))
    def test_things_are_bound_where_they_are_seen(self, frame):
        """Placed on the skin in any pose nothing moves, and in other poses it is where the same things bound at rest
        are; a stud that is dragged belongs where it is put."""
        rest, _ = self.on_skin(9, 0.01)
        self.update(frame)
        where, turns = self.expected(rest)
        studs = [self.add(f"stud {k}", None) for k in range(9)]
        for stud, place, turn in zip(studs, where, turns):
            stud.matrix_world = np.block([[2 * turn, place[:, None]], [0, 0, 0, 1]]).T
        mesh = add_mesh("scales", where, [(k, k + 1, k + 2) for k in range(7)])
        # Parts of three vertices each, as many as studs.
        corners = 0.03 * np.array([(1, 0, 0), (0, 1, 0), (-1, -1, 0)])
        parts = add_mesh(
            "parts", (where[:, None] + corners @ np.swapaxes(turns, 1, 2)).reshape(-1, 3), np.arange(27).reshape(9, 3)
        )
        tufts = np.concatenate([where[:, None], where[:, None] + 0.05 * turns[:, None, :, 2]], 1)
        hair = self.hair(tufts)
        # The farthest one from the skin at rest, and all others.
        self.carry(max(studs, key=lambda stud: np.linalg.norm(self.in_world(rest)[studs.index(stud)] - stud.location)))
        self.carry(*studs, hair)
        self.carry(mesh, operator="wrap")
        # A skirt has no effect.
        self.carry(parts, operator="wrap", pieces=True, skirt=0.2)
        sides = np.linalg.norm(corners - np.roll(corners, 1, 0), axis=1)

        def seen():
            bodies = drawn(parts).reshape(9, 3, 3)
            np.testing.assert_allclose(np.linalg.norm(bodies - np.roll(bodies, 1, 1), axis=2), [sides] * 9, rtol=1e-4)
            places = [world(stud)[:3, 3] for stud in studs], drawn(mesh), drawn(hair)[::2]
            return np.concatenate([*places, bodies.mean(1)])

        np.testing.assert_allclose(seen(), np.tile(where, (4, 1)), atol=4e-6)
        # In other poses to a tenth of a cell, since the inverse of the redirection is not exact. Parts go by feet.
        for other in (1, 2, 4, frame):
            self.update(other)
            now, turned = self.expected(rest)
            np.testing.assert_allclose(seen()[:27], np.tile(now, (3, 1)), atol=2.7e-3)
            np.testing.assert_allclose([world(stud)[:3, :3] for stud in studs], 2 * turned, atol=4e-2)
        # Nothing hangs on a line: a parent would draw one to each.
        self.assertFalse([obj for obj in bpy.data.objects if obj.parent == self.skin])
        before = [world(stud) for stud in studs]
        studs[0].location.z += 0.02
        bpy.context.view_layer.update()
        dragged = world(studs[0])
        for other in (frame, 2, frame):
            self.update(other)
        np.testing.assert_allclose(world(studs[0]), dragged, atol=4e-6)
        np.testing.assert_allclose([world(stud) for stud in studs[1:]], before[1:], atol=2e-6)

    def test_a_wrap_moves_each_vertex(self):
        places, _ = self.on_skin(40, 0.01)
        mesh = add_mesh("scales", self.in_world(places), [(k, k + 1, k + 2) for k in range(38)])
        self.assertEqual(self.carry(mesh, operator="wrap", skirt=0.03 * 1.7), {"FINISHED"})
        self.update(5)
        where, _ = self.expected(places, skirt=0.03)
        np.testing.assert_allclose(drawn(mesh), where, atol=4e-6)
        self.carry(operator="carry_remove")
        self.assertEqual((len(mesh.modifiers), len(bpy.data.node_groups)), (0, 0))
        self.assertFalse([name for name in mesh.data.attributes.keys() if name.startswith("vrtm")])

    def instancer(self, places):
        """Points with cubes on them, by Geometry Nodes."""
        obj = add_mesh("scatter", self.in_world(places))
        tree = bpy.data.node_groups.new("scatter", "GeometryNodeTree")
        for in_out in ("INPUT", "OUTPUT"):
            tree.interface.new_socket("Geometry", in_out=in_out, socket_type="NodeSocketGeometry")
        first, end = tree.nodes.new("NodeGroupInput"), tree.nodes.new("NodeGroupOutput")
        on, cube = tree.nodes.new("GeometryNodeInstanceOnPoints"), tree.nodes.new("GeometryNodeMeshCube")
        tree.links.new(first.outputs[0], on.inputs["Points"])
        tree.links.new(cube.outputs[0], on.inputs["Instance"])
        tree.links.new(on.outputs[0], end.inputs[0])
        on.inputs["Rotation"].default_value = (0.4, 0.2, 0.1)
        obj.modifiers.new("scatter", "NODES").node_group = tree
        return obj

    @staticmethod
    def instances():
        graph = bpy.context.evaluated_depsgraph_get()
        return np.array([one.matrix_world.copy() for one in graph.object_instances if one.is_instance])

    def hair(self, points):
        """Curves through points in the world, (curves, points, 3)."""
        curves = bpy.data.hair_curves.new("hair")
        curves.add_curves([points.shape[1]] * len(points))
        curves.attributes["position"].data.foreach_set("vector", points.ravel())
        return self.add("hair", curves)

    def tufts(self, places, normals):
        points = places[:, None] + 0.05 * np.arange(3)[None, :, None] * normals[:, None]
        return self.hair(self.in_world(points.reshape(-1, 3)).reshape(points.shape)), points

    def test_instances_and_hair(self):
        places, normals = self.on_skin(12)
        scatter, (hair, points) = self.instancer(places), self.tufts(places, normals)
        rest = self.instances()
        self.assertEqual(self.carry(scatter, hair), {"FINISHED"})
        for frame in (1, 5):
            self.update(frame)
            self.assertEqual(self.figures(self.skin)["Rims lift off"] == "0", frame == 1)
            where, turns = self.expected(places)
            found = self.instances()
            np.testing.assert_allclose(found[:, :3, 3], where, atol=4e-6)
            np.testing.assert_allclose(found[:, :3, :3], turns @ rest[:, :3, :3], atol=4e-6)
            offsets = self.in_world(points.reshape(-1, 3)).reshape(points.shape) - self.in_world(places)[:, None]
            expected = where[:, None] + np.einsum("nij,nkj->nki", turns, offsets)
            np.testing.assert_allclose(drawn(hair), expected.reshape(-1, 3), atol=6e-6)
        self.carry(operator="carry_remove")
        np.testing.assert_allclose(self.instances(), rest, atol=1e-6)
        self.assertEqual((len(scatter.modifiers), len(hair.modifiers)), (1, 0))

    def test_what_cannot_be_carried_is_told(self):
        far, near, child, keyed, linked = self.studs(5)
        far.location.z += 3
        child.parent = far
        keyed.keyframe_insert("location", frame=1)
        places, _ = self.on_skin(6)
        copied = self.instancer(places)
        self.add("copy", copied.data)
        add_mesh("empty", places[:0])
        linked.constraints.new("COPY_LOCATION")
        others = [obj for obj in bpy.data.objects if obj != self.skin]
        self.assertEqual(self.carry(*others), {"FINISHED"})
        self.assertEqual([obj.name for obj in part("carry").carried_by(self.skin)], [near.name])
        reason = part("carry").reason
        for obj, kind, text in (
            (child, "OBJECT", "parented to stud 0: clear the parent"),
            (keyed, "OBJECT", "keys or drivers"),
            (linked, "OBJECT", "has constraints"),
            (copied, "POINTS", "shares its data"),
            (bpy.data.objects["empty"], "POINTS", "no points of its own"),
            (self.arm.rig, "OBJECT", "moves arm itself"),
            (near, "POINTS", "no points that can be carried"),
        ):
            self.assertIn(text, reason(obj, self.skin, kind))
        self.refused("stud 0 is not bound: its origin is farther than", lambda: self.carry(far))
        # A distance is that of the world, whatever the skin's scale.
        self.refused("farther than 0.03 from", lambda: self.carry(near, farthest=0.03))
        self.carry(near, farthest=0.04)
        # It is where it was, and of some points that are too far it is told how many.
        self.assertIsNone(far.parent)
        places[:2] *= 3
        cloud = add_mesh("cloud", self.in_world(places))
        self.carry(cloud)
        self.update(5)
        self.assertIn("cloud: 2 of 6 are farther than", self.notes(self.skin))
        np.testing.assert_allclose(drawn(cloud)[:2], self.in_world(places)[:2], atol=1e-6)
        cloud.modifiers.new("Armature", "ARMATURE").object = self.arm.rig
        self.assertIn("cloud is deformed by its modifier 'Armature', too: hide it", self.notes(self.skin))

    def test_undo_and_saved_files(self):
        studs, (places, _) = self.studs(), self.on_skin(12)
        place = np.array(studs[0].location)
        add_mesh("cloud", self.in_world(places))
        bpy.ops.ed.undo_push(message="before")
        self.carry(*studs, bpy.data.objects["cloud"])
        self.update(4)

        def all_of():
            cloud = bpy.data.objects["cloud"]
            studs = [world(bpy.data.objects[f"stud {k}"]).ravel() for k in range(5)]
            return np.concatenate([self.arm.pose(cloud).ravel(), *studs])

        carried = all_of()
        bpy.ops.ed.undo_push(message="carried")
        bpy.data.objects["cloud"].data.vertices[0].co.x += 0.01
        bpy.ops.ed.undo_push(message="edit")
        self.update()
        self.assertGreater(np.abs(all_of() - carried).max(), 1e-3)
        bpy.ops.ed.undo()
        self.update()
        self.assertSame(all_of(), carried)
        bpy.ops.vrtm.pack_maps()
        self.reopened()
        self.assertSame(all_of(), carried)
        # It goes on from there, and is put back from there.
        self.update(2)
        self.assertGreater(np.abs(all_of() - carried).max(), 1e-2)
        self.update(4)
        self.assertSame(all_of(), carried)
        bpy.ops.object.select_all(action="DESELECT")
        bpy.ops.vrtm.carry_remove()
        bpy.context.view_layer.update()
        stud = bpy.data.objects["stud 0"]
        self.assertEqual((stud.parent, stud.vrtm_carry.kind), (None, "NONE"))
        self.assertSame(np.array(stud.location), place)

    def test_a_bake_plays_without_the_add_on(self):
        stud, (places, normals) = self.studs(1)[0], self.on_skin(12)
        scatter, (hair, _) = self.instancer(places), self.tufts(places, normals)
        self.carry(stud, scatter, hair)
        folder, scene = self.scratch(), bpy.context.scene
        self.bakes_to(folder, 1, 5)

        def seen():
            return [world(stud), self.instances(), drawn(hair)]

        expected = {}
        for frame in (2, 5):
            self.update(frame)
            expected[frame] = seen()
        self.assertEqual(bpy.ops.vrtm.carry_bake(), {"FINISHED"})
        self.assertEqual(len(os.listdir(folder)), 10)
        self.assertIn("shows a bake", self.notes(self.skin))
        handlers = part("handlers")
        handlers.unregister()
        self.addCleanup(handlers.register)
        for frame in (5, 2, 5):
            scene.frame_set(frame)
            for one, other in zip(seen(), expected[frame]):
                np.testing.assert_allclose(one, other, atol=2e-6)
        scene.frame_set(9)
        # The last one.
        np.testing.assert_allclose(seen()[1], expected[5][1], atol=2e-6)
        scene.frame_set(2)
        self.assertEqual(bpy.ops.vrtm.carry_live(), {"FINISHED"})
        self.update()
        self.assertIsNone(stud.animation_data)
        self.assertFalse([image.name for image in bpy.data.images if image.source == "SEQUENCE"])
        for one, other in zip(seen(), expected[2]):
            np.testing.assert_allclose(one, other, atol=2e-6)
        # What is no bake's is not replaced.
        with open(os.path.join(folder, "hair.carried.points.0003.exr"), "w") as file:
            file.write("mine")
        self.refused("hair.carried.points.0003.exr", bpy.ops.vrtm.carry_bake)
        self.assertFalse(self.skin.vrtm.carried_baked)
        # A bake that is ended leaves nothing.
        os.remove(os.path.join(folder, "hair.carried.points.0003.exr"))
        steps = part("carry_bake").Bake(scene, [self.skin]).steps()
        next(steps)
        self.assertIsNotNone(stud.animation_data)
        steps.close()
        self.assertEqual((stud.animation_data, self.skin.vrtm.carried_baked, scene.frame_current), (None, False, 2))

    def test_the_live_path(self):
        stud, (places, _) = self.studs(1)[0], self.on_skin(1, 0.02)
        self.carry(stud)
        part("session").live_in_background = self.skin.vrtm.live = True
        self.idle(5)
        np.testing.assert_allclose(world(stud)[:3, 3], self.expected(places)[0][0], atol=2e-6)
        # What the add-on has written is no edit.
        bpy.context.view_layer.update()
        self.assertFalse(any(state.wanted for state in part("states").known.values()))
        # Points that are moved by hand are bound anew, where they are.
        cloud = add_mesh("cloud", self.in_world(places))
        self.idle(1)
        self.carry(cloud)
        self.idle(5)
        cloud.data.vertices[0].co.z += 0.01
        cloud.data.update_tag()
        self.idle()
        moved, _ = self.expected(places + world(self.skin)[2, :3] * 0.01 / 1.7**2)
        np.testing.assert_allclose(drawn(cloud), moved, atol=4e-6)
        # A dragged object is bound anew, also if the skin is not live; off the skin it stays, and that is told.
        self.skin.vrtm.live = False
        for way, told in ((0.02, False), (3, True)):
            stud.location.z += way
            self.idle()
            self.assertEqual(part("carry").is_moved(stud), told)
            self.assertEqual("stud 0: 1 of 1 are farther than" in self.notes(self.skin), told)
            where = world(stud)
            self.update()
            np.testing.assert_allclose(world(stud), where, atol=4e-6)

    def test_nothing_is_left_or_lost(self):
        studs, (places, _) = self.studs(3), self.on_skin(4)
        cloud = add_mesh("cloud", self.in_world(places))
        before = [stud.matrix_basis.copy() for stud in studs]
        self.carry(*studs, cloud)
        # Keys that an artist makes meanwhile are the artist's.
        studs[0].keyframe_insert("location", frame=1)
        self.assertIn("stud 0 has keys or drivers of its own", self.notes(self.skin))
        self.carry(studs[0], operator="carry_remove")
        self.assertIsNotNone(studs[0].animation_data.action)
        # In Edit Mode it stays as it is, and is carried again behind it.
        bpy.ops.object.select_all(action="DESELECT")
        bpy.context.view_layer.objects.active = cloud
        bpy.ops.object.mode_set(mode="EDIT")
        bpy.context.view_layer.objects.active = self.skin
        self.update(5)
        bpy.context.view_layer.objects.active = cloud
        bpy.ops.object.mode_set(mode="OBJECT")
        bpy.context.view_layer.objects.active = self.skin
        self.update()
        np.testing.assert_allclose(drawn(cloud), self.expected(places)[0], atol=4e-6)
        # What has a bad point is named.
        cloud.data.vertices[0].co.x = np.nan
        self.refused("cloud: a point of it has no place")
        cloud.data.vertices[0].co = self.in_world(places)[0]
        # Without its skin it can be let go.
        self.update()
        bpy.data.objects.remove(self.skin)
        bpy.ops.object.select_all(action="SELECT")
        self.assertEqual(bpy.ops.vrtm.carry_remove(), {"FINISHED"})
        self.assertEqual([stud.matrix_basis for stud in studs[1:]], before[1:])
        self.assertEqual((len(cloud.modifiers), len(bpy.data.node_groups)), (0, 0))

    def test_a_point_cloud(self):
        places, _ = self.on_skin(8)
        cloud, stud = add_mesh("cloud", self.in_world(places)), self.studs(1)[0]
        before = stud.matrix_basis.copy()
        # An earlier Blender has no point clouds of its own.
        if "POINTCLOUD" in bpy.ops.object.convert.get_rna_type().properties["target"].enum_items:
            select(cloud)
            bpy.ops.object.convert(target="POINTCLOUD")
            cloud = bpy.context.object
        self.assertEqual(self.carry(cloud, stud), {"FINISHED"})
        self.assertEqual([cloud.vrtm_carry.kind, stud.vrtm_carry.kind], ["POINTS", "OBJECT"])
        self.update(5)
        np.testing.assert_allclose(drawn(cloud), self.expected(places)[0], atol=4e-6)
        # Remove All lets them go.
        self.assertNotEqual(stud.matrix_basis, before)
        bpy.ops.vrtm.remove_all()
        self.assertEqual((stud.matrix_basis, stud.parent), (before, None))
