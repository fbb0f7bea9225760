"""The state of each object: its asset, its job and the last message.

All of it is a cache. Nothing here refers to Blender's data: objects are known by their session_uid, which survives
renaming and undo, so that an undo, a deletion or another file cannot leave a dead pointer behind.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

import bpy
import numpy as np

from . import session
from .features import Features
from .prepared import Inputs, Prepared
from .work import Work

if TYPE_CHECKING:
    import vrtm


@dataclass
class State:
    """One object's."""

    uid: int
    name: str
    prepared: Prepared
    inputs: Inputs
    counts: tuple[int, int, int] = (0, 0, 0)
    # Stamps of the inputs that were read last.
    stamps: dict[str, Any] = field(default_factory=dict)
    # Inputs to be read again before the next solve.
    mesh_changed: bool = True
    maps_changed: bool = True
    carried_changed: bool = True
    # A pose is to be collected by the timer.
    wanted: bool = False
    job: Work | None = None
    # The request whose result was written, its frame, and its corner UVs.
    shown: bytes = b""
    frame: int = 0
    uvs: np.ndarray | None = None
    # True if that is the result of the present pose, as far as is known; True if it is to be compared with it; the time
    # before which it is not.
    fresh: bool = False
    doubted: bool = False
    next_look: float = 0.0
    # Results are to be written again, also if nothing has changed: an undo may have taken back what was written, or the
    # artist asks for it.
    rewrite: bool = False
    waiting_since: float = 0.0
    # The time of the last wanted pose, and True if it followed another one at once; seconds of the last solve that was
    # no draft; True if a draft is shown, which is solved again when the pose rests.
    wanted_at: float = 0.0
    moves: bool = False
    seconds: float = 0.0
    is_draft: bool = False
    message: str = ""
    error: bool = False
    # Notes of the library and of this add-on on the result that is shown.
    notes: list[str] = field(default_factory=list)
    questions: list[str] = field(default_factory=list)
    figures: list[tuple[str, str]] = field(default_factory=list)
    features: Features = field(default_factory=Features)
    # As picture.py has them.
    measured: dict[tuple[str, str], float] = field(default_factory=dict)
    looked_at: int = 0  # presses of Show Worst Feature since then

    @property
    def asset(self) -> vrtm.Asset | None:
        return self.prepared.asset

    def read_again(self) -> None:
        """Has all inputs read again before the next solve; unchanged ones stay prepared."""
        self.mesh_changed = self.maps_changed = self.carried_changed = True

    def take_job(self) -> Work | None:
        """The job, which the state has no longer. Inputs that it has not used are kept for the next."""
        job, self.job = self.job, None
        if job is not None and not job.applied:
            self.inputs.give_back(job.inputs)
        return job

    def cancel_job(self) -> None:
        """Has the job end soon, if there is one, and nothing wanted any more."""
        if self.job is not None:
            self.job.cancel()
        self.wanted = False

    def end_job(self) -> None:
        """Cancels the job, if there is one, and waits for its end: milliseconds, unless a mesh is being prepared."""
        if self.job is not None:
            self.job.close()
            self.take_job()

    @property
    def progress(self) -> str:
        """State of the object's job, in words."""
        if self.is_draft:
            return "Draft while it moves"
        done = self.job.progress if self.job is not None else None
        return "Preparing ..." if done is None else f"Solving ... {100 * done:.0f} %"

    def say(self, message: str, error: bool = False) -> None:
        self.message, self.error = message, error


known: dict[int, State] = {}


def state_of(obj: bpy.types.Object) -> State:
    uid = obj.session_uid
    state = known.get(uid)
    if state is None:
        state = known[uid] = State(uid, obj.name, Prepared(), Inputs())
    state.name = obj.name
    return state


def find_state(obj: bpy.types.Object) -> State | None:
    """The object's state if it has one: for drawing, which must not change anything."""
    return known.get(obj.session_uid)


def object_of(state: State) -> bpy.types.Object | None:
    """The object as it is now, or None if it is gone."""
    obj = bpy.data.objects.get(state.name)
    if obj is not None and obj.session_uid == state.uid:
        return obj
    return next((obj for obj in bpy.data.objects if obj.session_uid == state.uid), None)


def drop(uid: int) -> None:
    state = known.pop(uid, None)
    if state is not None:
        state.end_job()
        state.prepared.close()


def forget_gone() -> None:
    """Drops the states of objects that are gone."""
    alive = {obj.session_uid for obj in bpy.data.objects}
    for uid in [uid for uid in known if uid not in alive]:
        drop(uid)


def clear() -> None:
    """Ends all jobs, assets and devices: nothing of the library is left."""
    for uid in list(known):
        drop(uid)
    for name in list(session.devices):
        session.devices.pop(name).close()
