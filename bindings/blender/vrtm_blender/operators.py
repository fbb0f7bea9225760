"""What the panel's buttons do."""

from __future__ import annotations

import bpy
from bpy.props import BoolProperty, EnumProperty

from . import bake, dilate, geometry, live, messages, nodes, results, session, solve, tap
from .messages import Problem, text_of


class _OnObject:
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
            session.state_of(obj).say(text_of(error), error=True)
            if not isinstance(error, Problem) and not hasattr(error, "status_name"):
                session.log.exception("%s", obj.name)
            self.report({"ERROR"}, text_of(error))
            return {"CANCELLED"}
        finally:
            live.redraw()
        self.report({"INFO"}, text)
        return {"FINISHED"}


class VRTM_OT_update(_OnObject, bpy.types.Operator):
    """Read mesh, rest shape and painted maps again, solve for the present pose, and write the results"""

    bl_idname = "vrtm.update"
    bl_label = "Update Now"

    def work(self, context: bpy.types.Context, obj: bpy.types.Object) -> str:
        if obj.mode == "EDIT":
            raise Problem(f"{obj.name} is in Edit Mode: leave it first")
        settings = obj.vrtm
        if settings.rest_source == "FRAME" and obj.data.get(geometry.REST_FRAME_NAME) != settings.rest_frame:
            capture(context, obj, settings.rest_frame)
        state = session.state_of(obj)
        state.mesh_changed = state.maps_changed = True
        state.shown = b""
        solve.run(obj, context.evaluated_depsgraph_get())
        messages.status(None)
        return f"{obj.name}: " + ", ".join(f"{label} {value}" for label, value in state.figures)


class VRTM_OT_capture_rest(_OnObject, bpy.types.Operator):
    """Keep the evaluated shape as the rest shape: that of the chosen frame if the rest is a frame, and the present
    one else. It is stored in the mesh, and saved with the file"""

    bl_idname = "vrtm.capture_rest"
    bl_label = "Capture Rest"

    def work(self, context: bpy.types.Context, obj: bpy.types.Object) -> str:
        if obj.mode == "EDIT":
            raise Problem(f"{obj.name} is in Edit Mode: leave it first")
        settings = obj.vrtm
        frame = settings.rest_frame if settings.rest_source == "FRAME" else context.scene.frame_current
        capture(context, obj, frame)
        if settings.rest_source != "FRAME":
            settings.rest_source = "CAPTURED"
        return f"{obj.name}: the shape at frame {frame} is the rest shape"


def capture(context: bpy.types.Context, obj: bpy.types.Object, frame: int) -> None:
    """Stores the shape at a frame as the rest shape; the scene stays at its own frame."""
    scene, kept = context.scene, context.scene.frame_current
    before, session.baking = session.baking, True
    try:
        # Going to a frame takes poses back that have no key: only where another frame is asked for.
        if frame != kept:
            scene.frame_set(frame)
        positions = geometry.pose(obj, context.evaluated_depsgraph_get())
    finally:
        if frame != kept:
            scene.frame_set(kept)
        session.baking = before
    geometry.store_rest(obj, positions, frame)
    obj.data.update_tag()
    live.touch(obj)


class VRTM_OT_insert_tap(_OnObject, bpy.types.Operator):
    """Put a modifier that stores the pose in front of the first one that changes the topology, such as Subdivision
    Surface, so that the pose can be read while that one is on"""

    bl_idname = "vrtm.insert_tap"
    bl_label = "Read Pose Before It"

    def work(self, context: bpy.types.Context, obj: bpy.types.Object) -> str:
        first = geometry.first_topology_modifier(obj)
        if first is None:
            raise Problem(f"{obj.name} has no modifier that changes the topology")
        tap.insert(obj, first)
        live.touch(obj)
        return f"{obj.name}: the pose is read in front of {first.name!r}"


class VRTM_OT_set_up_material(_OnObject, bpy.types.Operator):
    """Redirect the UVs of the active material's image textures. A material that other objects use is copied first"""

    bl_idname = "vrtm.set_up_material"
    bl_label = "Set Up Material"

    by: EnumProperty(
        name="By",
        items=[
            (nodes.BY_IMAGE, "Image", "Through the result image: right also where faces are larger than features"),
            (nodes.BY_UV_MAP, "UV Map", "Through the result UV map: cheaper, and enough on a fine mesh"),
        ],
    )
    all_materials: BoolProperty(name="All Materials", description="All of the object's materials", default=False)

    def work(self, context: bpy.types.Context, obj: bpy.types.Object) -> str:
        slots = [slot for slot in obj.material_slots if slot.material is not None]
        if not self.all_materials:
            active = obj.active_material_index
            slots = [slot for slot in slots if slot.slot_index == active]
        if not slots:
            raise Problem(f"{obj.name} has no material: give it one with an Image Texture")
        if not results.are_there(obj):
            solve.run(obj, context.evaluated_depsgraph_get())
        source = geometry.source_uv_layer(obj)
        for slot in slots:
            if slot.material.library is not None:
                raise Problem(f"material {slot.material.name!r} is linked from another file: make it local")
        number = sum(nodes.insert(obj, nodes.own_material(obj, slot), source, self.by) for slot in slots)
        return f"{obj.name}: {number} image textures are looked up at redirected UVs"


def kept_text(painted: list[str]) -> str:
    return f"; painted on, and kept: {', '.join(painted)}" if painted else ""


