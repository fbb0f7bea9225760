"""Baking to disk, and materials that read what was baked."""

from __future__ import annotations

import bpy

from .. import bake, basis, layers, live, measure, messages, nodes, session, states
from ..messages import Problem, text_of
from .base import OnObject, Polled


class VRTM_OT_use_baked(OnObject, bpy.types.Operator):
    """Have the material read the baked files, so that it renders without this add-on; nothing is solved in renders
    then"""

    bl_idname = "vrtm.use_baked"
    bl_label = "Use Baked Files"
    makes_step = True

    def work(self, context: bpy.types.Context, obj: bpy.types.Object) -> str:
        paths, first, number = bake.sequence(obj, context.scene)
        asset = states.state_of(obj).asset
        if asset is not None and layers.number_of(asset) != len(paths):
            raise Problem(f"{obj.name}: the result has other layers than what was baked: press Update Now")
        nodes.show_baked(obj, paths, first, number)
        obj.vrtm.shows_baked = True
        return f"{obj.name}: the material reads {number} baked files, from frame {first} on"


class VRTM_OT_use_live(OnObject, bpy.types.Operator):
    """Have the material read the result image again, which follows the pose"""

    bl_idname = "vrtm.use_live"
    bl_label = "Use Live Result"
    makes_step = True

    def work(self, context: bpy.types.Context, obj: bpy.types.Object) -> str:
        nodes.rebuild(obj)
        obj.vrtm.shows_baked = False
        # Whatever became of the image meanwhile.
        states.state_of(obj).rewrite = True
        live.touch(obj)
        return f"{obj.name}: the material reads the result image"


class BakesFrames(Polled):
    """An operator that bakes a range of frames of the selected objects. Esc ends it."""

    _bake, done = None, "frames are written"

    @classmethod
    def why_not(cls, context: bpy.types.Context) -> str | None:
        if not cls.objects(context):
            return "Select a mesh object whose rigidity is chosen"
        return "A bake is under way" if session.baking else None

    @staticmethod
    def objects(context: bpy.types.Context) -> list[bpy.types.Object]:
        chosen = list(context.selected_objects)
        if context.object is not None and context.object not in chosen:
            chosen.append(context.object)
        return [obj for obj in chosen if obj.vrtm.is_set_up]

    def begin(self, context: bpy.types.Context) -> bool:
        try:
            self._bake = self.make(context.scene, self.objects(context))
        except Problem as problem:
            self.report({"ERROR"}, text_of(problem))
            return False
        self._steps, self._files, self._frames = self._bake.steps(), 0, 0
        return True

    def step(self) -> set[str] | None:
        """Bakes one more frame. Returns what ends the operator, after the last one and after a failure."""
        try:
            _, written = next(self._steps)
        except StopIteration:
            return self.finish()
        except Exception as error:  # told to the artist.
            self.report({"ERROR"}, f"Bake: {text_of(error)}; {self._frames} {self.done}")
            return {"CANCELLED"}
        self._files += len(written)
        self._frames += 1
        return None

    def execute(self, context: bpy.types.Context) -> set[str]:
        """All frames at once: in background mode, and from scripts."""
        if not self.begin(context):
            return {"CANCELLED"}
        while (result := self.step()) is None:
            pass
        return result

    def invoke(self, context: bpy.types.Context, event: bpy.types.Event) -> set[str]:
        """A frame per tick of a timer, so that the window keeps drawing and Esc is heard."""
        if bpy.app.background or context.window is None:
            return self.execute(context)
        if not self.begin(context):
            return {"CANCELLED"}
        manager = context.window_manager
        manager.progress_begin(0, len(self._bake.frames))
        self._timer = manager.event_timer_add(0.01, window=context.window)
        manager.modal_handler_add(self)
        return {"RUNNING_MODAL"}

    def modal(self, context: bpy.types.Context, event: bpy.types.Event) -> set[str]:
        if event.type == "ESC":
            self.end(context)
            self.report({"WARNING"}, f"Bake ended early: {self._frames} {self.done}")
            return {"CANCELLED"}
        if event.type != "TIMER":
            # A click elsewhere would change the scene under the bake.
            return {"RUNNING_MODAL"}
        if (result := self.step()) is not None:
            self.end(context)
            return result
        context.window_manager.progress_update(self._frames)
        messages.status(f"vrtm: baked frame {self._frames} of {len(self._bake.frames)}; Esc ends the bake")
        return {"RUNNING_MODAL"}

    def end(self, context: bpy.types.Context) -> None:
        context.window_manager.event_timer_remove(self._timer)
        context.window_manager.progress_end()
        messages.status(None)
        self._steps.close()

    # Blender ends the operator itself, as when a file is loaded.
    cancel = end

    def finish(self) -> set[str]:
        where = f" to {self._files} files in {self._bake.folder}" if self._files else ""
        self.report({"INFO"}, f"Baked {self._frames} frames{where}")
        return {"FINISHED"}


class VRTM_OT_bake(BakesFrames, bpy.types.Operator):
    """Write the redirections of a range of frames of all selected objects that are set up, as EXR files. Esc ends it"""

    bl_idname = "vrtm.bake"
    bl_label = "Bake to Disk"
    bl_options = {"REGISTER"}
    make = bake.Bake

    def begin(self, context: bpy.types.Context) -> bool:
        for obj in self.objects(context):
            for text in measure.told(obj, context.evaluated_depsgraph_get()):
                self.report({"WARNING"}, text)
        return super().begin(context)


class VRTM_OT_bake_basis(BakesFrames, bpy.types.Operator):
    """For games: a few maps driven by shape keys, or by frames, in place of a map per pose, and a glb whose UVs morph
    with its shape, of all selected objects that are set up. All is read back. Esc ends it"""

    bl_idname = "vrtm.bake_basis"
    bl_label = "Bake for Games"
    bl_options = {"REGISTER"}
    make, done = basis.Bake, "poses were solved"

    def finish(self) -> set[str]:
        for text in self._bake.told:
            self.report({"INFO"}, text)
        return {"FINISHED"}


CLASSES = (VRTM_OT_bake, VRTM_OT_bake_basis, VRTM_OT_use_baked, VRTM_OT_use_live)
