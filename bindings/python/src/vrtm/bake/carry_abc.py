"""Geometry on the skin in Alembic archives: objects at rest, and the archive in which they move."""

from __future__ import annotations

import json
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from typing import Any

import numpy as np
from alembic3d import AbcGeom

from vrtm.bake import overwrite
from vrtm.bake.carry_prims import CarriedPrim, made, wrong
from vrtm.bake.failure import INPUT, Failure
from vrtm.bake.fingerprint import Fingerprint
from vrtm.bake.scene import Scene
from vrtm.bake.scene.alembic_copy import Motion, write_archive
from vrtm.bake.scene.alembic_file import AlembicFile, AlembicMesh, to_world
from vrtm.bake.words import cause, near

_KINDS = {"Points": "points", "Curves": "curves", "PolyMesh": "mesh", "SubD": "mesh"}
"""Objects that can be carried, by the names of their schemas."""


@dataclass(frozen=True)
class _Found:
    """An object of the archive."""

    object: Any
    parent: Any
    above: tuple[Any, ...]
    """The transforms above it."""
    schema: str
    """One of `_KINDS`, or empty."""


class AlembicScatter:
    """Objects of an archive. See `vrtm.bake.carry_prims.Scatter`."""

    def __init__(self, archive: AlembicFile, scene: Scene) -> None:
        self._scene, self._archive, self._file = scene, archive, archive.path
        # A shot of USD counts time codes.
        self._seconds = 1 / scene.source.stage.GetTimeCodesPerSecond() if scene.is_usd else 1.0
        self.files: tuple[str, ...] = () if overwrite.is_ours(archive.path) else (archive.path,)
        self.warnings: list[str] = []
        self._carried: set[str] = set()
        self._motions: dict[str, Motion] = {}
        with self._reading():
            self._objects = {found.object.getFullName(): found for found in _below(self._archive.top)}

    def time(self, frame: float) -> float:
        return self._scene.clock.time(frame) * self._seconds

    def prims(self, path: str, frame: float, baked: Sequence[str], in_parts: bool) -> list[CarriedPrim]:
        where, below = f"--carry-prims {path}", f"{path.rstrip('/')}/"
        if below != "/" and path not in self._objects:
            raise Failure(INPUT, f"{where}: {self._file} has no such object{near(path, self._objects)}")
        paths = [
            name
            for name, found in self._objects.items()
            if found.schema and name not in baked and (name == path or name.startswith(below))
        ]
        if not paths:
            kinds = ", ".join(_KINDS)
            raise Failure(INPUT, f"{where}: in {self._file} it is none of {kinds} that is not baked, nor has one below")
        prims = []
        for name in paths:
            with self._reading():
                carried = self._read(name, self.time(frame), in_parts)
            if isinstance(carried, str):
                raise Failure(INPUT, f"{where}: {self._file} {name}: {carried}")
            prims.append(carried)
        self._carried.update(paths)
        return prims

    def to_world(self, prim: CarriedPrim, frame: float) -> np.ndarray:
        with self._reading():
            return to_world(self._objects[prim.path].above, self.time(frame))

    def digest(self) -> str:
        """All of the objects goes into the file: also widths, transforms and faces."""
        digest = Fingerprint().text(self._rate)
        with self._reading():
            for path in sorted(self._kept()):
                digest.text(path, self._objects[path].object.getPropertiesHash())
        return digest.hex()

    def add(self, prim: CarriedPrim, time: float, points: np.ndarray, turns: np.ndarray | None) -> None:
        self._motions.setdefault(prim.path, Motion(self._rate)).add(time, points)

    def write(self, path: str, inputs: str, told: str) -> list[str]:
        description = json.dumps({"inputs": inputs, "told": told})
        kept = self._kept()
        with self._reading():
            return write_archive(path, self._archive.top, kept, self._motions, self._rate, description)

    def known(self, path: str, inputs: str) -> str | None:
        if not overwrite.is_ours(path):
            return None
        try:
            found = json.loads(AlembicFile(path).description)
            return found["told"] if found["inputs"] == inputs else None
        except Exception:
            # It is damaged, or of another version.
            return None

    @property
    def _rate(self) -> float:
        """Frames per second, for programs that read the archive."""
        return self._archive.rate or 1 / (self.time(1) - self.time(0))

    def _kept(self) -> set[str]:
        """The objects that the archive has: those that are carried, the transforms above and the face sets below."""
        kept = set(self._carried)
        for path in self._carried:
            parts = path.split("/")
            kept.update("/".join(parts[:end]) for end in range(2, len(parts)))
        sets = (path for path, found in self._objects.items() if AbcGeom.IFaceSet.matches(found.object.getHeader()))
        return kept | {path for path in sets if path.rsplit("/", 1)[0] in self._carried}

    def _read(self, path: str, seconds: float, in_parts: bool) -> CarriedPrim | str:
        """An object at a time, or why it cannot be carried, as the end of a sentence."""
        found = self._objects[path]
        schema = getattr(AbcGeom, f"I{found.schema}")(found.parent, found.object.getName()).getSchema()
        posed = AlembicMesh(self._file, path, path, schema, found.above, False)
        counts = {posed.count(index) for index in range(posed.samples)}
        changes = found.schema != "Points" and str(schema.getTopologyVariance()) == "kHeterogenousTopology"
        if changes or len(counts) > 1:
            return "has another topology in some samples, and cannot be bound once"
        points = posed.at(seconds, None).astype(np.float64) if counts else np.zeros((0, 3))
        curves = None
        if found.schema == "Curves":
            curves = np.array(schema.getNumVerticesProperty().getValue(), np.int64)
        why = wrong(points, curves)
        if why is not None:
            return why
        self.warnings += [
            f"{path}: {name} stays as it is: archives do not agree on the order of a quaternion's numbers"
            for name in posed.params()
            if found.schema == "Points" and posed.interpretation(name) == "quat"
        ]
        is_mesh = _KINDS[found.schema] == "mesh"
        faces = posed.faces(0) if is_mesh and in_parts else None
        return made(path, _KINDS[found.schema], points, curves, None, faces)

    @contextmanager
    def _reading(self) -> Iterator[None]:
        """An archive may be damaged anywhere."""
        try:
            yield
        except (RuntimeError, UnicodeDecodeError) as error:
            raise Failure(INPUT, f"{self._file}: cannot be read: {cause(error)}") from error


def _below(parent: Any, above: tuple[Any, ...] = ()) -> Iterator[_Found]:
    for number in range(parent.getNumChildren()):
        child = parent.getChild(number)
        header = child.getHeader()
        schema = next((name for name in _KINDS if getattr(AbcGeom, f"I{name}").matches(header)), "")
        yield _Found(child, parent, above, schema)
        is_xform = AbcGeom.IXform.matches(header)
        own = (*above, AbcGeom.IXform(parent, child.getName()).getSchema()) if is_xform else above
        yield from _below(child, own)
