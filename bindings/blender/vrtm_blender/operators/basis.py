"""Basis maps from files, driven by shape keys."""

from __future__ import annotations

import bpy
from bpy.props import StringProperty

from .. import basis, geometry, materials, nodes
from ..messages import Problem
from .base import OnObject


class VRTM_OT_add_basis(OnObject, bpy.types.Operator):
    """Have the object's materials look up UVs through the basis maps of a basis.json, which vrtm bake --basis has
    written: shape keys with the names of the rig's controls drive them. Nothing is solved then"""

    bl_idname = "vrtm.add_basis"
    bl_label = "Add Basis Maps"
    makes_step = True

    filepath: StringProperty(name="File", description="A basis.json", subtype="FILE_PATH")
    filter_glob: StringProperty(default="*.json", options={"HIDDEN"})

    def invoke(self, context: bpy.types.Context, event: bpy.types.Event) -> set[str]:
        context.window_manager.fileselect_add(self)
        return {"RUNNING_MODAL"}

    def work(self, context: bpy.types.Context, obj: bpy.types.Object) -> str:
        found = basis.read(self.filepath)
        slots = [slot for slot in obj.material_slots if slot.material is not None]
        if not slots:
            raise Problem(f"{obj.name} has no material: give it one with an Image Texture")
        source = geometry.source_uv_layer(obj)
        for slot in slots:
            materials.check(obj, slot.material, source)
        group = basis.group(obj, found)
        for slot in slots:
            materials.insert(obj, materials.own_material(obj, slot), source, group)
        nodes.remove_unused_groups()
        what = f"{len(found.controls)} shape keys drive" if found.controls else "keyframes weigh"
        return f"{obj.name}: {what} {found.maps} basis maps"


CLASSES = (VRTM_OT_add_basis,)
