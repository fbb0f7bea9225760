"""Scenes as numpy arrays: meshes with UVs, and their positions frame by frame, from USD, Alembic or OBJ files."""

import os
from collections.abc import Iterator
from contextlib import AbstractContextManager, contextmanager, nullcontext

import numpy as np

from vrtm.bake.left_out import LeftOut
from vrtm.bake.scene.types import SceneError, SceneOptions, Shape, Source, reading

__all__ = ["Scene", "SceneError", "SceneOptions", "Shape"]

_USD = (".usd", ".usda", ".usdc", ".usdz")


class Scene(AbstractContextManager):
    """An open scene file. A context manager; not for several threads at once.

    Raises SceneError, here and in `positions`, for input that cannot be used.
    """

    def __init__(self, path: str | os.PathLike[str], options: SceneOptions | None = None) -> None:
        self.path = os.fspath(path)
        self.is_usd = self.path.lower().endswith(_USD)
        self.options = options or SceneOptions()
        if not os.path.isfile(self.path):
            raise SceneError(f"{self.path}: no such file")
        self._said: list[LeftOut | str] = []
        self._says = any(path.lower().endswith(_USD) for path in (self.path, self.options.rest or ""))
        try:
            with self._reading():
                source = self.source = _open(self.path, self.options)
        except SceneError as error:
            # A missing layer may be why the stage is empty.
            missing = [entry.line() for entry in self._said if isinstance(entry, LeftOut)]
            raise SceneError("; ".join([str(error), *missing[:3]])) from error
        self.shapes: tuple[Shape, ...] = source.shapes
        """The meshes, in the order of the file."""
        self.frames, self.has_subframes = source.frames, source.has_subframes
        self.clock, self.rate = source.clock, source.rate
        self.warnings: list[str] = source.warnings
        """Sentences, each of which begins with the prim, or the file."""
        self.left_out: list[LeftOut] = source.left_out
        for entry in self.said():
            (self.left_out if isinstance(entry, LeftOut) else self.warnings).append(entry)
        self._at_rest = {shape.name: shape for shape in self.shapes}

    @property
    def files(self) -> tuple[str, ...]:
        """The files that are read for the scene and exist, and the textures that its materials name: what no output
        may replace. Files that vrtm wrote earlier do not count."""
        rest = self.options.rest
        with self._reading():
            return (*self.source.files, *(_files_of(rest) if rest is not None and os.path.isfile(rest) else ()))

    def said(self) -> list[LeftOut | str]:
        """Messages of USD since the last call: missing parts, and warnings."""
        said, self._said = self._said, []
        return said

    def listening(self) -> AbstractContextManager[None]:
        """Collects USD's messages in the block for `said`, if the scene is one of USD."""
        if not self._says:
            return nullcontext()
        from vrtm.bake.scene.usd_stage import collected

        return collected(self._said)

    @contextmanager
    def _reading(self) -> Iterator[None]:
        with reading(self.path), self.listening():
            yield

    def shape(self, name: str) -> Shape:
        """The shape of that name. Raises KeyError."""
        return self._at_rest[name]

    def positions(self, shape: Shape | str, frame: float) -> np.ndarray:
        """(vertices, 3), f32 or f64, of a shape at a frame: in the space of the mesh (that of its skeleton, if it has
        one), which is the space of `shape.rest`; without the transforms above the mesh."""
        shape = self._at_rest[shape] if isinstance(shape, str) else shape
        with self._reading():
            positions = np.ascontiguousarray(self.source.positions(shape, frame))
        if positions.shape != shape.rest.shape:
            told = f"frame {frame:g} has {len(positions)} vertices, the rest has {len(shape.rest)}"
            raise SceneError(f"{self.path} {shape.path}: {told}")
        return positions

    def seconds(self, frame: float) -> float:
        """The time of a frame."""
        return self.clock.time(frame) / self.source.codes

    def places(self, shape: Shape) -> list[np.ndarray]:
        """(4, 4) of each instance of a shape, by which rows of its rest are multiplied to lie in the world, by the
        transforms at the frame of the rest."""
        with self._reading():
            return self.source.places(shape)

    def bystanders(self) -> list[tuple[np.ndarray, np.ndarray]]:
        """The rest of each mesh that is shown and is no shape, as far as it can be read, and its (4, 4) as above."""
        with self._reading():
            return list(self.source.bystanders())

    def close(self) -> None:
        self.source.close()

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
