"""Scenes as numpy arrays: meshes with UVs, and their positions frame by frame, from USD, Alembic or OBJ files."""

from __future__ import annotations

import os
from collections.abc import Iterator, Sequence
from contextlib import AbstractContextManager, contextmanager, nullcontext

import numpy as np

from vrtm.bake.left_out import LeftOut
from vrtm.bake.scene.timing import Clock
from vrtm.bake.scene.types import SceneError, SceneOptions, Shape, Source
from vrtm.bake.words import cause

__all__ = ["Scene", "SceneError", "SceneOptions", "Shape"]

_USD = (".usd", ".usda", ".usdc", ".usdz")


class Scene:
    """An open scene file. A context manager; not for several threads at once.

    Raises SceneError, here and in `positions`, for input that cannot be used.
    """

    def __init__(self, path: str | os.PathLike[str], options: SceneOptions | None = None) -> None:
        self.path = os.fspath(path)
        self.options = options or SceneOptions()
        if not os.path.isfile(self.path):
            raise SceneError(f"{self.path}: no such file")
        self._said: list[LeftOut | str] = []
        self._says = any(path.lower().endswith(_USD) for path in (self.path, self.options.rest or ""))
        try:
            with self._reading():
                self._source = _open(self.path, self.options)
        except SceneError as error:
            # What a stage lacks may be why nothing is in it.
            missing = [entry.line() for entry in self._said if isinstance(entry, LeftOut)]
            raise SceneError("; ".join([str(error), *missing[:3]])) from error
        for entry in self.said():
            (self.left_out if isinstance(entry, LeftOut) else self.warnings).append(entry)
        self._at_rest = {shape.name: shape for shape in self._source.shapes}

    @property
    def shapes(self) -> tuple[Shape, ...]:
        """The meshes, in the order of the file."""
        return self._source.shapes

    @property
    def frames(self) -> Sequence[int]:
        """The whole frames that the scene has, ascending."""
        return self._source.frames

    @property
    def has_subframes(self) -> bool:
        """Whether there are positions between two of the frames."""
        return self._source.has_subframes

    @property
    def clock(self) -> Clock:
        """Which time of the file, time code or second, each frame is at."""
        return self._source.clock

    @property
    def rate(self) -> str:
        """How frames are counted, in words; empty where there is nothing to choose."""
        return self._source.rate

    @property
    def warnings(self) -> list[str]:
        """What was noticed while reading, each as a sentence that begins with the prim, or the file."""
        return self._source.warnings

    @property
    def left_out(self) -> list[LeftOut]:
        """What of the file is not read, or not taken, and why."""
        return self._source.left_out

    @property
    def files(self) -> tuple[str, ...]:
        """The files that are read for the scene and exist, and the textures that its materials name: what no output
        may replace. Files that vrtm wrote earlier do not count."""
        rest = self.options.rest
        with self._reading():
            return (*self._source.files, *(_files_of(rest) if rest is not None and os.path.isfile(rest) else ()))

    @property
    def is_usd(self) -> bool:
        """Whether the file is one of USD."""
        return self.path.lower().endswith(_USD)

    @property
    def source(self) -> Source:
        """The reader of this kind of file."""
        return self._source

    def said(self) -> list[LeftOut | str]:
        """What USD has said by itself since this was asked last: what it lacks, and warnings."""
        said, self._said = self._said, []
        return said

    def listening(self) -> AbstractContextManager[None]:
        """What USD says in the block belongs to `said`, where the scene is one of USD."""
        if not self._says:
            return nullcontext()
        from vrtm.bake.scene.usd_said import collected

        return collected(self._said)

    @contextmanager
    def _reading(self) -> Iterator[None]:
        """What libraries raise that read a damaged file, which may be anywhere, becomes a SceneError."""
        try:
            with self.listening():
                yield
        except (RuntimeError, UnicodeDecodeError) as error:
            raise SceneError(f"{self.path}: cannot be read: {cause(error)}") from error

    def shape(self, name: str) -> Shape:
        """The shape of that name. Raises KeyError."""
        return self._at_rest[name]

    def positions(self, shape: Shape | str, frame: float) -> np.ndarray:
        """(vertices, 3), f32 or f64, of a shape at a frame: in the space of the mesh (that of its skeleton, if it has
        one), which is the space of `shape.rest`; without the transforms above the mesh."""
        shape = self._at_rest[shape] if isinstance(shape, str) else shape
        with self._reading():
            positions = np.ascontiguousarray(self._source.positions(shape, frame))
        if positions.shape != shape.rest.shape:
            raise SceneError(
                f"{self.path} {shape.path}: frame {frame:g} has {len(positions)} vertices, "
                f"the rest has {len(shape.rest)}"
            )
        return positions

    def close(self) -> None:
        """Lets go of the file."""
        self._source.close()

    def __enter__(self) -> Scene:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()


def _files_of(path: str) -> tuple[str, ...]:
    if os.path.splitext(path)[1].lower() not in _USD:
        return (path,)
    from vrtm.bake.scene.usd_stage import open_stage, stage_files

    return (path, *stage_files(open_stage(path, SceneOptions())))


def _open(path: str, options: SceneOptions) -> Source:
    kind = os.path.splitext(path)[1].lower()
    if options.texture_uv is not None and kind not in _USD:
        raise SceneError(f"{path}: a further UV set for textures is read from USD files only")
    if kind == ".obj":
        from vrtm.bake.scene.obj import ObjSource

        return ObjSource(path, options)
    if options.poses:
        raise SceneError(f"{path}: files of poses go with a mesh from an OBJ file only")
    if kind == ".abc":
        from vrtm.bake.scene.alembic import AlembicSource

        return AlembicSource(path, options)
    if kind in _USD:
        from vrtm.bake.scene.usd import UsdSource

        return UsdSource(path, options)
    raise SceneError(f"{path}: '{kind}' is none of .usd, .usda, .usdc, .usdz, .abc, .obj")
