"""The scene of the pictures, small: two painted UDIM tiles on an arm that bends. The studs on the redirected picture
are less strained, and the picture changes where studs are only."""

import tempfile

import numpy as np

import sample
from support import Case, bpy, part


class Scene(Case):
    def test_before_and_after(self):
        with tempfile.TemporaryDirectory() as folder:
            obj = sample.make(folder, 2, 96, 1)
            sample.pictures(obj, f"{folder}/before.png", f"{folder}/after.png")
            pictures = []
            for name in ("before", "after"):
                image = bpy.data.images.load(f"{folder}/{name}.png")
                pictures.append(np.array(image.pixels[:]).reshape(72, 96, 4))
            self.assertGreater((np.abs(pictures[0] - pictures[1]).max(-1) > 0.1).mean(), 0.05)
            # The background, at the top, is no part of it.
            self.assertEqual(np.abs(pictures[0] - pictures[1])[-5:].max(), 0)
            tiles = [tile.report() for tile in part("states").find_state(obj).asset.tiles]
            self.assertEqual([tile.udim for tile in tiles], [1001, 1002])
            for tile in tiles:
                self.assertLess(tile.after.rms, 0.5 * tile.before.rms)
                self.assertEqual(tile.folds, 0)
