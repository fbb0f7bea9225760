"""What lives as long as Blender's session: devices, and for each object its asset, its job and what was last heard of
it.

All of it is a cache. Nothing here refers to Blender's data: objects are known by their session_uid, which survives
renaming and undo, so that an undo, a deletion or another file cannot leave a dead pointer behind.
"""

from __future__ import annotations

import contextlib
import logging
import threading
import time
from collections.abc import Iterator
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

import bpy
import numpy as np

from .messages import Problem

if TYPE_CHECKING:
    import vrtm

    from .prepared import Inputs, Prepared
    from .work import Work

log = logging.getLogger("vrtm.blender")

# Set while results are written, so that the updates which that causes are not taken for the artist's.
writing = False
# Set from the beginning of a render to its end, and while files are baked.
rendering = False
baking = False
# Set within handlers of frame changes, where nothing may be evaluated.
handling = False
# In background mode there is no event loop that would call a timer, so frames are solved at once. Tests of the live
# path set this, and call the timer's function themselves.
live_in_background = False


@dataclass
class Request:
    """A pose to be solved."""

    positions: np.ndarray  # (vertices, 3) float32
    options: dict[str, Any]
    stamp: bytes  # of all that the result depends on
    # What is to be fetched of the result; the object's name is for messages.
    name: str
    map_size: int
    write_image: bool
    write_uvs: bool
    write_delta: bool
    strain: str  # "NONE", "BEFORE" or "AFTER"
    frame: int = 0


@dataclass
class State:
    """One object's."""

    uid: int
    name: str
    prepared: Prepared
    inputs: Inputs
    counts: tuple[int, int, int] = (0, 0, 0)
    # What the inputs that were read last depend on.
    stamps: dict[str, Any] = field(default_factory=dict)
    # What has to be read again before the next solve.
    mesh_changed: bool = True
    maps_changed: bool = True
    # A pose is to be collected by the timer.
    wanted: bool = False
    job: Work | None = None
    # The request whose result was written, its frame, and its corner UVs.
    shown: bytes = b""
    frame: int = 0
    uvs: np.ndarray | None = None
    # Whether that is the result of the present pose, as far as is known; whether it is to be looked at, and not before.
    fresh: bool = False
    doubted: bool = False
    next_look: float = 0.0
    # Results are to be written again, also if nothing has changed: an undo may have taken back what was written, or the
    # artist asks for it.
    rewrite: bool = False
    waiting_since: float = 0.0
    message: str = ""
    error: bool = False
    # What the library, or this add-on, has to say of the result that is shown.
    notes: list[str] = field(default_factory=list)
    figures: list[tuple[str, str]] = field(default_factory=list)

    @property
    def asset(self) -> vrtm.Asset | None:
        return self.prepared.asset

    def take_job(self) -> Work | None:
        """The job, which is none any more. What it has not used of what was read is kept for the next."""
        job, self.job = self.job, None
        if job is not None and not job.applied:
            self.inputs.give_back(job.inputs)
        return job

    def end_job(self) -> None:
        """Cancels the job, if there is one, and waits for its end: milliseconds, but while a mesh is prepared."""
        if self.job is not None:
            self.job.close()
            self.take_job()

    def end_asset(self) -> None:
        self.end_job()
        self.prepared.close()
        self.inputs.take()
        self.stamps.clear()
        self.shown = b""

    def say(self, message: str, error: bool = False) -> None:
        self.message, self.error = message, error


states: dict[int, State] = {}
devices: dict[str, vrtm.Device] = {}


def library():
    """The Python package, which comes as a wheel within the extension. It is imported late, so that the add-on can be
    registered, and tell what is wrong, where it is not there or not for this system."""
    try:
        import vrtm
    except (ImportError, OSError) as error:
        raise Problem(f"the vrtm library cannot be loaded: {error}") from error
    return vrtm


def uid_of(obj: bpy.types.Object) -> int:
    return obj.session_uid


def state_of(obj: bpy.types.Object) -> State:
    uid = uid_of(obj)
    state = states.get(uid)
    if state is None:
        from .prepared import Inputs, Prepared

        state = states[uid] = State(uid, obj.name, Prepared(), Inputs())
    state.name = obj.name
    return state


def find_state(obj: bpy.types.Object) -> State | None:
    """The object's state if it has one: for drawing, which must not change anything."""
    return states.get(uid_of(obj))


def object_of(state: State) -> bpy.types.Object | None:
    """The object as it is now, or None if it is gone."""
    obj = bpy.data.objects.get(state.name)
    if obj is not None and uid_of(obj) == state.uid:
        return obj
    return next((obj for obj in bpy.data.objects if uid_of(obj) == state.uid), None)


def device(name: str) -> vrtm.Device:
    with _making:
        if name not in devices:
            devices[name] = library().Device(name, log=_log)
        return devices[name]


_making = threading.Lock()
_ear = threading.local()


@contextlib.contextmanager
def listening() -> Iterator[list[str]]:
    """What the library warns of on this thread until the end of the block."""
    before, _ear.lines = getattr(_ear, "lines", None), []
    try:
        yield _ear.lines
    finally:
        _ear.lines = before


def _log(level: str, message: str) -> None:
    warning = level == "warning"
    if warning and getattr(_ear, "lines", None) is not None:
        _ear.lines.append(message)
    log.log(logging.WARNING if warning else logging.DEBUG, "%s", message)


def drop(uid: int) -> None:
    state = states.pop(uid, None)
    if state is not None:
        state.end_asset()


def forget_gone() -> None:
    """Drops the states of objects that are gone."""
    alive = {uid_of(obj) for obj in bpy.data.objects}
    for uid in [uid for uid in states if uid not in alive]:
        drop(uid)


def clear() -> None:
    """Ends all jobs, assets and devices: nothing of the library is left."""
    for uid in list(states):
        drop(uid)
    for name in list(devices):
        devices.pop(name).close()


def synchronous() -> bool:
    """Whether a frame is to be solved at once, instead of beside Blender's work."""
    return rendering or baking or (bpy.app.background and not live_in_background)


def now() -> float:
    return time.monotonic()
