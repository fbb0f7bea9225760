"""Blender's handlers: they note changes of objects' poses, meshes and maps, and see to renders, undos and files."""

from __future__ import annotations

import contextlib
from collections.abc import Iterator

import bpy
from bpy.app.handlers import persistent

from . import carry, keep, live, results, session, solve, states
from .messages import text_of

PAINT_MODES = frozenset({"TEXTURE_PAINT", "VERTEX_PAINT", "WEIGHT_PAINT"})


@persistent
def frame_changed(scene: bpy.types.Scene, depsgraph: bpy.types.Depsgraph | None = None) -> None:
    """frame_change_post. In a render this comes before the render engine looks at the scene, so that it draws the
    results that are written here."""
    if session.writing or session.baking or depsgraph is None:
        return
    live.doubt()
    for obj in scene.objects:
        if session.rendering:
            if in_renders(obj):
                solve_now(obj, depsgraph)
        elif live.is_live(obj):
            if session.synchronous():
                # Scripts that paint or edit may not tell Blender of it.
                look_again(obj)
                solve_now(obj, depsgraph)
            else:
                live.want(obj)


def look_again(obj: bpy.types.Object) -> None:
    """Has the object's inputs read again before the next solve."""
    if (state := states.find_state(obj)) is not None:
        state.read_again()


def in_renders(obj: bpy.types.Object) -> bool:
    settings = obj.vrtm
    wanted = settings.is_set_up and (settings.live or settings.in_renders)
    return wanted and not obj.hide_render and (not settings.shows_baked or carry.carries_live(obj))


def solve_now(obj: bpy.types.Object, depsgraph: bpy.types.Depsgraph) -> None:
    """Solves within a handler."""
    with told(obj, depsgraph.scene), session.during("handling"):
        solve.run(obj, depsgraph)


@contextlib.contextmanager
def told(obj: bpy.types.Object, scene: bpy.types.Scene) -> Iterator[None]:
    """Tells a failure of the block, within a handler: the frame goes on with the last redirection."""
    try:
        yield
    except Exception as error:  # a render must not end here.
        states.state_of(obj).say(text_of(error), error=True)
        # Blender shows neither panel nor status bar while it renders on a farm: its log does.
        number, text = scene.frame_current, text_of(error)
        session.log.error("frame %d of %s keeps its last redirection: %s", number, obj.name, text)


@persistent
def updated(scene: bpy.types.Scene, depsgraph: bpy.types.Depsgraph) -> None:
    """depsgraph_update_post: a pose or a mesh was edited, or something painted."""
    if session.writing or session.rendering or session.baking:
        return
    live.doubt()
    if any(isinstance(update.id, (bpy.types.Material, bpy.types.NodeTree)) for update in depsgraph.updates):
        for state in states.known.values():
            state.measured = {}
    ids = [(update.id.original, update.is_updated_geometry) for update in depsgraph.updates]
    meshes = {changed for changed, _ in ids if isinstance(changed, bpy.types.Mesh)}
    images = {changed for changed, _ in ids if isinstance(changed, bpy.types.Image)}
    for changed, geometry in ids:
        if isinstance(changed, bpy.types.Object) and geometry and changed.vrtm.is_followed:
            live.touch(changed, mesh=changed.data in meshes, maps=changed.mode in PAINT_MODES)
    for changed, _ in ids:
        if isinstance(changed, bpy.types.Object) and (skin := changed.vrtm_carry.skin) is not None:
            if changed.vrtm_carry.kind == "POINTS" or carry.is_moved(changed):
                live.touch_carried(skin)
                if carry.is_moved(changed) and not session.synchronous():
                    # Where it is put it belongs in this very pose, also if the skin is not live.
                    live.want(skin)
    if images or bpy.context.mode == "PAINT_TEXTURE":
        for obj in (obj for obj in scene.objects if obj.vrtm.is_set_up):
            settings = obj.vrtm
            # Strokes change images without an update of the image.
            painted = obj.mode == "TEXTURE_PAINT" and "IMAGE" in (settings.rigidity_source, settings.mask_source)
            if painted or {settings.rigidity_image, settings.mask_image} & images:
                live.touch(obj, mesh=False, maps=True)


# Of the render that is under way: the objects whose result was shown before it.
_shown: set[int] = set()


@persistent
def render_begins(scene: bpy.types.Scene, *_) -> None:
    _shown.clear()
    session.rendering = True
    for obj in filter(in_renders, scene.objects):
        # While nothing is drawn yet: materials must not change between the frame's evaluation and its drawing.
        with told(obj, scene):
            results.separate(obj)
        look_again(obj)
        state = states.find_state(obj)
        if state is not None and state.shown:
            _shown.add(state.uid)


@persistent
def render_ends(scene: bpy.types.Scene, *_) -> None:
    session.rendering = False
    for obj in filter(in_renders, scene.objects):
        obj.data.update_tag()
        # The viewport has its own settings again.
        look_again(obj)
        if not session.synchronous() and obj.session_uid in _shown:
            # The viewport has its own frame again.
            live.want(obj)


@persistent
def undone(*_) -> None:
    """undo_post and redo_post: the file's data is another now. Objects are found again by their session_uid; the last
    results may be gone."""
    states.forget_gone()
    for state in states.known.values():
        state.read_again()
        state.rewrite = True
    live.doubt()
    want_all()


@persistent
def file_closes(*_) -> None:
    """load_pre: nothing of the old file is needed any more."""
    live.stop_timer()
    session.rendering = False
    states.clear()


@persistent
def file_saves(*_) -> None:
    """save_pre"""
    states.forget_gone()
    keep.keep_results()
    keep.tell_unsaved()


@persistent
def want_all(*_) -> None:
    """load_post"""
    if session.synchronous():
        return
    for obj in bpy.data.objects:
        if live.is_live(obj):
            live.want(obj)


HANDLERS = {
    "frame_change_post": frame_changed,
    "depsgraph_update_post": updated,
    "render_init": render_begins,
    "render_complete": render_ends,
    "render_cancel": render_ends,
    "undo_post": undone,
    "redo_post": undone,
    "load_pre": file_closes,
    "load_post": want_all,
    "save_pre": file_saves,
}


def register() -> None:
    for name, handler in HANDLERS.items():
        getattr(bpy.app.handlers, name).append(handler)


def unregister() -> None:
    for name, handler in HANDLERS.items():
        handlers = getattr(bpy.app.handlers, name)
        if handler in handlers:
            handlers.remove(handler)
    live.stop_timer()
    session.rendering = session.baking = session.writing = False
    states.clear()
