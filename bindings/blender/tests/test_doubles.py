"""Vertices that are double, as files for games have them along seams: one where they follow from the seams alone."""

import numpy as np

from support import Arm, Case, add_key, add_mesh, bending, bpy, delta, each, part, quads, read, select, studs

SIDE = 8


def sheets(*shifts, uvs=(0.1, 0.4), turned=()):
    """Unit sheets at some places along x and z, (x, z), as a mesh: vertices, faces, and UVs, each sheet with its u
    from another place on; those of `turned` have their faces the other way round."""
    line = np.linspace(0, 1, SIDE + 1)
    x, y = (values.ravel() for values in np.meshgrid(line, line))
    points = [np.stack([x + along, y, 0 * x + up], -1) for along, up in shifts]
    faces = [quads(SIDE)[:, :: -1 if k in turned else 1] for k in range(len(shifts))]
    of = [np.stack([u + 0.25 * x, 0.1 + 0.8 * y], -1)[faces[k]] for k, u in zip(range(len(shifts)), uvs)]
    faces = [one + k * len(x) for k, one in enumerate(faces)]
    return np.concatenate(points), np.concatenate(faces), np.concatenate(of).reshape(-1, 2)


def mirrored():
    """A sheet and its mirror image beside it, with the same UVs."""
    points, faces, uvs = sheets((0, 0), (0, 0), uvs=(0.1, 0.1), turned=(1,))
    return points * np.repeat([(1, 1, 1), (-1, 1, 1)], (SIDE + 1) ** 2, 0), faces, uvs


class Doubles(Case):
    def imported(self):
        """The arm with studs on its seam, as files for games have it, with a vertex for each UV, and the same with its
        vertices merged. (As a module, Blender 4.2 crashes at its end after an export of glTF.)"""
        arm = Arm()
        corners = arm.faces.ravel()
        _, first, of = np.unique(np.column_stack([corners, arm.uvs]), axis=0, return_index=True, return_inverse=True)
        split = add_mesh("split", arm.rest()[corners[first]], of.reshape(-1, 4), arm.uvs)
        bpy.data.objects.remove(arm.object)
        bpy.context.view_layer.update()
        merged = bpy.data.objects.new("merged", split.data.copy())
        bpy.context.collection.objects.link(merged)
        merged.location.z = 3
        select(merged)
        bpy.ops.object.mode_set(mode="EDIT")
        bpy.ops.mesh.select_all(action="SELECT")
        bpy.ops.mesh.remove_doubles(threshold=1e-6)
        bpy.ops.object.mode_set(mode="OBJECT")
        at = (np.arange(128) + 0.5) / 128
        values = studs(128)
        for u in (0.46, 0.58, 0.7):
            values[np.hypot(at[None] - u, at[:, None] - 0.96) < 0.04] = 1
        for obj in (split, merged):
            rest = read(obj.data.vertices, "co", 3)
            swollen = rest * (1, 1, 1) + 0.4 * np.exp(-(((rest[:, :1] - 1.2) / 0.25) ** 2)) * rest * (0, 1, 1)
            add_key(obj, "swell", swollen, 1, 5)
            settings = obj.vrtm
            settings.device, settings.grid = "cpu", 128
            arm.object = obj
            arm.painted[1001] = values
            arm.paint_image()
            arm.mesh = obj.data
            arm.mesh.materials.clear()
            arm.add_material()
        return split, merged

    def test_seams_of_an_imported_file_go_on_as_merged_ones(self):
        split, merged = self.imported()
        self.assertGreater(len(split.data.vertices), len(merged.data.vertices))
        found = []
        for obj in (split, merged):
            select(obj)
            obj.vrtm.measure = True
            bpy.context.scene.frame_set(5)
            bpy.ops.vrtm.set_up_material()
            self.update()
            shown = self.figures(obj)
            self.assertEqual(shown["On seams"], "3 features")
            self.assertEqual(shown.get("Doubles"), "40 edges, welded" if obj == split else None)
            self.assertEqual(self.headline(obj), "Up to date")
            self.assertEqual(part("states").find_state(obj).notes, [])
            shut = delta(obj)
            bpy.ops.vrtm.dilate()
            self.update()
            self.assertIn("Seams continue", self.notes(obj))
            self.assertNotIn("On seams", self.figures(obj))
            self.assertFalse(obj.vrtm.goes_on)
            found.append((self.strains(obj), shut, delta(obj)))
        for one, other in zip(*found):
            np.testing.assert_array_equal(one, other)
        self.assertGreater(np.abs(found[0][1] - found[0][2]).max(), 0.01)

    @each(
        "given, seams, cuts, elsewhere",
        (
            # Beside one another: islands, mirrored ones, and a cut within an island.
            ((sheets((0, 0), (1, 0))), SIDE, 0, 0),
            ((sheets((0, 0), (1, 0), uvs=(0.1, 0.35))), 0, SIDE, 0),
            ((mirrored()), SIDE, 0, 0),
            # Shells that touch: one on another, also at the end of a third one, and front and back.
            ((sheets((0, 0), (0, 0))), 0, 0, 2 * (SIDE + 1) ** 2),
            ((sheets((0, 0), (1, 0), (1, 0), uvs=(0.1, 0.4, 0.7))), 0, 0, (SIDE + 1) * (2 * SIDE + 3)),
            ((sheets((0, 0), (0, 0), turned=(1,))), 4 * SIDE, 0, 2 * (SIDE - 1) ** 2),
            ((sheets((0, 0), (2, 0))), 0, 0, 0),
        ),
    )
    def test_seams_are_told_from_cuts_and_shells(self, given, seams, cuts, elsewhere):
        points, faces, uvs = given
        topology = part("geometry").topology(add_mesh("sheets", points, faces, uvs))
        found = part("on_seams").doubles(topology, points)
        self.assertEqual((found.seams.shape[1], found.cuts, found.elsewhere), (seams, cuts, elsewhere))
        self.assertEqual(found.are_of_seams, seams > 0 and not elsewhere)

    @each("given", ("seams", "cuts", "shells"))
    def test_it_is_told_where_it_is_not_known(self, given):
        shifts = ((0, 0), (1, 0), (4, 0), (4, 0))[: 4 if given == "shells" else 2]
        points, faces, uvs = sheets(*shifts, uvs=(0.1, 0.35 if given == "cuts" else 0.4, 0.7, 0.7))
        # The second sheet goes away from the first one, which grows.
        moved = points * (1.2, 1, 1)
        moved[(SIDE + 1) ** 2 : 2 * (SIDE + 1) ** 2, 2] = 0.5
        obj = bending("sheets", points, faces, uvs, moved, studs(128))
        settings, state = obj.vrtm, part("states").state_of(obj)
        settings.seams = "continue"
        self.update(5)
        known = given == "seams"
        self.assertEqual(self.figures(obj)["Doubles"], f"{SIDE} edges, {'welded' if known else 'cut'}")
        told = f"Features end at {SIDE} edges where vertices are double"
        self.assertEqual([told in note for note in state.notes], [not known], state.notes)
        # A figure, a field in Advanced, and one below the note in Status and in the sidebar.
        self.assertEqual(self.shown(obj).count("Doubles"), 4)
        # Either choice takes the note away; of seams that go on it is told where they come apart.
        for choice, frame, apart in (("weld", 1, False), ("weld", 5, given != "cuts"), ("cut", 5, False)):
            settings.weld = choice
            self.update(frame)
            self.assertEqual("comes apart in this pose, at 8 edges" in self.notes(obj), apart)
            self.assertEqual((self.headline(obj), bool(state.notes)), ("Up to date", apart))
