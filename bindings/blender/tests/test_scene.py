"""The sample: at the frame that it opens at, its studs are less strained after Set Up."""

import sample
from support import Case, bpy, part


class Scene(Case):
    def test_set_up_takes_strain_away(self):
        obj = sample.make()
        settings = obj.vrtm
        settings.device, settings.measure, settings.grid = "cpu", True, 512
        bpy.context.scene.frame_set(20)
        self.assertEqual(bpy.ops.vrtm.set_up(), {"FINISHED"})
        self.assertEqual(self.headline(obj), "Up to date")
        report = part("states").find_state(obj).asset.tiles[0].report()
        self.assertLess(report.after.rms, 0.5 * report.before.rms)
        self.assertEqual(report.folds, 0)
