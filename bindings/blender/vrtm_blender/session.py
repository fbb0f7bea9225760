"""What lives as long as Blender's session: devices, and for each object its asset, its job and what was last heard of
it.

All of it is a cache. Nothing here refers to Blender's data: objects are known by their session_uid, which survives
renaming and undo, so that an undo, a deletion or another file cannot leave a dead pointer behind.
"""

from __future__ import annotations

import logging
import time
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

import bpy
import numpy as np

from .messages import Problem

if TYPE_CHECKING:
    import vrtm

    from .work import Work

log = logging.getLogger("vrtm.blender")

# Set while results are written, so that the updates which that causes are not taken for the artist's.
writing = False
# Set from the beginning of a render to its end, and while files are baked.
rendering = False
baking = False
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


@dataclass
class State:
    """One object's."""

    uid: int
    name: str
    asset: vrtm.Asset | None = None
    counts: tuple[int, int, int] = (0, 0, 0)
    stamps: dict[str, Any] = field(default_factory=dict)
    # The rigidity images that were set, by UDIM number.
    painted: dict[int, np.ndarray] = field(default_factory=dict)
    # What has to be read again before the next solve.
    mesh_changed: bool = True
    maps_changed: bool = True
    # A pose is to be collected by the timer.
    wanted: bool = False
    job: Work | None = None
    # The request whose result was written.
    shown: bytes = b""
    waiting_since: float = 0.0
    message: str = ""
    error: bool = False
    figures: list[tuple[str, str]] = field(default_factory=list)

    def end_job(self) -> None:
        """Cancels the job, if there is one, and waits for its end: milliseconds."""
        job, self.job = self.job, None
        if job is not None:
            job.close()

    def end_asset(self) -> None:
        self.end_job()
        asset, self.asset = self.asset, None
        self.stamps.clear()
        self.painted.clear()
        self.shown = b""
        if asset is not None:
            asset.close()

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
        state = states[uid] = State(uid, obj.name)
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
    if name not in devices:
        devices[name] = library().Device(name, log=_log)
    return devices[name]


def _log(level: str, message: str) -> None:
    log.log(logging.WARNING if level == "warning" else logging.DEBUG, "%s", message)


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
