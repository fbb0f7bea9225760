"""Files that are in the way of a bake: it replaces its own alone, and leaves no file that is damaged."""

import contextlib
import os
import resource
from pathlib import Path

import numpy as np
import pytest

from support import Arm, Case, bpy, each, part, pixels, select

NAME = "arm.redirect.1001.0001.exr"


@contextlib.contextmanager
def limited(size):
    """Files of no more than some bytes: Python and Blender get an error where they write on, as on a full disk."""
    kept = resource.getrlimit(resource.RLIMIT_FSIZE)
    resource.setrlimit(resource.RLIMIT_FSIZE, (size, kept[1]))
    try:
        yield
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, kept)


class Files(Case):
    def setUp(self):
        super().setUp()
        self.folder = self.scratch()
        self.bakes_to(self.folder, 1, 1).overwrite = False

    def arm(self, name="arm"):
        return Arm.with_studs(name, along=12, around=8, size=64)

    def at(self, name=NAME):
        return os.path.join(self.folder, name)

    def put(self, name, content=b"an artist's work"):
        Path(self.at(name)).write_bytes(content)
        return self.at(name)

    def content(self, name=NAME):
        return Path(self.at(name)).read_bytes()

    def picture(self, name, frames=("",)):
        """An image file of the artist's."""
        for frame in frames:
            image = bpy.data.images.new("picture", 8, 8, float_buffer=True)
            image.file_format = "OPEN_EXR"
            image.save(filepath=self.at(name + frame + ".exr"))
            bpy.data.images.remove(image)
        return self.at(name + frames[0] + ".exr")

    def bake_refused(self, *words, bake=bpy.ops.vrtm.bake):
        """Checks that the bake is refused with these words, and that nothing in the folder has changed."""
        before = {name: self.content(name) for name in os.listdir(self.folder)}
        with self.assertRaises(RuntimeError) as caught:
            bake()
        for word in words:
            self.assertIn(word, str(caught.exception))
        self.assertEqual({name: self.content(name) for name in os.listdir(self.folder)}, before)

    def test_a_file_of_others_stays_unless_overwrite_is_on(self):
        self.arm()
        # One file among many is enough.
        bpy.context.scene.frame_end, last = 3, "arm.redirect.1001.0003.exr"
        self.put(last)
        self.bake_refused("arm", last, "switch Overwrite on", "0 frames are written")
        bpy.context.scene.vrtm_bake.overwrite = True
        self.assertEqual(bpy.ops.vrtm.bake(), {"FINISHED"})
        self.assertIn(b"vrtm:kind\0", self.content(last))
        # Its own it replaces.
        bpy.context.scene.vrtm_bake.overwrite = False
        before = self.content()
        bpy.context.scene.frame_set(5)
        self.assertEqual(bpy.ops.vrtm.bake(), {"FINISHED"})
        self.assertEqual(self.content(), before)
        # An EXR of others, as Blender writes it, is none of its own.
        os.replace(self.picture("picture"), self.at())
        self.bake_refused(NAME, "Overwrite")

    def test_what_the_file_reads_is_never_replaced(self):
        def image(arm):
            os.replace(self.picture("skin"), self.at())
            bpy.data.images.load(self.at()).name = "the skin"

        def blend(arm):
            bpy.ops.wm.save_as_mainfile(filepath=self.at("scene.blend"))
            os.symlink(self.at("scene.blend"), self.at())

        def tiles(arm):
            image = bpy.data.images.load(self.picture("skin.", ("1001", "1002")))
            image.source, image.filepath = "TILED", self.at("skin.<UDIM>.exr")
            os.symlink(self.at("skin.1002.exr"), self.at())

        def sequence(arm):
            bpy.data.images.load(self.picture("skin.", ("0001", "0002"))).source = "SEQUENCE"
            os.symlink(self.at("skin.0002.exr"), self.at())

        def library(arm):
            path = self.at("library.blend")
            bpy.ops.wm.save_as_mainfile(filepath=path, copy=True)
            with bpy.data.libraries.load(path, link=True) as (_, into):
                into.meshes = ["arm"]
            os.symlink(path, self.at())

        def cache(arm):
            arm.object.modifiers.new("cache", "MESH_CACHE").filepath = self.put("arm.pc2")
            os.symlink(self.at("arm.pc2"), self.at())

        for kind in (image, blend, tiles, sequence, library, cache):
            with self.subTest(kind.__name__):
                self.setUp()
                arm = self.arm()
                kind(arm)
                bpy.context.scene.vrtm_bake.overwrite = True
                self.bake_refused("arm", "'the skin'" if kind == image else NAME, "which is read")

    @each("names", (("an arm", "an_arm"), ("arm", "Arm")))
    @each("selected", (2, 1))
    def test_two_objects_have_files_of_their_own(self, names, selected):
        for name in names:
            self.arm(name)
        select(*(bpy.data.objects[name] for name in names[:selected]))
        for bake in (bpy.ops.vrtm.bake, bpy.ops.vrtm.bake_basis):
            self.bake_refused(*names, bake=bake)
        self.assertEqual(os.listdir(self.folder), [])

    def test_the_files_say_whose_they_are(self):
        oiio = pytest.importorskip("OpenImageIO")
        self.arm()
        bpy.ops.vrtm.bake()
        file = oiio.ImageInput.open(self.at())
        facts = {a.name: a.value for a in file.spec().extra_attribs if a.name.startswith("vrtm:")}
        self.assertTrue(facts.pop("vrtm:version"))
        expected = {"vrtm:kind": "redirect", "vrtm:form": "delta", "vrtm:mesh": "arm"}
        self.assertEqual(facts, expected | {"vrtm:frame": 1, "vrtm:udim": 1001})
        self.assertEqual(file.read_image("float").shape, (64, 64, 4))
        file.close()

    def test_a_picture_of_any_size_is_read_as_it_was(self):
        rng = np.random.default_rng(1)
        for height, width in ((1, 1), (3, 5), (16, 7), (17, 64), (100, 33)):
            for noise in (False, True):
                picture = rng.standard_normal((height, width, 4)) if noise else np.ones((height, width, 4))
                picture = picture.astype(np.float32)
                Path(self.at()).write_bytes(part("exr").file_of(picture, {}))
                image = bpy.data.images.load(self.at())
                image.colorspace_settings.name, image.alpha_mode = "Non-Color", "CHANNEL_PACKED"
                self.assertSame(pixels(image), picture)
                bpy.data.images.remove(image)

    def test_a_full_disk_leaves_nothing_damaged(self):
        self.arm()
        bpy.ops.vrtm.bake()
        size = len(self.content())
        for limit in (0, 1, 200, 300, 400, size // 2, size - 8, size - 1):
            with self.subTest(limit=limit):
                os.remove(self.at())
                with limited(limit):
                    self.bake_refused(NAME, "File too large")
                self.assertEqual(os.listdir(self.folder), [])
                # The file of before stays.
                bpy.ops.vrtm.bake()
                good = self.content()
                with limited(limit):
                    self.bake_refused(NAME, "File too large")
                self.assertEqual(self.content(), good)

    def test_painted_tiles_that_find_no_room_are_no_maps(self):
        arm = self.arm()
        for floats in (False, True):
            with self.subTest(floats=floats):
                image = bpy.data.images.new("painted", 64, 64, tiled=True, float_buffer=floats)
                image.pixels.foreach_set(np.random.default_rng(1).random(64 * 64 * 4, np.float32))
                image.update()
                arm.object.vrtm.rigidity_image = image
                for limit in (0, 500, 5000):
                    with limited(limit), self.assertRaisesRegex(RuntimeError, "painted tiles cannot be read"):
                        self.update()
                self.update()
