"""The options of a solve."""

import ctypes
from collections.abc import Callable, Sequence
from typing import Any, get_type_hints

from numpy.typing import ArrayLike

from . import _abi
from ._arrays import Pinned
from ._library import new
from ._names import fill, known, natural, put, value_of
from ._records import PbdSettings, SolveFields
from ._tile import Tile


class SolveOptions(SolveFields, total=False):
    """Keyword arguments of Asset.solve, redirect and submit; omitted options have the library's defaults."""

    release_last: bool
    """Drop the last results before solving, which saves their memory."""
    release_solvers: bool
    """Free the memory of each tile's solver once the tile is solved: that of one tile is needed at a time."""
    tiles: Sequence[Tile] | None
    """The tiles to solve; None = all. The others keep their results."""
    dirty_vertices: ArrayLike | None
    """The vertices that have moved since the last solve, as integers; None = any may have."""
    progress: Callable[[float], Any] | None
    """Called with 0..1, at most 500 times per second, on the thread that does the work. If it returns True or raises
    an exception, the solve is cancelled; the exception is raised again by the call, or by the job's result."""


class Progress:
    """A progress function for the library: it keeps the exception that the caller's function raised."""

    def __init__(self, function: Callable[[float], Any]) -> None:
        if not callable(function):
            raise TypeError(f"progress: {function!r} cannot be called")
        self.error: BaseException | None = None

        def tell(_user: int, fraction: float) -> int:
            if self.error is not None:
                return 1
            try:
                return 1 if function(fraction) is True else 0
            except BaseException as error:
                self.error = error
                return 1

        self.function = _abi.vrtm_progress_fn(tell)


_HINTS = get_type_hints(SolveFields)


def _value(name: str, hint: type, value: Any) -> Any:
    if hint in (int, float):
        return natural(name, value, 32) if hint is int else value
    return int(bool(value)) if hint is bool else value_of(name, value)


def build(pinned: Pinned, options: SolveOptions) -> tuple[Any, Progress | None]:
    """The library's struct, and the progress function if there is one."""
    known("option of a solve", options, SolveOptions.__annotations__)
    struct = pinned.keep(new(_abi.vrtm_solve_options))
    for name, hint in _HINTS.items():
        if name != "pbd" and name in options:
            put(struct, name, _value(name, hint, options[name]))
    if (pbd := options.get("pbd")) is not None:
        if not isinstance(pbd, PbdSettings):
            raise TypeError(f"pbd: {pbd!r} is no vrtm.PbdSettings")
        fill(struct.pbd, pbd)
    struct.release = _abi.VRTM_RELEASE_RESULTS * bool(options.get("release_last"))
    struct.release |= _abi.VRTM_RELEASE_SOLVERS * bool(options.get("release_solvers"))
    if (tiles := options.get("tiles")) is not None:
        if isinstance(tiles, Tile) or not all(isinstance(tile, Tile) for tile in tiles):
            raise TypeError(f"tiles: {tiles!r} is no list of vrtm.Tile")
        handles = pinned.keep((_abi.vrtm_tile * max(len(tiles), 1))(*(tile._handle for tile in tiles)))
        struct.tiles, struct.tile_count = ctypes.cast(handles, ctypes.POINTER(_abi.vrtm_tile)), len(tiles)
    if (dirty := options.get("dirty_vertices")) is not None:
        vertices = pinned.indices("dirty_vertices", dirty)
        struct.dirty_vertices, struct.dirty_vertex_count = vertices.ctypes.data, len(vertices)
    progress = None
    if (function := options.get("progress")) is not None:
        progress = pinned.keep(Progress(function))
        struct.progress = progress.function
    return struct, progress
