"""Strain as colours: closed forms, and what the solve itself measures."""

import numpy as np

from support import Arm, Case, bpy, part, quads, read


def sheet(n=8):
    """A square of quads and, at its end, two triangles: its topology and positions."""
    x, y = np.meshgrid(np.linspace(0, 1, n + 1), np.linspace(0, 1, n + 1))
    points = np.stack([x.ravel(), y.ravel(), 0 * x.ravel()], -1).astype(np.float32)
    faces = quads(n)
    corners = np.concatenate([faces[:-1].ravel(), faces[-1][[0, 1, 2]], faces[-1][[0, 2, 3]]]).astype(np.uint32)
    counts = np.array([4] * (len(faces) - 1) + [3, 3], np.uint32)
    return part("geometry").Topology(
        corners, counts, points[corners][:, :2] * [0.5, 0.25] + 0.1, len(points), b""
    ), points


class Strain(Case):
    def test_a_sheet_that_is_stretched(self):
        topology, rest = sheet()
        turn = np.linalg.qr(np.random.default_rng(2).normal(size=(3, 3)))[0]
        for along, across, shown, expected in (
            (1, 1, None, 0),
            (1.5, 1, None, np.log(1.5)),
            (0.5, 1.2, None, np.log(0.5)),
            (1.1, 1.3, None, np.log(1.3)),
            # What is stretched by 1.5 shows 1.5 times as much of the texture: then nothing is strained.
            (1.5, 0.8, (1.5, 0.8), 0),
            (1.5, 0.8, (1.2, 0.8), np.log(1.5 / 1.2)),
        ):
            jacobians = shown and (lambda at, of=shown: np.broadcast_to(np.diag(of), (len(at), 2, 2)).copy())
            found = part("strain").of_vertices(topology, rest, (rest * [along, across, 1]) @ turn, jacobians)
            self.assertLess(np.abs(found - expected).max(), 1e-5)

    def test_what_has_no_area_is_left_out_and_colours(self):
        topology, rest = sheet()
        flat = rest.copy()
        flat[:9] = flat[0]
        found = part("strain").of_vertices(topology, flat, flat, lambda at: np.zeros((len(at), 2, 2)))
        self.assertTrue(np.isfinite(found).all())
        # The colours of strains.
        found = part("strain").colours(np.array([0, 5, -5, 0.1]))
        self.assertEqual(found.shape, (4, 4))
        self.assertTrue((found[0, :3] == found[0, 0]).all())
        self.assertGreater(found[1, 0], found[1, 2] + 0.5)
        self.assertGreater(found[2, 2], found[2, 0] + 0.5)
        self.assertGreater(found[3, 0], found[3, 2])

    def test_the_overlay_follows_the_result(self):
        arm = Arm.with_studs(along=160, around=96, size=256)
        obj, settings = arm.object, arm.object.vrtm
        bpy.context.scene.frame_set(5)
        # Vertices that are rigid, and away from the borders of features and from the seam.
        at = np.zeros((len(arm.mesh.vertices), 2))
        at[arm.faces.ravel()] = arm.uvs
        inside = part("session").library().rigidity.shrunk(arm.painted[1001], 5) > 0.5
        x, y = np.clip((at * 256).astype(int), 0, 255).T
        rigid = inside[y, x] & (at[:, 1] > 0.1) & (at[:, 1] < 0.9)
        self.assertGreater(rigid.sum(), 200)
        amounts = {}
        for which in ("BEFORE", "AFTER"):
            settings.strain = which
            self.update()
            attribute = arm.mesh.color_attributes["vrtm strain"]
            self.assertEqual((attribute.domain, attribute.data_type), ("POINT", "FLOAT_COLOR"))
            colours = read(attribute.data, "color", 4)
            amounts[which] = np.abs(colours[:, 0] - colours[:, 2])
        self.assertLess(amounts["AFTER"][rigid].mean(), 0.25 * amounts["BEFORE"][rigid].mean())
        self.assertGreater(amounts["BEFORE"][rigid].mean(), 0.2)
        self.assertEqual(arm.mesh.color_attributes.active_color.name, "vrtm strain")
        # What is elastic is grey, and has its colours where it is asked for.
        prepared = part("states").find_state(obj).prepared
        elastic = prepared.rigidity_of_vertices(prepared.asset.corner_uvs()) == 0
        self.assertLess(amounts["AFTER"][elastic].max(), 1e-6)
        settings.strain_of = "SKIN"
        self.update()
        rigid = prepared.rigidity_of_vertices(prepared.asset.corner_uvs())[:, None]
        self.assertLess(np.ptp(read(attribute.data, "color", 4)[rigid[:, 0] == 1, :3], axis=1).max(), 1e-6)
        settings.strain_of = "ALL"
        self.update()
        self.assertGreater(np.abs(np.diff(read(attribute.data, "color", 4)[elastic][:, ::2])).mean(), 0.2)
        settings.strain = "NONE"
        self.assertEqual(len(arm.mesh.color_attributes), 0)
        self.update()
        self.assertEqual(len(obj.data.color_attributes), 0)

    def test_strain_as_data(self):
        arm = Arm.with_studs()
        bpy.context.scene.frame_set(1)
        arm.rig.animation_data_clear()
        arm.object.vrtm.write_strain = True
        for scale, stretch, squash in (((1, 1, 1), 0, 0), ((1.2, 1.2, 1.2), 0.2, 0), ((0.7, 1.2, 0.7), 0.2, 0.3)):
            arm.rig.pose.bones["upper"].scale = scale
            self.update()
            attribute = arm.mesh.attributes["vrtm_strain"]
            self.assertEqual((attribute.domain, attribute.data_type), ("POINT", "FLOAT_VECTOR"))
            # The tube is thinner at its end: what is longer along x is so by a little less along the skin.
            self.assertLess(np.abs(read(attribute.data, "vector", 3) - (stretch, squash, 0)).max(), 2e-3)
        arm.mesh.attributes.remove(attribute)
        self.assertIn("'vrtm_strain' is not there", part("results").missing(arm.object))
        self.update()
        bpy.ops.vrtm.remove_all()
        self.assertNotIn("vrtm_strain", arm.mesh.attributes)

    def test_strain_before_takes_no_rigidity(self):
        arm = Arm()
        arm.object.vrtm.strain = "BEFORE"
        self.update(5)
        self.assertGreater(np.ptp(read(arm.mesh.color_attributes["vrtm strain"].data, "color", 4)[:, 0]), 0.3)
        # Nothing else is written, and the panel does not speak of results.
        self.assertIsNone(arm.object.vrtm.image)
        self.assertEqual([layer.name for layer in arm.mesh.uv_layers], ["UVMap"])
        status = part("status")
        self.assertEqual(status.headline(arm.object, bpy.context.scene).text, "Nothing is rigid yet")
        arm.object.vrtm.strain = "NONE"
        self.refused("choose where the rigidity")
