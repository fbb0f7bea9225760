"""Islands that lie over one another in the UV map, as mirrored halves do: each is solved as if it were alone, has an
image of its own, and shows its own redirection."""

import os

import numpy as np

from support import Case, bending, bpy, delta, each, in_file, part, pixels, quads, read, studs, uv_layer
from test_render import Scene, animation, render

SIDE, SIZE = 24, 96


class Sheets:
    """Square sheets side by side, each bent in a way of its own by a shape key at frame 5. Sheet k lies in the UV tile
    `tiles[k]`, so that (0, 0) is a mirrored pair, and (0, 1) the same pair unwrapped side by side: the texture and the
    rigidity are repeated on all tiles."""

    def __init__(self, tiles=(0, 0)):
        line, one = np.linspace(0, 1, SIDE + 1), quads(SIDE)
        x, y = (values.ravel() for values in np.meshgrid(line, line))
        points, moved, uvs = [], [], []
        for sheet, tile in enumerate(tiles):
            # The second is the mirror image of the first.
            sign, shift = (-1 if sheet == 1 else 1), (1.6 if sheet == 2 else 0)
            points.append(np.stack([sign * x + shift, y, 0 * x], -1))
            bent = (
                (x + 0.25 * np.sin(3 * x) * y, y * (1 + 0.3 * y)),
                (x + 0.1 * np.sin(6 * x), y + 0.15 * np.sin(5 * y)),
                (x * (1 + 0.4 * x), y),
            )[sheet]
            moved.append(np.stack([sign * bent[0] + shift, bent[1], 0 * x], -1))
            uvs.append(np.stack([x * 0.9 + 0.05 + tile, y * 0.9 + 0.05], -1)[one].reshape(-1, 2))
        faces = np.concatenate([one + sheet * len(x) for sheet in range(len(tiles))])
        points, uvs, moved = map(np.concatenate, (points, uvs, moved))
        self.object = bending("sheets", points, faces, uvs, moved, studs(SIZE))
        self.object.vrtm.measure = True
        bpy.context.scene.frame_set(5)


def images_of(obj):
    return part("layers").images_of(obj.vrtm.image)


def moves(obj):
    return float(np.abs(delta(obj)).max())


def attribute(obj, name="vrtm_layer"):
    found = obj.data.attributes.get(name)
    return None if found is None else read(found.data, "value", 1, np.int32).ravel()


def halves(*layers):
    """The expected attribute, by the sheets' layers."""
    return np.repeat(np.array(layers, np.int32), SIDE * SIDE)


