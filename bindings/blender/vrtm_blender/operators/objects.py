"""An object as a whole: set up at one click, quality at one click, and the add-on taken out of it again."""

from __future__ import annotations

import bpy
from bpy.props import BoolProperty, EnumProperty

from .. import carry, geometry, keep, layer_nodes, layers, overlay, result_image, results, states, tap
from .base import OnObject
from .carry import let_go
from .material import clear, set_up
from .rigidity import new_image, paint

# Quality, cells per side of a tile, texels per side of the map; 0 is their default.
PRESETS = {"scrub": ("draft", 256, 256), "work": ("normal", 512, 512), "final": ("normal", 0, 0)}


class VRTM_OT_set_up(OnObject, bpy.types.Operator):
    """Do all that there is to do for a first look, for all selected objects. Without a rigidity the image with "rigid"
    in its name is taken; if there is none you are asked, and scripts get a black one. The materials look up redirected
    UVs, and Live is switched on"""

    bl_idname = "vrtm.set_up"
    bl_label = "Set Up"
    on_selected = makes_step = True

    paint: BoolProperty(
        name="Paint", description="Make a black rigidity, and paint on it at once", options={"SKIP_SAVE"}
    )

    def invoke(self, context: bpy.types.Context, event: bpy.types.Event) -> set[str]:
        bare = [obj for obj in self.objects(context) if obj.vrtm.rigidity_source == "NONE"]
        if bare and not self.paint and rigidity_like() is None:
            bpy.ops.wm.call_menu(name="VRTM_MT_begin")
            return {"CANCELLED"}
        return self.execute(context)

    def work(self, context: bpy.types.Context, obj: bpy.types.Object) -> str:
        settings, done = obj.vrtm, []
        # Faults of the mesh are told before anything is made.
        geometry.source_uv_layer(obj)
        if settings.rigidity_source == "NONE" and (found := rigidity_like()) is not None:
            settings.rigidity_source, settings.rigidity_image = "IMAGE", found
            done.append(f"image {found.name!r} is the rigidity")
        elif settings.rigidity_source == "NONE":
            done.append(f"{new_image(obj, 1024).name!r} is to be painted on (Rigidity Map > Paint It)")
        done.append(set_up(context, obj))
        if self.paint and obj == context.object:
            done.append(paint(context, obj))
        return f"{obj.name}: {'; '.join(done)}"


def rigidity_like() -> bpy.types.Image | None:
    """An image that is most likely the rigidity, by its name: if there is one alone that is not another object's."""
    taken = {obj.vrtm.rigidity_image for obj in bpy.data.objects}
    images = [image for image in bpy.data.images if image not in taken and not result_image.is_result(image)]
    found = [image for image in images if "rigid" in image.name.lower()]
    return found[0] if len(found) == 1 and found[0].size[0] else None


class VRTM_OT_preset(OnObject, bpy.types.Operator):
    """Set quality, grid and map size for the viewport; renders and bakes have their own"""

    bl_idname = "vrtm.preset"
    bl_label = "Quality Preset"
    on_selected = True

    name: EnumProperty(
        name="Preset",
        items=[
            ("scrub", "Scrub", "Draft on a grid of 256: follows a scrub on most machines"),
            ("work", "Work", "Normal on a grid of 512"),
            ("final", "Final", "Normal, on a grid that resolves the rigid features"),
        ],
    )

    def work(self, context: bpy.types.Context, obj: bpy.types.Object) -> str:
        settings = obj.vrtm
        settings.quality, settings.grid, settings.map_size = PRESETS[self.name]
        return f"{obj.name}: {self.name.capitalize()}"


def preset_of(settings: bpy.types.PropertyGroup) -> str | None:
    present = (settings.quality, settings.grid, settings.map_size)
    return next((name for name, values in PRESETS.items() if values == present), None)


class VRTM_OT_remove_all(OnObject, bpy.types.Operator):
    """Take all of this add-on out of the object: from its materials, its results, its captured rest shape and its
    settings. Rigidity and mask images stay"""

    bl_idname = "vrtm.remove_all"
    bl_label = "Remove All"
    makes_step = True

    def work(self, context: bpy.types.Context, obj: bpy.types.Object) -> str:
        settings, mesh = obj.vrtm, obj.data
        for carried in carry.carried_by(obj):
            let_go(carried)
        states.drop(obj.session_uid)
        _, kept = clear(obj)
        others, image = [other for other in bpy.data.objects if other != obj], settings.image
        if result_image.is_result(image) and image.library is None and not any(o.vrtm.image == image for o in others):
            bpy.data.images.remove(image)
        layers.remove_unused()
        settings.strain = "NONE"
        overlay.remove(obj)
        sharing = [other for other in others if other.data == mesh and other.vrtm.is_set_up]
        names = results.names_of(settings) | {geometry.REST_NAME}
        for other in sharing:
            names -= results.names_of(other.vrtm) | {geometry.REST_NAME}
        if geometry.is_linked(obj):
            names, sharing = set(), [obj]
        for name in names:
            if name in mesh.attributes:
                mesh.attributes.remove(mesh.attributes[name])
        if not sharing and geometry.REST_FRAME_NAME in mesh:
            del mesh[geometry.REST_FRAME_NAME]
        geometry.remove_rest_mesh(obj)
        layer_nodes.remove(obj)
        tap.GROUP.remove(obj)
        maps = {settings.rigidity_image, settings.mask_image}
        for name in settings.bl_rna.properties.keys():
            if name not in ("rna_type", "name"):
                settings.property_unset(name)
        for one in maps:
            keep.keep_image(one)
        states.drop(obj.session_uid)
        return f"{obj.name}: nothing of vrtm is left" + kept


CLASSES = (VRTM_OT_set_up, VRTM_OT_preset, VRTM_OT_remove_all)
