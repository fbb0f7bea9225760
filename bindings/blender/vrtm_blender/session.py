"""Blender's session: the library, its devices, and Blender's present activity."""

from __future__ import annotations

import contextlib
import importlib
import logging
import threading
from collections.abc import Iterator
from typing import TYPE_CHECKING

import bpy

from .messages import Problem

if TYPE_CHECKING:
    import vrtm

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


@contextlib.contextmanager
def during(flag: str) -> Iterator[None]:
    """Has a flag above set until the end of the block, however that ends."""
    before, globals()[flag] = globals()[flag], True
    try:
        yield
    finally:
        globals()[flag] = before


devices: dict[str, vrtm.Device] = {}


def library(module: str = "vrtm"):
    """The Python package, which comes as a wheel within the extension, or a module of it. It is imported late, so that
    the add-on can be registered, and tell what is wrong, where it is not there or not for this system."""
    try:
        return importlib.import_module(module)
    except (ImportError, OSError) as error:
        raise Problem(f"the vrtm library cannot be loaded: {error}") from error


def device(name: str) -> vrtm.Device:
    with _making:
        if name not in devices:
            devices[name] = library().Device(name, log=_log)
        return devices[name]


_making = threading.Lock()
_ear = threading.local()


@contextlib.contextmanager
def listening() -> Iterator[list[vrtm.LogEntry]]:
    """The library's warnings on this thread until the end of the block."""
    before, _ear.lines = getattr(_ear, "lines", None), []
    try:
        yield _ear.lines
    finally:
        _ear.lines = before


def _log(entry: vrtm.LogEntry) -> None:
    warning = entry.level == "warning"
    if warning and getattr(_ear, "lines", None) is not None:
        _ear.lines.append(entry)
    log.log(logging.WARNING if warning else logging.DEBUG, "%s", entry.message)


def areas(*kinds: str) -> list[bpy.types.Area]:
    """The editors of these kinds in all windows."""
    manager = bpy.context.window_manager
    found = [area for window in (manager.windows if manager is not None else ()) for area in window.screen.areas]
    return [area for area in found if area.type in kinds]


def shows_materials() -> bool:
    """True if a 3D view shows materials, or there is none."""
    views = [area.spaces.active.shading.type for area in areas("VIEW_3D")]
    return not views or bool({"MATERIAL", "RENDERED"} & set(views))


def synchronous() -> bool:
    """True if a frame is solved at once, and not beside Blender's work."""
    return rendering or baking or (bpy.app.background and not live_in_background)
