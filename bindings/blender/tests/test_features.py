"""Painted features that are worse than without vrtm: counted, told, and framed in a view, worst first."""

import dataclasses
import types
from unittest import mock

import numpy as np

import test_layers
from support import Arm, Case, bpy, delta, displace, each, evaluated, part, sampled, uv_layer

# Dots across a tile, and the radius of each in UV.
ACROSS, RADIUS = 10, 0.04


class Features(Case):
    def crowd(self, harm=0.0, rigid=1.0):
        """An arm over two tiles with so many dots that some are worse without No Harm, wherever it is."""
        arm = Arm(tiles=2)
        at = (np.arange(arm.size) + 0.5) / arm.size * ACROSS % 1 - 0.5
        distance = np.hypot(at, at[:, None]) / ACROSS
        arm.painted[1001] = rigid * np.clip((RADIUS - distance) * arm.size + 0.5, 0, 1).astype(np.float32)
        arm.paint_image()
        for obj in (arm.object, arm.rig):
            displace(obj)
        arm.object.vrtm.harm, arm.object.vrtm.measure = harm, True
        self.update(5)
        return arm

    def test_they_are_counted_over_all_tiles(self):
        arm = self.crowd()
        state = part("states").find_state(arm.object)
        reports = [tile.report() for tile in state.asset.tiles]
        count, worse, before, after = (
            sum(getattr(report, f"features{name}") for report in reports)
            for name in ("", "_worse", "_strained_before", "_strained_after")
        )
        self.assertEqual((len(reports), count), (2, 2 * ACROSS**2))
        shown = self.shown(arm.object)
        said = f"{worse} of {count} features are worse than without vrtm: press Show Worst Feature"
        strained = f"{before} before, {after} after"
        for text in (said, "Worse", f"{worse} of {count} features", "Over 0.05", strained):
            self.assertIn(text, shown)
        # In Status, in the sidebar, and in the menu, which has it always.
        self.assertEqual(shown.count("Show Worst Feature"), 3)
        number = len(state.features.squeezed)
        self.assertTrue(number > 5 and min(abs(np.log(one.of.after)) for one in state.features.squeezed) > np.log(2))
        self.assertIn(f"Skin is squeezed or stretched more than twice at {number} places", self.notes(arm.object))
        self.assertEqual(shown.count("Show Squeezed Skin"), 2)
        # Many of them take the tick away, and a few do not.
        arm.add_material()
        bpy.ops.vrtm.set_up_material()
        for numbers, icon in (({}, "INFO"), ({"painted": 19, "worse": 1}, "INFO"), ({"painted": 20}, "CHECKMARK")):
            state.features = dataclasses.replace(state.features, **numbers)
            self.assertEqual(self.line(arm.object), ("Up to date", icon))
        self.assertIn("1 of 20 features is worse than without vrtm", self.notes(arm.object))
        # A material by UV map shows other features than those that were counted.
        bpy.ops.vrtm.set_up_material(by="uv_map")
        self.assertNotIn("Worse", self.shown(arm.object))

    @each("harm, rigid, measured, told", ((5, 1, True, "0 of 200 features"), (0, 1, False, None), (0, 0, True, None)))
    def test_nothing_is_told_without_them(self, harm, rigid, measured, told):
        obj = self.crowd(harm, rigid).object
        obj.vrtm.measure = measured
        self.update()
        self.assertEqual(dict(part("status").figures(obj)).get("Worse"), told)
        self.assertNotIn("than without vrtm", self.notes(obj))
        self.assertEqual(self.shown(obj).count("Show Worst Feature"), 1)
        # The skin in such a crowd is another matter.
        self.assertEqual(bpy.ops.vrtm.worst_feature.poll(), bool(rigid))

    def test_the_view_is_turned_to_one_after_another(self):
        from mathutils.interpolate import poly_3d_calc

        arm = self.crowd()
        obj, worst = arm.object, part("states").find_state(arm.object).features.worst
        rises = [one.of.after - one.of.before for one in worst]
        self.assertEqual((rises, min(rises) > 0.02), (sorted(rises, reverse=True), True))
        seen = evaluated(obj)
        matrix, mesh, own, moved = seen.matrix_world, seen.data, uv_layer(arm.mesh, "UVMap"), []
        [area] = part("session").areas("VIEW_3D")
        view = area.spaces.active.region_3d
        view.view_perspective = "CAMERA"

        def seen_at(point):
            """The UV and the normal on the surface at a point, (3,), and its distance."""
            _, on, normal, index = seen.closest_point_on_mesh(point)
            face = mesh.polygons[index]
            weights = np.array(poly_3d_calc([mesh.vertices[vertex].co for vertex in face.vertices], point))
            return weights @ own[list(face.loop_indices)], normal, (on - point).length

        for one in (*worst, worst[0]):
            self.assertEqual(bpy.ops.vrtm.worst_feature(), {"FINISHED"})
            self.assertEqual(view.view_perspective, "PERSP")
            # The place is on the surface, and its texture is the centre of the feature.
            at, normal, off = seen_at(matrix.inverted() @ view.view_location)
            self.assertLess(off, 1e-4)
            centre = np.array((one.of.u, one.of.v))
            tile = int(at[0])
            redirection = delta(obj)[:, tile * arm.size : (tile + 1) * arm.size]
            self.assertLess(np.abs(at + sampled(redirection, at - (tile, 0)) - centre).max(), 0.1 * RADIUS)
            moved.append(np.abs(at - centre).max())
            # The dot is as large as on the arm at rest, or half or twice that, and is seen from outside.
            around = 2 * np.pi * (0.3 - 0.05 * centre[0]) / 0.92
            self.assertLess(abs(np.log2(view.view_distance / 8 / (1.7 * RADIUS * around**0.5))), 1)
            facing = (matrix.to_quaternion() @ normal).dot(view.view_rotation.to_matrix().col[2])
            self.assertGreater(facing, 0.95)
        # So it is with skin that features squeeze or stretch, whose place is its own UV.
        state = part("states").find_state(obj)
        state.looked_at = 0
        for one in state.features.squeezed[:5]:
            self.assertEqual(bpy.ops.vrtm.worst_feature(skin=True), {"FINISHED"})
            at = seen_at(matrix.inverted() @ view.view_location)[0]
            self.assertLess(np.abs(at - (one.of.u, one.of.v)).max(), 1e-3)
            # Its length by differences of the image, which has half of the texels that were looked at.
            tile, redirection = int(at[0]), delta(obj)
            ends = at + np.array([[(-1, 0), (1, 0)], [(0, -1), (0, 1)]]) / 2 / arm.size
            shown = ends + sampled(redirection[:, tile * arm.size : (tile + 1) * arm.size], ends - (tile, 0))
            lengths = 1 / np.linalg.svd((shown[:, 1] - shown[:, 0]) * arm.size, compute_uv=False)
            self.assertGreater((np.log(lengths) / np.log(one.of.after)).max(), 0.5)
            self.assertLess(sampled(np.stack([arm.painted[1001]] * 2, -1), shown.mean((0, 1)) - (tile, 0))[0], 0.75)
        state.looked_at = 1
        # Places by the mesh's own UVs would be others.
        self.assertGreater(max(moved), 0.2 * RADIUS)
        # Without a view it is told.
        area.type = "INFO"
        told = part("operators.solve").VRTM_OT_worst_feature.work(types.SimpleNamespace(skin=False), bpy.context, obj)
        area.type = "VIEW_3D"
        self.assertIn(f"arm: number 2 of the {len(worst)} worst features, at UV {worst[1].of.u:.3f}", told)
        self.assertTrue(told.endswith("there is no 3D view to show it"))

    def test_islands_over_islands_have_places_of_their_own(self):
        import vrtm

        obj = test_layers.Sheets().object
        self.update()
        given = vrtm.WorstFeature(u=0.3, v=0.6, area=0.01, before=0.0, after=0.1, at_border=False)
        with mock.patch.object(vrtm.Tile, "worst_features", lambda tile: [given]):
            places = part("features").fetch(part("states").find_state(obj).prepared).worst
        number = len(obj.data.vertices) // 2
        self.assertEqual([set(place.vertices // number) for place in places], [{0}, {1}])
        # A UV beside all charts has the nearest place.
        triangles = np.array([[(0, 0), (1, 0), (0, 1)], [(1, 0), (1, 1), (0, 1)]], float)
        found, weights = part("strain").located(triangles, np.array([1.1, 0.5]))
        self.assertEqual(found, 1)
        np.testing.assert_allclose(weights @ triangles[1], (1, 0.5), atol=0.1)
