"""The panels, drawn into a stand-in of Blender's layout: there is no window in background mode. Each property,
operator, collection and icon that they name has to be there, and drawing must not change anything."""

import types

from support import Arm, Case, bpy, part

ICONS = set(bpy.types.UILayout.bl_rna.functions["prop"].parameters["icon"].enum_items.keys())
PANELS = ("main", "quality", "advanced", "strain", "material", "bake", "status", "view")
MENUS = ("rigidity", "begin", "object")


class Layout:
    """Takes what UILayout takes, as far as the panels use it, and writes down what would be shown."""

    def __init__(self, shown):
        self.shown = shown

    def _part(self, **options):
        return Layout(self.shown)

    row = column = box = _part

    def _icon(self, icon):
        if icon not in ICONS:
            raise ValueError(f"icon {icon}")

    def label(self, text="", icon="NONE"):
        self._icon(icon)
        self.shown.append(text)

    def prop(self, data, name, text=None, icon="NONE", toggle=-1, expand=False):
        self._icon(icon)
        self.shown.append(data.bl_rna.properties[name].name)

    def prop_search(self, data, name, other, collection, text=None):
        len(getattr(other, collection))
        self.prop(data, name)

    def separator(self):
        pass

    def menu(self, name, icon="NONE"):
        self._icon(icon)
        self.shown.append(getattr(bpy.types, name).bl_label)

    def template_ID(self, data, name, new="", open=""):
        for operator in (new, open):
            self.operator(operator)
        self.prop(data, name)

    def operator(self, name, text=None, icon="NONE", depress=False):
        self._icon(icon)
        module, function = name.split(".")
        rna = getattr(getattr(bpy.ops, module), function).get_rna_type()
        self.shown.append(text or rna.name)
        return types.SimpleNamespace(**{p.identifier: None for p in rna.properties})


class Panel(Case):
    def draw(self, obj):
        shown, context = [], types.SimpleNamespace(object=obj, scene=bpy.context.scene)
        states = set(part("states").known)
        for name in PANELS:
            panel = getattr(bpy.types, f"VRTM_PT_{name}")
            self.assertTrue(panel.poll(context))
            panel.draw(types.SimpleNamespace(layout=Layout(shown)), context)
        for name in MENUS:
            getattr(bpy.types, f"VRTM_MT_{name}").draw(types.SimpleNamespace(layout=Layout(shown)), context)
        self.assertEqual(set(part("states").known), states)
        return shown

    def test_all_that_the_panels_name_is_there(self):
        arm = Arm()
        obj, settings = arm.object, arm.object.vrtm
        self.assertIn("Update Now", self.draw(obj))
        for source in ("NONE", "IMAGE", "VERTEX_GROUP", "ATTRIBUTE"):
            settings.rigidity_source = settings.mask_source = source
            self.draw(obj)
        for rest in ("MESH", "SHAPE_KEY", "CAPTURED"):
            settings.rest_source = rest
            shown = self.draw(obj)
        self.assertIn("Capture Rest", shown)
        obj.shape_key_clear()
        settings.rest_source = "SHAPE_KEY"
        self.assertIn("The mesh has no shape keys", self.draw(obj))

    def test_results_and_problems_are_shown(self):
        arm = Arm()
        obj, settings = arm.object, arm.object.vrtm
        settings.rest_source = "CAPTURED"
        with self.assertRaises(RuntimeError):
            bpy.ops.vrtm.update()
        self.assertIn("arm: choose where the rigidity is painted", self.draw(obj))
        arm.paint_image()
        settings.measure = True
        bpy.context.scene.frame_set(5)
        bpy.ops.vrtm.capture_rest()
        bpy.context.scene.frame_set(2)
        bpy.ops.vrtm.update()
        shown = self.draw(obj)
        for text in ("Captured at frame 5", "Up to date", "Time", "Strain", "Folds", "Redirection"):
            self.assertIn(text, shown)
        obj.modifiers.new("it", "SUBSURF")
        obj.scale = (1, 1, 2)
        bpy.context.view_layer.update()
        shown = self.draw(obj)
        self.assertIn("it changes the topology", shown)
        self.assertIn("Read Pose", shown)
        self.assertTrue(any(text.startswith("Scaled unevenly, which vrtm does not see") for text in shown))

    def test_only_meshes_have_it(self):
        arm = Arm()
        for obj in (arm.rig, None):
            context = types.SimpleNamespace(object=obj)
            self.assertFalse(any(getattr(bpy.types, f"VRTM_PT_{name}").poll(context) for name in PANELS))
