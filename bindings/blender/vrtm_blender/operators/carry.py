"""Things on the skin: carried, wrapped, baked, and put back."""

from __future__ import annotations

import bpy
import numpy as np
from bpy.props import BoolProperty, EnumProperty, FloatProperty

from .. import carry, carry_bake, geometry, live, solve, states
from ..carriers import BOUND, TOO_FAR, told
from ..messages import Problem
from .bake import BakesFrames
from .base import OnObject


class _Carry(OnObject):
    makes_step = True

    farthest: FloatProperty(
        name="Largest Distance",
        description="Things farther from the skin are not carried; 0: a twentieth of the skin's diagonal",
        min=0,
        subtype="DISTANCE",
    )
    fit: EnumProperty(name="Follow", description="The guide of things on the skin", items=carry.FITS)
    skirt: FloatProperty(
        name="Skirt",
        description="Up to this height above the skin what rides on a rigid feature is blended into the skin, so that "
        "it does not lift off",
        min=0,
        subtype="DISTANCE",
    )
    # Each connected part of a mesh as one body.
    pieces = False

    def kind(self, obj: bpy.types.Object) -> str:
        raise NotImplementedError

    def work(self, context: bpy.types.Context, obj: bpy.types.Object) -> str:
        if not obj.vrtm.is_set_up:
            raise Problem(f"{obj.name}: press Set Up first, so that something is rigid")
        if obj.mode == "EDIT":
            raise Problem(f"{obj.name} is in Edit Mode: leave it first")
        size = np.linalg.norm(np.ptp(geometry.rest_positions(obj), axis=0))
        farthest = self.farthest or carry.scale_of(obj) * carry.FAR * float(size)
        chosen = [other for other in context.selected_objects if other != obj]
        if not chosen:
            raise Problem(f"{obj.name}: select what it is to carry, and {obj.name} last")
        carry_bake.live_again(obj)
        # What it carries already gets other settings.
        known = [other for other in chosen if (other.vrtm_carry.skin, other.vrtm_carry.kind) == (obj, self.kind(other))]
        for other in [other for other in chosen if other.vrtm_carry.skin is not None and other not in known]:
            carry.release(other)
        context.view_layer.update()
        attached, refused = [], []
        for other in chosen:
            kind = self.kind(other)
            why = None if other in known else carry.reason(other, obj, kind)
            if why is None:
                carry.attach(other, obj, kind, farthest, self.fit, self.skirt, self.pieces)
                attached.append(other)
            else:
                refused.append(f"{other.name} {why}")
        bound, places = self.bind(context, obj, attached, farthest, refused)
        if not bound:
            raise Problem("; ".join(refused))
        for text in refused:
            self.report({"WARNING"}, text)
        things = f"{bound} object{'s' * (bound > 1)} ({places} place{'s' * (places > 1)} bound)"
        return f"{obj.name}: carries {things} within {farthest:.3g} of the skin"

    @staticmethod
    def bind(
        context: bpy.types.Context,
        skin: bpy.types.Object,
        attached: list[bpy.types.Object],
        farthest: float,
        refused: list[str],
    ) -> tuple[int, int]:
        """Binds attached things where they are seen, and lets go those that are too far, which `refused` tells. Returns
        the numbers of things and places that are bound."""
        state, bound, places = states.state_of(skin), 0, 0

        def run() -> None:
            context.view_layer.update()
            state.carried_changed = state.rewrite = True
            solve.run(skin, context.evaluated_depsgraph_get())

        try:
            run()
        except BaseException:
            for obj in attached:
                carry.release(obj)
            state.carried_changed = True
            raise
        for obj in attached:
            found = state.prepared.carriers.states[obj.session_uid]
            if (found == TOO_FAR).all():
                whole = obj.vrtm_carry.kind == "OBJECT"
                carry.release(obj)
                refused.append(
                    f"{obj.name} is not bound: {'its origin is' if whole else 'all its points are'} farther than "
                    f"{farthest:.3g} from the skin as it is seen: go to the frame where it lies on the skin, or raise "
                    f"Largest Distance{' (or Object > Set Origin)' * whole}"
                )
                continue
            bound, places = bound + 1, places + int((found == BOUND).sum())
            if text := told(found, farthest):
                refused.append(f"{obj.name}: {text}")
        if bound < len(attached):
            run()
        return bound, places


