"""The sample with two painted UDIM tiles: at the frame that it opens at, its studs are less strained after Set Up."""

import sample
from support import Case, bpy, part


class Scene(Case):
    def test_set_up_takes_strain_away(self):
        obj = sample.make(self.scratch(), 2)
        settings = obj.vrtm
        settings.device, settings.measure, settings.grid = "cpu", True, 512
        bpy.context.scene.frame_set(20)
        self.assertEqual(bpy.ops.vrtm.set_up(), {"FINISHED"})
        self.assertEqual(self.headline(obj), "Up to date")
        tiles = [tile.report() for tile in part("states").find_state(obj).asset.tiles]
        self.assertEqual([tile.udim for tile in tiles], [1001, 1002])
        for tile in tiles:
            self.assertLess(tile.after.rms, 0.5 * tile.before.rms)
            self.assertEqual(tile.folds, 0)