class Layers(Case):
    def test_both_halves_keep_their_features_and_fixed_moves_nothing(self):
        obj = Sheets().object
        self.assertEqual(obj.vrtm.overlaps, "each")
        self.update()
        state = part("states").state_of(obj)
        self.assertEqual([image.name for image in images_of(obj)], ["vrtm sheets", "vrtm sheets layer 1"])
        self.assertSame(attribute(obj), halves(0, 1))
        self.assertEqual(len(state.asset.tiles), 2)
        for report in [tile.report() for tile in state.asset.tiles]:
            self.assertLess(3 * report.after.rms, report.before.rms)
        self.assertEqual((dict(state.figures)["Tiles"], dict(state.figures)["Layers"]), ("1", "2"))
        self.assertEqual(state.notes, [])
        kept = [pixels(image) for image in images_of(obj)]
        for image, tile in zip(kept, state.asset.tiles):
            expected = tile.fetch("redirection_delta", SIZE, channels=2, origin="bottom")
            self.assertSame(np.ascontiguousarray(image[..., :2]), expected)
        self.assertGreater(np.abs(kept[0] - kept[1]).max(), 0.01)

        obj.vrtm.overlaps = "fixed"
        self.update()
        self.assertEqual([image.name for image in images_of(obj)], ["vrtm sheets"])
        self.assertEqual(moves(obj), 0)
        self.assertIsNone(attribute(obj))
        self.assertNotIn("vrtm sheets layer 1", bpy.data.images)
        self.assertEqual(*self.strains(obj))
        self.assertNotIn("Layers", self.figures(obj))
        self.assertIn("100 % of what is rigid does not move", self.notes(obj))
        self.assertIn("set Overlaps, in Quality and Outputs, to Each", self.notes(obj))
        # What is told stays while it is so.
        self.update(4)
        self.assertIn("set Overlaps", self.notes(obj))

        obj.vrtm.overlaps = "first_face"
        self.update()
        self.assertGreater(moves(obj), 0.01)
        self.assertNotIn("set Overlaps", self.notes(obj))

        obj.vrtm.overlaps = "each"
        self.update(5)
        self.assertSame(attribute(obj), halves(0, 1))
        for image, expected in zip(images_of(obj), kept):
            self.assertSame(pixels(image), expected)

    def test_islands_side_by_side_have_one_layer_and_the_same_on_the_mesh(self):
        """Corner UVs, and the colours of strains: those of the second half, too."""
        found = []
        for tiles, overlaps in (((0, 0), "each"), ((0, 1), "each"), ((0, 1), "fixed")):
            self.setUp()
            obj = Sheets(tiles).object
            obj.vrtm.overlaps, obj.vrtm.strain = overlaps, "AFTER"
            self.update()
            self.assertEqual(
                (len(images_of(obj)), attribute(obj) is None), (2, False) if tiles == (0, 0) else (1, True)
            )
            moved = uv_layer(obj.data, "vrtm") - uv_layer(obj.data, "UVMap")
            found.append((moved, read(obj.data.attributes["vrtm strain"].data, "color", 4).ravel(), delta(obj)))
        (uvs, colours, _), apart, fixed = found
        for one, other in zip(apart, fixed):
            self.assertSame(one, other)
        self.assertGreater(np.abs(uvs).max(), 0.01)
        self.assertLess(np.abs(uvs - apart[0]).max(), 1e-4)
        # Derivatives are those of the nearest texel, which a rounding changes.
        second = np.abs(colours - apart[1])[len(colours) // 2 :]
        self.assertLess(second.mean(), 0.005)

    def test_three_sheets_and_two_tiles(self):
        obj = Sheets((0, 0, 0)).object
        self.update()
        self.assertSame(attribute(obj), halves(0, 1, 2))
        self.assertEqual(len({pixels(image).tobytes() for image in images_of(obj)}), 3)
        self.setUp()
        obj = Sheets((0, 0, 1)).object
        self.update()
        self.assertSame(attribute(obj), halves(0, 1, 0))
        first, second = (pixels(image)[..., :2] for image in images_of(obj))
        self.assertEqual(first.shape, (SIZE, 2 * SIZE, 2))
        for values, there in ((first[:, :SIZE], True), (first[:, SIZE:], True), (second[:, :SIZE], True)):
            self.assertEqual(np.abs(values).max() > 0.01, there)
        self.assertEqual(np.abs(second[:, SIZE:]).max(), 0)
        self.assertEqual(self.figures(obj)["Tiles"], "2")

    def test_what_is_lost_is_told_and_made_again(self):
        obj = Sheets((0, 0, 0)).object
        self.update()
        kept = [pixels(image) for image in images_of(obj)]
        for lose, told in (
            (lambda: bpy.data.images.remove(images_of(obj)[1]), "The result image of a layer is not there"),
            (lambda: bpy.data.images.remove(images_of(obj)[2]), "The result image of a layer is not there"),
            (lambda: obj.data.attributes.remove(obj.data.attributes["vrtm_layer"]), "tells layers apart is not there"),
        ):
            lose()
            self.assertIn(told, part("results").missing(obj))
            # As a frame that is rendered finds out.
            part("solve").run(obj, bpy.context.evaluated_depsgraph_get())
            self.assertIsNone(part("results").missing(obj))
            self.assertSame(attribute(obj), halves(0, 1, 2))
            for image, expected in zip(images_of(obj), kept, strict=True):
                self.assertSame(pixels(image), expected)
            self.assertEqual(len([i for i in bpy.data.images if i.name.startswith("vrtm")]), 3)


class SheetsScene(Scene):
    def sheets(self, tiles=(0, 0), by="image"):
        """With their material, and by None without its redirection."""
        obj = Sheets(tiles).object
        obj.vrtm.measure = False
        texture = self.material(obj)[1]
        texture.interpolation = "Closest"
        texture.image.pack()
        self.camera(*(((0, 0.6), 2.8) if len(tiles) == 2 else ((0.8, 0.6), 4.4)))
        if by is not None:
            self.assertEqual(bpy.ops.vrtm.set_up_material(by=by), {"FINISHED"})
        return obj

    def assertLooksLike(self, one, other):
        """The texture is black and white, so that rounding turns whole pixels; a few of them."""
        self.assertLess((np.abs(one - other).max(-1) > 0.02).mean(), 2e-3)

    def assertDiffers(self, one, other):
        self.assertGreater((np.abs(one - other).max(-1) > 0.3).mean(), 0.02)


class Pictures(SheetsScene):
    @each("by", ("image", "uv_map"))
    @each("tiles, apart", (((0, 0), (0, 1)), ((0, 0, 1), (0, 1, 2))))
    def test_each_half_shows_its_own_redirection(self, by, tiles, apart):
        self.sheets(apart, by)
        expected = render()
        self.setUp()
        obj = self.sheets(tiles, by)
        self.assertLooksLike(render(), expected)
        if by == "uv_map":
            return
        # The other way round, and with one redirection for both, it is another picture.
        kept = attribute(obj)
        obj.vrtm.in_renders = False
        for values in (1 - kept, 0 * kept, 0 * kept + 1):
            obj.data.attributes["vrtm_layer"].data.foreach_set("value", values)
            obj.data.update_tag()
            self.assertDiffers(render(), expected)

    def test_a_render_follows_the_setting(self):
        """Live is off, so that the frame that is rendered is the first to hear of it."""
        obj = self.sheets()
        each = render()
        for overlaps, looks in (("fixed", False), ("each", True), ("first_face", False), ("each", True)):
            obj.vrtm.overlaps = overlaps
            found = render()
            (self.assertLooksLike if looks else self.assertDiffers)(found, each)
            self.assertEqual(len(images_of(obj)), 2 if looks else 1)
        self.update()
        self.assertEqual(len([i for i in bpy.data.images if i.name.startswith("vrtm")]), 2)

    def test_it_is_saved_and_opened_again(self):
        obj = self.sheets()
        expected, kept = render(), [pixels(image) for image in images_of(obj)]
        obj = self.reopened(name="sheets")
        obj.vrtm.in_renders = False
        self.assertIsNone(part("results").missing(obj))
        self.assertEqual(len(images_of(obj)), 2)
        for image, values in zip(images_of(obj), kept):
            self.assertSame(pixels(image), in_file(values))
        self.assertSame(attribute(obj), halves(0, 1))
        self.assertLooksLike(render(), expected)

    @each(
        "tiles, places",
        (
            ((0, 0), ["1001", "1001.layer1"]),
            ((0, 1), ["1001", "1002", "tiles"]),
            ((0, 0, 1), ["1001", "1001.layer1", "1002", "tiles", "tiles.layer1"]),
        ),
    )
    def test_baked_files_render_as_the_live_result_does(self, tiles, places):
        obj, scene = self.sheets(tiles), bpy.context.scene
        scene.frame_start = 4
        live = animation()
        scene.vrtm_bake.directory = self.scratch()
        self.refused("bake first", bpy.ops.vrtm.use_baked)
        self.assertEqual(bpy.ops.vrtm.bake(), {"FINISHED"})
        names = {f"sheets.redirect.{place}.{frame:04d}.exr" for place in places for frame in (4, 5)}
        self.assertEqual(set(os.listdir(scene.vrtm_bake.directory)), names)
        self.assertEqual(bpy.ops.vrtm.use_baked(), {"FINISHED"})
        # Nothing of the result images is shown any more.
        for image in images_of(obj):
            image.pixels.foreach_set(np.zeros(len(image.pixels), np.float32))
        for frame, baked in animation().items():
            self.assertSame(live[frame], baked)
        # An update for one layer leaves what the baked files need.
        obj.vrtm.overlaps = "fixed"
        self.update()
        self.assertSame(render(), baked)
        # A file that is gone is told, also if it is that of another layer.
        scene.frame_set(4)
        self.assertEqual(self.headline(obj), "Shows baked files")
        os.remove(os.path.join(scene.vrtm_bake.directory, f"sheets.redirect.{places[-1]}.0004.exr"))
        self.assertEqual(self.headline(obj), "Frame is not baked: see Status")
        obj.vrtm.overlaps = "each"
        self.assertEqual(bpy.ops.vrtm.use_live(), {"FINISHED"})
        scene.frame_set(5)
        self.assertSame(render(), baked)

    def test_a_bake_of_other_layers_than_the_result_has_is_refused(self):
        obj = self.sheets()
        bpy.context.scene.vrtm_bake.directory = self.scratch()
        obj.vrtm.overlaps = "fixed"
        self.update()
        obj.vrtm.overlaps = "each"
        self.assertEqual(bpy.ops.vrtm.bake(), {"FINISHED"})
        self.refused("other layers than what was baked: press Update Now", bpy.ops.vrtm.use_baked)
        self.update()
        self.assertEqual(bpy.ops.vrtm.use_baked(), {"FINISHED"})

    @each("linked", (False, True))
    def test_duplicates_are_their_own_and_nothing_is_left(self, linked):
        images, attributes = set(bpy.data.images.keys()), None
        obj = self.sheets()
        attributes = {a.name for a in obj.data.attributes} - {"vrtm", "vrtm_layer"}
        first, kept = render(), [pixels(image) for image in images_of(obj)]
        bpy.ops.object.duplicate(linked=linked)
        other = bpy.context.view_layer.objects.active
        other.location.y = 5
        if linked:
            # The same faces in the same layers: the other object's own attribute tells so, too.
            other.vrtm.map_size = other.vrtm.render_map_size = 64
        self.update()
        own = images_of(other)
        self.assertEqual(len(own), 2)
        self.assertFalse(set(own) & set(images_of(obj)))
        for image, values in zip(images_of(obj), kept):
            self.assertSame(pixels(image), values)
        name = part("layers").attribute_name(other.vrtm)
        self.assertEqual(name == "vrtm_layer", not linked)
        self.assertSame(attribute(other, name), halves(0, 1))
        for one in (obj, other):
            self.assertIsNone(part("results").missing(one))
        self.assertLooksLike(render(), first)
        # One of them for Fixed: the other is as it was.
        other.vrtm.overlaps = "fixed"
        self.update()
        self.assertIsNone(attribute(other, name))
        self.assertLooksLike(render(), first)
        other.vrtm.overlaps = "each"
        self.update()
        self.assertEqual(bpy.ops.vrtm.remove_all(), {"FINISHED"})
        self.assertSame(attribute(obj), halves(0, 1))
        self.assertIsNone(part("results").missing(obj))
        bpy.context.view_layer.objects.active = obj
        self.assertEqual(bpy.ops.vrtm.remove_all(), {"FINISHED"})
        self.assertEqual({a.name for a in obj.data.attributes}, attributes)
        self.assertEqual({a.name for a in other.data.attributes}, attributes)
        left = set(bpy.data.images.keys()) - images - {"Render Result", "albedo", "rigidity"}
        self.assertEqual(left, set())
        # Blender 4.2 goes on counting a user of a group that nothing uses any more.
        groups = [tree for tree in bpy.data.node_groups if tree.get("vrtm_kind")]
        self.assertEqual([users for users in bpy.data.user_map(subset=groups).values() if users], [])
