"""The live update: handlers say that an object's pose may have changed; a timer, on the main thread, collects the
pose, hands it to a job beside Blender's work, and writes the result when the job is done. The newest pose wins: a job
for an older one is cancelled."""

from __future__ import annotations

import concurrent.futures
import time

import bpy

from . import messages, results, session, solve, states
from .messages import Problem, text_of
from .states import State
from .work import Work

# Seconds between two looks at jobs that are under way, and until a pose is collected.
INTERVAL = 0.02
# A job that has run for so many seconds while nothing was shown is not cancelled any more: else a steady scrub over a
# heavy mesh would never show anything.
PATIENCE = 0.4
# A pose that follows another one within so many seconds moves: it is solved as a draft where a solve has taken longer
# than a frame, and again when it rests.
REST = 0.3
FRAME = 0.04


def touch(obj: bpy.types.Object, mesh: bool = True, maps: bool = True) -> None:
    """Notes that an input of the object's result may have changed."""
    if session.writing:
        return
    state = states.find_state(obj)
    if state is not None:
        state.mesh_changed |= mesh
        state.maps_changed |= maps
    doubt()
    if is_live(obj) and not session.synchronous():
        want(obj)


def touch_carried(skin: bpy.types.Object | None) -> None:
    """Notes that a thing that the object carries may have changed."""
    if skin is not None and not session.writing:
        state = states.find_state(skin)
        if state is not None:
            state.carried_changed = True
        touch(skin, mesh=False, maps=False)


def is_live(obj: bpy.types.Object) -> bool:
    return obj.type == "MESH" and obj.vrtm.live


def want(obj: bpy.types.Object) -> None:
    """Has the object's pose collected by the timer."""
    state, now = states.state_of(obj), time.monotonic()
    state.moves, state.wanted_at, state.wanted = now - state.wanted_at < REST, now, True
    state.is_draft = False
    _start_timer()


def doubt() -> None:
    """Something has changed: the timer compares each result that is shown with the present pose."""
    if session.synchronous():
        return
    for state in states.known.values():
        if state.shown:
            state.doubted = True
            _start_timer()


def _start_timer() -> None:
    if not bpy.app.timers.is_registered(poll):
        bpy.app.timers.register(poll, first_interval=INTERVAL)


def stop(obj: bpy.types.Object) -> None:
    state = states.find_state(obj)
    if state is not None:
        state.cancel_job()
        state.say("")


def stop_timer() -> None:
    if bpy.app.timers.is_registered(poll):
        bpy.app.timers.unregister(poll)


def poll() -> float | None:
    """The timer's function: returns the seconds until it wants to be called again, or None for never."""
    if session.rendering and not bpy.app.background and not bpy.app.is_job_running("RENDER"):
        # A render that ended without a word.
        session.rendering = False
    if session.synchronous():
        return INTERVAL if session.rendering or session.baking else None
    for state in list(states.known.values()):
        step(state)
    busy = [state for state in states.known.values() if state.wanted or state.doubted or state.job is not None]
    return INTERVAL if busy else None


def step(state: State) -> None:
    """Does the next step for one object."""
    if not (state.wanted or state.doubted) and state.job is None:
        return
    obj = states.object_of(state)
    if obj is None:
        states.drop(state.uid)
        return
    try:
        if state.job is not None and state.job.done():
            take(obj, state)
        if state.wanted and not (state.is_draft and time.monotonic() - state.wanted_at < REST):
            collect(obj, state)
        elif state.doubted and state.job is None and time.monotonic() >= state.next_look:
            look(obj, state)
    except Exception as error:  # a timer that raises is never called again, and the artist has to be told.
        state.cancel_job()
        tell(state, text_of(error), error=True)
        if not isinstance(error, Problem):
            session.log.warning("%s: %s", obj.name, text_of(error), exc_info=not hasattr(error, "status_name"))


def take(obj: bpy.types.Object, state: State) -> None:
    """Writes the result of a job that is over, if it has one."""
    job = state.take_job()
    try:
        outcome = job.result()
    except concurrent.futures.CancelledError:
        return
    if obj.mode == "EDIT":
        return
    results.publish(obj, state, job.request, outcome)
    state.waiting_since = 0.0
    if job.request.is_draft:
        # Until the pose rests.
        state.fresh, state.is_draft, state.wanted = False, not state.wanted, True
    else:
        state.seconds = job.seconds
    tell(state, state.message, state.error)


def collect(obj: bpy.types.Object, state: State) -> None:
    """Submits the object's present pose, unless it is shown or under way already."""
    if obj.mode == "EDIT":
        # Leaving Edit Mode is an update of the mesh, which asks again.
        state.cancel_job()
        tell(state, "In Edit Mode: results are computed when you leave it")
        return
    layer = bpy.context.view_layer
    if layer is None or obj.name not in layer.objects:
        state.wanted = False
        return
    solve.read(obj, state)
    request = full = solve.request(obj, state, bpy.context.evaluated_depsgraph_get())
    if state.moves and state.seconds > FRAME and time.monotonic() - state.wanted_at < REST:
        request = solve.draft(full)
    state.doubted = state.is_draft = False
    if state.job is not None:
        if state.job.request.stamp in (request.stamp, full.stamp):
            state.wanted = False
        elif time.monotonic() - state.waiting_since < PATIENCE:
            # It ends within milliseconds; the pose, or a newer one, is submitted at the timer's next call.
            state.job.cancel()
        return
    state.wanted = False
    if results.is_shown(obj, state, full) and not state.rewrite:
        results.still_right(state, full)
        tell(state, "")
        return
    state.job = Work(state.prepared, state.inputs.take(), request)
    state.waiting_since = state.waiting_since or time.monotonic()
    tell(state, "")


def look(obj: bpy.types.Object, state: State) -> None:
    """Finds out if the result of the present pose is shown. An object for which that takes long is looked at seldom."""
    begun, before = time.monotonic(), state.fresh
    state.doubted = state.fresh = False
    layer = bpy.context.view_layer
    if obj.mode != "EDIT" and obj.vrtm.is_followed and layer is not None and obj.name in layer.objects:
        try:
            solve.read(obj, state)
            request = solve.request(obj, state, bpy.context.evaluated_depsgraph_get())
        except Problem:
            # It is told when a solve is asked for.
            request = None
        if request is not None and results.is_shown(obj, state, request) and not results.was_taken_back(obj, state):
            results.still_right(state, request)
    if is_live(obj) and not state.fresh:
        state.wanted = True
    if state.fresh != before:
        redraw()
    state.next_look = time.monotonic() + 10 * (time.monotonic() - begun)


def tell(state: State, message: str, error: bool = False) -> None:
    """Shows a message in the panel, and problems in the status bar, too."""
    state.say(message, error)
    messages.status(f"vrtm: {message}" if error else None)
    redraw()


def redraw() -> None:
    for area in session.areas("PROPERTIES", "VIEW_3D", "IMAGE_EDITOR"):
        area.tag_redraw()
