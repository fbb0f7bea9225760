"""The panels, drawn into a stand-in of Blender's layout: there is no window in background mode. Each property,
operator, collection and icon that they name has to be there, and drawing must not change anything."""

import types

from support import PANELS, Arm, Case, bpy, part


class Panel(Case):
    def test_all_that_the_panels_name_is_there(self):
        arm = Arm()
        obj, settings = arm.object, arm.object.vrtm
        shown = self.shown(obj)
        self.assertIn("Update Now", shown)
        # The first button of the menu Set Up lies under the mouse when it opens: Paint It is the last one.
        self.assertEqual(self.shown(obj, (), ("begin",)), ["From Texture", "From Geometry", "Paint It"])
        for source in ("NONE", "IMAGE", "VERTEX_GROUP", "ATTRIBUTE"):
            settings.rigidity_source = settings.mask_source = source
            self.shown(obj)
        for rest in ("MESH", "SHAPE_KEY", "CAPTURED"):
            settings.rest_source = rest
            shown = self.shown(obj)
        self.assertIn("Capture Rest", shown)
        obj.shape_key_clear()
        settings.rest_source = "SHAPE_KEY"
        self.assertIn("The mesh has no shape keys", self.shown(obj))

    def test_results_and_problems_are_shown(self):
        arm = Arm()
        obj, settings = arm.object, arm.object.vrtm
        settings.rest_source = "CAPTURED"
        self.refused("choose where")
        self.assertIn("arm: choose where the rigidity is painted", self.shown(obj))
        arm.paint_image()
        settings.measure = True
        bpy.context.scene.frame_set(5)
        bpy.ops.vrtm.capture_rest()
        self.update(2)
        shown = self.shown(obj)
        for text in ("Captured at frame 5", "Up to date", "Time", "Strain", "Folds", "Redirection"):
            self.assertIn(text, shown)
        # Where no view shows the result, that is said.
        words = "Solid view does not show the result: see it in Material Preview (press Z)"
        self.assertIn(words, shown)
        part("session").areas("VIEW_3D")[0].spaces.active.shading.type = "MATERIAL"
        self.assertNotIn(words, self.shown(obj))
        obj.modifiers.new("it", "SUBSURF")
        shown = self.shown(obj)
        self.assertIn("it changes the topology", shown)
        self.assertIn("Read Pose", shown)

    def test_only_meshes_have_it(self):
        arm = Arm()
        for obj in (arm.rig, None):
            context = types.SimpleNamespace(object=obj)
            self.assertFalse(any(getattr(bpy.types, f"VRTM_PT_{name}").poll(context) for name in PANELS))
