"""Solving, and what the pose is read from."""

from __future__ import annotations

import bpy
from bpy.props import BoolProperty
from mathutils import Vector

from .. import features, geometry, live, messages, session, solve, states, status, tap
from ..messages import Problem
from .base import OnObject


class VRTM_OT_update(OnObject, bpy.types.Operator):
    """Read mesh, rest shape and painted maps again, solve for the present pose, and write the results. Esc ends it"""

    bl_idname = "vrtm.update"
    bl_label = "Update Now"

    # Objects whose update is under way in a window.
    _running: set[int] = set()

    @classmethod
    def why_not(cls, context: bpy.types.Context) -> str | None:
        running = context.object is not None and context.object.session_uid in cls._running
        return super().why_not(context) or ("Its update is under way" if running else None)

    def work(self, context: bpy.types.Context, obj: bpy.types.Object) -> str:
        self.begin(context, obj)
        state = solve.run(obj, context.evaluated_depsgraph_get())
        messages.status(None)
        return self.told(state)

    @staticmethod
    def begin(context: bpy.types.Context, obj: bpy.types.Object) -> states.State:
        if obj.mode == "EDIT":
            raise Problem(f"{obj.name} is in Edit Mode: leave it first")
        state = states.state_of(obj)
        state.read_again()
        state.rewrite = True
        solve.find_seams(obj, state, context.evaluated_depsgraph_get())
        return state

    @staticmethod
    def told(state: states.State) -> str:
        return f"{state.name}: " + ", ".join(f"{label} {value}" for label, value in state.figures)

    def invoke(self, context: bpy.types.Context, event: bpy.types.Event) -> set[str]:
        """In a window, beside Blender's work: a large mesh takes seconds."""
        if bpy.app.background or context.window is None or session.synchronous():
            return self.execute(context)
        try:
            state = self.begin(context, context.object)
        except Exception:
            # Told as it is from scripts.
            return self.execute(context)
        live.want(context.object)
        self._uid = state.uid
        self._running.add(self._uid)
        self._timer = context.window_manager.event_timer_add(0.05, window=context.window)
        context.window.cursor_modal_set("WAIT")
        context.window_manager.modal_handler_add(self)
        return {"RUNNING_MODAL"}

    def modal(self, context: bpy.types.Context, event: bpy.types.Event) -> set[str]:
        state = states.known.get(self._uid)
        if state is None:
            # The object was deleted, or another file was opened.
            self.end(context)
            return {"CANCELLED"}
        if event.type == "ESC":
            state.cancel_job()
            live.doubt()
            self.end(context)
            self.report({"WARNING"}, f"{state.name}: the update was ended; what is shown is the result before it")
            return {"CANCELLED"}
        if event.type != "TIMER":
            return {"PASS_THROUGH"}
        if state.wanted or state.job is not None:
            messages.status(f"vrtm: {state.name}: {state.progress}; Esc ends it")
            live.redraw()
            return {"PASS_THROUGH"}
        self.end(context)
        if state.error:
            self.report({"ERROR"}, state.message)
            return {"CANCELLED"}
        self.report({"INFO"}, self.told(state))
        return {"FINISHED"}

    def end(self, context: bpy.types.Context) -> None:
        self._running.discard(self._uid)
        context.window_manager.event_timer_remove(self._timer)
        context.window.cursor_modal_restore()
        messages.status(None)
        live.redraw()

    # Blender ends the operator itself, as when a file is loaded.
    cancel = end


class VRTM_OT_capture_rest(OnObject, bpy.types.Operator):
    """Keep the present evaluated shape as the rest shape. It is saved with the file"""

    bl_idname = "vrtm.capture_rest"
    bl_label = "Capture Rest"

    def work(self, context: bpy.types.Context, obj: bpy.types.Object) -> str:
        if obj.mode == "EDIT":
            raise Problem(f"{obj.name} is in Edit Mode: leave it first")
        frame = context.scene.frame_current
        geometry.store_rest(obj, geometry.pose(obj, context.evaluated_depsgraph_get()), frame)
        obj.data.update_tag()
        obj.vrtm.rest_source = "CAPTURED"
        live.touch(obj)
        return f"{obj.name}: the shape at frame {frame} is the rest shape"


class VRTM_OT_insert_tap(OnObject, bpy.types.Operator):
    """Put a modifier that stores the pose behind the last one that deforms, so that the pose can be read while others,
    such as Subdivision Surface or Mirror, make more vertices than the mesh has"""

    bl_idname = "vrtm.insert_tap"
    bl_label = "Read Pose"

    def work(self, context: bpy.types.Context, obj: bpy.types.Object) -> str:
        at = tap.place(obj)
        if at is None and tap.topology_modifiers(obj):
            raise Problem(f"{obj.name}: {geometry.culprit(obj)} does not let the pose be read: hide it, or apply it")
        if at is None:
            raise Problem(f"{obj.name} has no modifier that changes the topology")
        tap.insert(obj, at)
        live.touch(obj)
        return f"{obj.name}: the pose is read {'behind' if at.type in tap.DEFORMING else 'in front of'} {at.name!r}"


class VRTM_OT_worst_feature(OnObject, bpy.types.Operator):
    """Turn a 3D view to the feature that is worst, compared with how it is without vrtm, or to the skin that is most
    squeezed or stretched; again, to the next one"""

    bl_idname = "vrtm.worst_feature"
    bl_label = "Show Worst Feature"
    bl_options = {"REGISTER"}

    skin: BoolProperty(options={"HIDDEN", "SKIP_SAVE"})

    @classmethod
    def why_not(cls, context: bpy.types.Context) -> str | None:
        text = "No feature is known to be worse: Measure Strain, and Update Now, find out"
        found = super().why_not(context) or status.features(context.object)
        return found if isinstance(found, str) else None if found.worst or found.squeezed else text

    def work(self, context: bpy.types.Context, obj: bpy.types.Object) -> str:
        state = states.state_of(obj)
        skin = self.skin or not state.features.worst
        if not (worst := state.features.places(skin)):
            raise Problem(f"{obj.name}: no skin is squeezed or stretched to more than twice")
        number = state.looked_at % len(worst)
        state.looked_at += 1
        one = worst[number].of
        what, told = "worst features", f"strained by {one.before:.3f} before, {one.after:.3f} after"
        if skin:
            what, told = "places of skin", f"{one.after:.2f} times as long as without vrtm"
        text = f"{obj.name}: number {number + 1} of the {len(worst)} {what}, at UV {one.u:.3f}, {one.v:.3f}, is {told}"
        views = session.areas("VIEW_3D")
        if not views:
            return f"{text}; there is no 3D view to show it"
        centre, normal, radius = features.in_world(obj, worst[number], context.evaluated_depsgraph_get())
        # The button's own view, or else the largest one.
        area = context.area if context.area in views else max(views, key=lambda area: area.width * area.height)
        view = area.spaces.active.region_3d
        view.view_perspective = "PERSP" if view.view_perspective == "CAMERA" else view.view_perspective
        view.view_location, view.view_distance = centre, 8 * radius
        view.view_rotation = Vector(normal).to_track_quat("Z", "Y")
        return text


CLASSES = (VRTM_OT_update, VRTM_OT_capture_rest, VRTM_OT_insert_tap, VRTM_OT_worst_feature)