class VRTM_OT_dilate(_OnObject, bpy.types.Operator):
    """Have the materials look up copies of their textures that hold, around each chart, what lies beyond its seams. The
    copies are packed into the file; press it again after painting on the originals"""

    bl_idname = "vrtm.dilate"
    bl_label = "Dilate Textures"

    def work(self, context: bpy.types.Context, obj: bpy.types.Object) -> str:
        state = session.state_of(obj)
        state.end_job()
        state.mesh_changed = state.maps_changed = True
        solve.prepare(obj, state)
        number, painted = dilate.dilate(obj, state.asset, obj.vrtm.seam_reach)
        # A job that was ended is to be done yet.
        live.touch(obj)
        return f"{obj.name}: {number} textures have what lies beyond seams" + kept_text(painted)


class VRTM_OT_clear_material(_OnObject, bpy.types.Operator):
    """Take the redirection out of the object's materials again"""

    bl_idname = "vrtm.clear_material"
    bl_label = "Remove from Material"

    def work(self, context: bpy.types.Context, obj: bpy.types.Object) -> str:
        materials = {slot.material for slot in obj.material_slots if slot.material is not None}
        painted = dilate.restore(obj)
        return f"{obj.name}: {sum(map(nodes.remove, materials))} node groups removed" + kept_text(painted)


class VRTM_OT_use_baked(_OnObject, bpy.types.Operator):
    """Have the material read the baked files, so that it renders without this add-on; nothing is solved in renders
    then"""

    bl_idname = "vrtm.use_baked"
    bl_label = "Use Baked Files"

    def work(self, context: bpy.types.Context, obj: bpy.types.Object) -> str:
        path, first, number = bake.sequence(obj, context.scene)
        nodes.show_baked(obj, path, first, number)
        obj.vrtm.shows_baked = True
        return f"{obj.name}: the material reads {number} baked files, from frame {first} on"


class VRTM_OT_use_live(_OnObject, bpy.types.Operator):
    """Have the material read the result image again, which follows the pose"""

    bl_idname = "vrtm.use_live"
    bl_label = "Use Live Result"

    def work(self, context: bpy.types.Context, obj: bpy.types.Object) -> str:
        nodes.show_live(obj)
        obj.vrtm.shows_baked = False
        # Whatever became of the image meanwhile.
        session.state_of(obj).shown = b""
        live.touch(obj)
        return f"{obj.name}: the material reads the result image"


class VRTM_OT_bake(bpy.types.Operator):
    """Write the redirections of a range of frames of all selected objects that are set up, as EXR files. Esc ends it"""

    bl_idname = "vrtm.bake"
    bl_label = "Bake to Disk"
    bl_options = {"REGISTER"}

    _bake = None

    @classmethod
    def poll(cls, context: bpy.types.Context) -> bool:
        if not cls.objects(context):
            cls.poll_message_set("Select a mesh object whose rigidity is chosen")
            return False
        if session.baking:
            cls.poll_message_set("A bake is under way")
            return False
        return True

    @staticmethod
    def objects(context: bpy.types.Context) -> list[bpy.types.Object]:
        chosen = list(context.selected_objects)
        if context.object is not None and context.object not in chosen:
            chosen.append(context.object)
        return [obj for obj in chosen if results.is_set_up(obj)]

    def begin(self, context: bpy.types.Context) -> bool:
        try:
            self._bake = bake.Bake(context.scene, self.objects(context))
        except Problem as problem:
            self.report({"ERROR"}, text_of(problem))
            return False
        self._steps, self._files, self._frames = self._bake.steps(), 0, 0
        return True

    def step(self) -> bool:
        """Bakes one more frame; False at the end. Raises what goes wrong."""
        try:
            _, written = next(self._steps)
        except StopIteration:
            return False
        self._files += len(written)
        self._frames += 1
        return True

    def execute(self, context: bpy.types.Context) -> set[str]:
        """All frames at once: in background mode, and from scripts."""
        if not self.begin(context):
            return {"CANCELLED"}
        try:
            while self.step():
                pass
        except Exception as error:  # told to the artist.
            return self.fail(error)
        finally:
            self._steps.close()
        return self.finish()

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
            self.report({"WARNING"}, f"Bake ended early: {self._frames} frames, {self._files} files are written")
            return {"CANCELLED"}
        if event.type != "TIMER":
            # A click elsewhere would change the scene under the bake.
            return {"RUNNING_MODAL"}
        try:
            if self.step():
                context.window_manager.progress_update(self._frames)
                number = len(self._bake.frames)
                messages.status(f"vrtm: baked frame {self._frames} of {number}; Esc ends the bake")
                return {"RUNNING_MODAL"}
        except Exception as error:  # told to the artist.
            self.end(context)
            return self.fail(error)
        self.end(context)
        return self.finish()

    def cancel(self, context: bpy.types.Context) -> None:
        """Blender ends the operator, as when a file is loaded."""
        self.end(context)

    def end(self, context: bpy.types.Context) -> None:
        self._steps.close()
        context.window_manager.event_timer_remove(self._timer)
        context.window_manager.progress_end()
        messages.status(None)

    def fail(self, error: Exception) -> set[str]:
        self.report({"ERROR"}, f"Bake: {text_of(error)}; {self._frames} frames are written")
        return {"CANCELLED"}

    def finish(self) -> set[str]:
        self.report({"INFO"}, f"Baked {self._frames} frames to {self._files} files in {self._bake.folder}")
        return {"FINISHED"}


CLASSES = (
    VRTM_OT_update,
    VRTM_OT_capture_rest,
    VRTM_OT_insert_tap,
    VRTM_OT_set_up_material,
    VRTM_OT_dilate,
    VRTM_OT_clear_material,
    VRTM_OT_bake,
    VRTM_OT_use_baked,
    VRTM_OT_use_live,
)


def register() -> None:
    for cls in CLASSES:
        bpy.utils.register_class(cls)


def unregister() -> None:
    for cls in reversed(CLASSES):
        bpy.utils.unregister_class(cls)
