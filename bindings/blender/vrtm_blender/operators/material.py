"""The redirection in materials."""

from __future__ import annotations

import bpy
from bpy.props import BoolProperty, EnumProperty

from .. import borders, dilate, geometry, live, materials, measure, nodes, picture, results, solve, states
from ..messages import Problem
from .base import OnObject


class VRTM_OT_set_up_material(OnObject, bpy.types.Operator):
    """Redirect the UVs of the image textures of all materials, of all selected objects. A material that other
    objects use is copied first"""

    bl_idname = "vrtm.set_up_material"
    bl_label = "Set Up Material"
    on_selected = makes_step = True

    by: EnumProperty(
        name="By",
        items=[
            (nodes.BY_IMAGE, "Image", "Through the result image: right also where faces are larger than features"),
            (nodes.BY_UV_MAP, "UV Map", "Through the result UV map: cheaper, and enough on a fine mesh"),
        ],
    )
    all_materials: BoolProperty(
        name="All Materials", description="All of the object's materials, or the active one", default=True
    )

    def work(self, context: bpy.types.Context, obj: bpy.types.Object) -> str:
        slots = [slot for slot in obj.material_slots if slot.material is not None]
        if not self.all_materials:
            active = obj.active_material_index
            slots = [slot for slot in slots if slot.slot_index == active]
        if not slots:
            raise Problem(f"{obj.name} has no material: give it one with an Image Texture")
        number, without = redirect(context, obj, slots, self.by)
        if len(without) == len(slots):
            raise next(iter(without.values()))
        return f"{obj.name}: {number} image textures are looked up at redirected UVs"


def redirect(
    context: bpy.types.Context, obj: bpy.types.Object, slots: list[bpy.types.MaterialSlot], by: str
) -> tuple[int, dict[str, materials.NoTexture]]:
    """Has materials look up redirected UVs; returns the number of textures, and the materials that have none. Raises a
    Problem before anything is changed."""
    if results.missing(obj) is not None:
        solve.run(obj, context.evaluated_depsgraph_get())
    source = geometry.source_uv_layer(obj)
    if by == nodes.BY_UV_MAP and geometry.is_linked(obj):
        raise Problem(f"{obj.name}: its mesh is linked, and cannot take a UV map: press Set Up by Image")
    fit, without = [], {}
    for slot in slots:
        try:
            materials.check(obj, slot.material, source)
            fit.append(slot)
        except materials.NoTexture as problem:
            without[slot.material.name] = problem
    shown = nodes.shows_uv_map(obj)
    for slot in fit:
        material = materials.own_material(obj, slot)
        group = nodes.group_by_image(obj) if by == nodes.BY_IMAGE else nodes.group_by_uv_map(obj)
        materials.insert(obj, material, source, group)
    if nodes.shows_uv_map(obj) != shown:
        # Its strain is another one.
        states.state_of(obj).rewrite = True
        solve.run(obj, context.evaluated_depsgraph_get())
    states.state_of(obj).measured = {}
    return sum(len(picture.redirected(slot.material)) for slot in fit), without


def set_up(context: bpy.types.Context, obj: bpy.types.Object) -> str:
    """Sets up the materials, and switches Live on, once there is a rigidity; returns what was done, in words."""
    slots = [slot for slot in obj.material_slots if slot.material is not None]
    number, without = redirect(context, obj, slots, nodes.BY_IMAGE)
    if number:
        done = f"{number} image textures are looked up at redirected UVs"
    elif without:
        done = f"{', '.join(map(repr, without))} has no Image Texture to be redirected"
    else:
        done = "it has no material yet: press Set Up again when it has one"
    obj.vrtm.live = True
    return f"{done}; Live is on"


def clear(obj: bpy.types.Object) -> tuple[int, str]:
    """Takes the redirection out of the materials; returns the number of node groups, and a text on what is kept."""
    painted = dilate.restore(obj)
    own = [material for material in materials.materials_of(obj) if material.library is None]
    removed = sum(map(materials.clear, own))
    nodes.remove_unused_groups()
    return removed, kept_text(painted)


def kept_text(painted: list[str]) -> str:
    return f"; painted on, and kept: {', '.join(painted)}" if painted else ""


class VRTM_OT_dilate(OnObject, bpy.types.Operator):
    """Have the materials look up copies of their textures that show, around each chart, the surface beyond its seams.
    The copies are packed into the file; press it again after painting on the originals"""

    bl_idname = "vrtm.dilate"
    bl_label = "Dilate Textures"
    on_selected = makes_step = True

    def work(self, context: bpy.types.Context, obj: bpy.types.Object) -> str:
        state = states.state_of(obj)
        state.end_job()
        state.mesh_changed = state.maps_changed = True
        solve.prepare(obj, state)
        number, painted = dilate.dilate(obj, state.asset, obj.vrtm.seam_reach)
        borders.leave_open(obj)
        borders.find_ends(obj, context.scene, state.prepared)
        state.maps_changed = True
        # A job that was ended is to be done yet.
        live.touch(obj)
        told = f"{obj.name}: {number} textures have what lies beyond seams" + kept_text(painted)
        return "; ".join(filter(None, [told, borders.chosen(obj).why]))


class VRTM_OT_clear_material(OnObject, bpy.types.Operator):
    """Take the redirection out of the object's materials again"""

    bl_idname = "vrtm.clear_material"
    bl_label = "Remove from Material"
    makes_step = True

    def work(self, context: bpy.types.Context, obj: bpy.types.Object) -> str:
        removed, kept = clear(obj)
        return f"{obj.name}: {removed} node groups removed" + kept


class VRTM_OT_check(OnObject, bpy.types.Operator):
    """Measure whether the materials show the result of this frame: where they look their textures up is rendered, and
    compared with it"""

    bl_idname = "vrtm.check"
    bl_label = "Check the Picture"
    bl_options = {"REGISTER"}

    def work(self, context: bpy.types.Context, obj: bpy.types.Object) -> str:
        number = measure.measure(obj, context.evaluated_depsgraph_get())
        answer = picture.ask(obj)
        if answer.wrong or answer.unsure:
            raise Problem("; ".join(answer.wrong + answer.unsure))
        if not number:
            raise Problem(f"{obj.name}: no texture is looked up at redirected UVs: press Set Up by Image")
        return f"{obj.name}: {number} lookups of textures show the result"


CLASSES = (
    VRTM_OT_check,
    VRTM_OT_set_up_material,
    VRTM_OT_dilate,
    VRTM_OT_clear_material,
)
