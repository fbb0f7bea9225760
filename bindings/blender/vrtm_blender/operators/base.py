"""What the operators share."""

from __future__ import annotations

import bpy

from .. import live, session, states
from ..messages import Problem, text_of


class OnObject:
    """An operator on the active mesh object: what is wrong is reported, in words, and cancels it."""

    bl_options = {"REGISTER", "UNDO"}

    @classmethod
    def poll(cls, context: bpy.types.Context) -> bool:
        obj = context.object
        if obj is None or obj.type != "MESH":
            cls.poll_message_set("Choose a mesh object")
            return False
        if obj.library is not None or obj.data.library is not None:
            cls.poll_message_set("The object is linked from another file: make it local, or override it with its mesh")
            return False
        return True

    def execute(self, context: bpy.types.Context) -> set[str]:
        obj = context.object
        try:
            text = self.work(context, obj)
        except Exception as error:  # told to the artist, and not as a traceback.
            states.state_of(obj).say(text_of(error), error=True)
            if not isinstance(error, Problem) and not hasattr(error, "status_name"):
                session.log.exception("%s", obj.name)
            self.report({"ERROR"}, text_of(error))
            return {"CANCELLED"}
        finally:
            live.redraw()
        self.report({"INFO"}, text)
        return {"FINISHED"}
