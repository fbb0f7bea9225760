"""Shared by the operators."""

from __future__ import annotations

import bpy

from .. import live, session, states
from ..messages import Problem, text_of


class OnObject:
    """An operator on the active mesh object. A failure is reported, in words, and cancels it."""

    bl_options = {"REGISTER", "UNDO"}
    # It works on all selected mesh objects.
    on_selected = False
    # It changes node trees. Blender crashes where a script has done so between two undo steps, and only what is called
    # by hand makes a step of its own.
    makes_step = False

    @classmethod
    def poll(cls, context: bpy.types.Context) -> bool:
        if context.object is None or context.object.type != "MESH":
            cls.poll_message_set("Choose a mesh object")
            return False
        if not is_own(context.object):
            cls.poll_message_set("The object is linked from another file: make a library override of it")
            return False
        return True

    def objects(self, context: bpy.types.Context) -> list[bpy.types.Object]:
        others = context.selected_objects if self.on_selected else ()
        return list(dict.fromkeys([context.object, *(obj for obj in others if obj.type == "MESH" and is_own(obj))]))

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


def is_own(obj: bpy.types.Object) -> bool:
    """Its mesh may be linked, as that of an overridden character is."""
    return obj.library is None
