"""Shared by the operators."""

from __future__ import annotations

import bpy

from .. import live, session, states
from ..messages import Problem, text_of


class Polled:
    """An operator that tells why it cannot be pressed."""

    @classmethod
    def poll(cls, context: bpy.types.Context) -> bool:
        if why := cls.why_not(context):
            cls.poll_message_set(why)
        return not why


class OnObject(Polled):
    """An operator on the active mesh object. A failure is reported, in words, and cancels it."""

    bl_options = {"REGISTER", "UNDO"}
    # It works on all selected mesh objects.
    on_selected = False
    # It changes node trees. Blender crashes where a script has done so between two undo steps, and only what is called
    # by hand makes a step of its own.
    makes_step = False

    @classmethod
    def why_not(cls, context: bpy.types.Context) -> str | None:
        if context.object is None or context.object.type != "MESH":
            return "Choose a mesh object"
        linked = "The object is linked from another file: make a library override of it"
        return None if context.object.library is None else linked

    def objects(self, context: bpy.types.Context) -> list[bpy.types.Object]:
        others = context.selected_objects if self.on_selected else ()
        own = [obj for obj in others if obj.type == "MESH" and obj.library is None]
        return list(dict.fromkeys([context.object, *own]))

    def invoke(self, context: bpy.types.Context, event: bpy.types.Event) -> set[str]:
        return self.execute(context)

    def execute(self, context: bpy.types.Context) -> set[str]:
        done, failed = [], []
        for obj in self.objects(context):
            try:
                done.append(self.work(context, obj))
            except Exception as error:  # told to the artist, and not as a traceback.
                states.state_of(obj).say(text_of(error), error=True)
                if not isinstance(error, Problem) and not hasattr(error, "status_name"):
                    session.log.exception("%s", obj.name)
                failed.append(text_of(error))
        live.redraw()
        for text in failed:
            self.report({"WARNING" if done else "ERROR"}, text)
        if not done:
            return {"CANCELLED"}
        for text in done:
            self.report({"INFO"}, text)
        if self.makes_step and not (self.options.is_invoke or self.options.is_repeat):
            bpy.ops.ed.undo_push(message=self.bl_label)
        return {"FINISHED"}