class VRTM_OT_carry(_Carry, bpy.types.Operator):
    """Have the selected objects ride on the skin of the active one: each as a whole, and scatters, point clouds and
    hair by their points. They have to be where they belong on the skin as it is seen, in any pose"""

    bl_idname = "vrtm.carry"
    bl_label = "Carry Objects"

    how: EnumProperty(
        name="As",
        description="The carried part of each object",
        items=[
            ("AUTO", "Automatic", "Points of scatters, point clouds and hair; all else as a whole"),
            ("OBJECT", "Whole", "Each object as a whole, at its origin"),
            ("POINTS", "Points", "Each vertex, point or hair"),
        ],
    )

    def kind(self, obj: bpy.types.Object) -> str:
        return carry.kind_of(obj) if self.how == "AUTO" else self.how


class VRTM_OT_wrap(_Carry, bpy.types.Operator):
    """Have each vertex of the selected meshes ride on the skin of the active one, as modelled scales or chain mail:
    what lies on a rigid feature keeps its shape. They have to be where they belong on the skin as it is seen"""

    bl_idname = "vrtm.wrap"
    bl_label = "Wrap Meshes"

    pieces: BoolProperty(
        name="Connected Parts",
        description="Each connected part of a mesh moves as one rigid body with the skin under its foot, in place of "
        "each vertex with the skin nearest to it, which tears a stud that is near two sheets of skin, such as lips. A "
        "skirt is left out",
    )

    def kind(self, obj: bpy.types.Object) -> str:
        return "POINTS"


class VRTM_OT_carry_remove(OnObject, bpy.types.Operator):
    """Put carried things back to their places before: the selected ones, or, with the skin alone selected, all of
    them"""

    bl_idname = "vrtm.carry_remove"
    bl_label = "Let Go"
    makes_step = True

    @classmethod
    def why_not(cls, context: bpy.types.Context) -> str | None:
        return None if cls.objects(context) else "Nothing that is selected is carried, or carries"

    @staticmethod
    def objects(context: bpy.types.Context) -> list[bpy.types.Object]:
        chosen = list(dict.fromkeys([*context.selected_objects, *filter(None, [context.object])]))
        own = [obj for obj in chosen if obj.vrtm_carry.kind != "NONE" and obj.library is None]
        return own or [obj for skin in chosen for obj in carry.carried_by(skin)]

    def work(self, context: bpy.types.Context, obj: bpy.types.Object) -> str:
        let_go(obj)
        return f"{obj.name} is where it was"


def let_go(obj: bpy.types.Object) -> None:
    skin = obj.vrtm_carry.skin
    carry.release(obj)
    if skin is not None:
        if not carry.carried_by(skin):
            skin.vrtm.carried_baked = False
        live.touch_carried(skin)


class VRTM_OT_carry_bake(BakesFrames, bpy.types.Operator):
    """Bake the things that the selected objects carry, over the frames of Bake to Disk: keys of whole objects, and
    files of all else. The bake plays and renders without this add-on. Esc ends it"""

    bl_idname = "vrtm.carry_bake"
    bl_label = "Bake Carried"
    bl_options = {"REGISTER", "UNDO"}
    make = carry_bake.Bake

    @staticmethod
    def objects(context: bpy.types.Context) -> list[bpy.types.Object]:
        return [obj for obj in BakesFrames.objects(context) if carry.carried_by(obj)]


class VRTM_OT_carry_live(OnObject, bpy.types.Operator):
    """Remove the bake of carried things, with its keys: they follow the skin again"""

    bl_idname = "vrtm.carry_live"
    bl_label = "Carry Live"

    def work(self, context: bpy.types.Context, obj: bpy.types.Object) -> str:
        carry_bake.live_again(obj)
        live.touch(obj, mesh=False, maps=False)
        return f"{obj.name}: what it carries follows it"


CLASSES = (VRTM_OT_carry, VRTM_OT_wrap, VRTM_OT_carry_remove, VRTM_OT_carry_bake, VRTM_OT_carry_live)
