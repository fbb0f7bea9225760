"""Geometry on the surface in Alembic archives: objects at rest, and the archive in which they move."""

import errno
import json
import os
from collections.abc import Collection, Iterable, Iterator, Mapping, Sequence
from typing import Any

import imath
import numpy as np
from alembic3d import Abc, AbcCoreAbstract

from vrtm.bake import overwrite, staging
from vrtm.bake.carry_prims import CarriedPrim, Pose, Scatter, made, wrong
from vrtm.bake.fingerprint import Fingerprint
from vrtm.bake.scene import Scene
from vrtm.bake.scene.alembic_file import AlembicFile, AlembicMesh, AlembicObject, to_world
from vrtm.bake.scene.types import SceneError, reading
from vrtm.bake.words import cause

_KINDS = {"Points": "points", "Curves": "curves", "PolyMesh": "mesh", "SubD": "mesh"}
"""Objects that can be carried, by the names of their schemas."""
_EVEN = 1e-9
"""Seconds by which steps in time may differ."""
_BESIDE = 1 << 20
"""Bytes of an archive besides points that move, as a rule."""


class AlembicScatter(Scatter):
    """Objects of an archive."""

    def __init__(self, archive: AlembicFile, scene: Scene) -> None:
        super().__init__(archive.path, () if overwrite.is_ours(archive.path) else (archive.path,), "object", _KINDS)
        self._scene, self._archive = scene, archive
        self._carried: set[str] = set()
        self._motions: dict[str, Motion] = {}
        with reading(self._file):
            self._objects = {found.path: found for found in self._archive.objects()}

    def time(self, frame: float) -> float:
        return self._scene.seconds(frame)

    def _there(self, path: str) -> Iterable[str] | None:
        return None if path.rstrip("/") == "" or path in self._objects else self._objects

    def _below(self, path: str) -> list[str]:
        below = f"{path.rstrip('/')}/"
        return [name for name, found in self._objects.items() if _kind(found) and f"{name}/".startswith(below)]

    def to_world(self, prim: CarriedPrim, frame: float) -> np.ndarray:
        with reading(self._file):
            return to_world(self._objects[prim.path].above, self.time(frame))

    def digest(self) -> str:
        """All of the objects goes into the file: also widths, transforms and faces."""
        digest = Fingerprint().text(self._rate)
        with reading(self._file):
            for path in sorted(self._kept()):
                digest.text(path, self._objects[path].object.getPropertiesHash())
        return digest.hex()

    def add(self, prim: CarriedPrim, time: float, points: np.ndarray, turns: np.ndarray | None) -> None:
        self._motions.setdefault(prim.path, Motion(self._rate)).add(time, points)

    def write(self, path: str, inputs: str, told: str) -> list[str]:
        description = json.dumps({"inputs": inputs, "told": told})
        kept = self._kept()
        with reading(self._file):
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

    def differences(self, path: str, prim: CarriedPrim, times: Sequence[float], poses: Sequence[Pose]) -> Iterator[str]:
        archive = AlembicFile(path)
        found = next((found for found in archive.objects() if found.path == prim.path and _kind(found)), None)
        if found is None:
            yield "it is not there"
            return
        own = AlembicMesh(path, found, _kind(found))
        if own.samples != len(times) or (own.samples > 1 and not np.allclose(own.times(False), times, atol=_EVEN)):
            yield f"P: has {own.samples} samples, not {len(times)} at the times of the frames"
        for pose in poses:
            differs = pose.differs(own.at(pose.time, None), to_world(found.above, pose.time))
            if differs is not None:
                yield f"frame {pose.frame}: {differs}"

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
        sets = (path for path, found in self._objects.items() if found.matches("FaceSet"))
        return kept | {path for path in sets if path.rsplit("/", 1)[0] in self._carried}

    def _read(self, path: str, seconds: float, in_parts: bool) -> CarriedPrim | str:
        with reading(self._file):
            return self._read_object(path, seconds, in_parts)

    def _read_object(self, path: str, seconds: float, in_parts: bool) -> CarriedPrim | str:
        kind = _kind(self._objects[path])
        posed = AlembicMesh(self._file, self._objects[path], kind)
        counts = {posed.count(index) for index in range(posed.samples)}
        changes = kind != "Points" and str(posed.schema.getTopologyVariance()) == "kHeterogenousTopology"
        if changes or len(counts) > 1:
            return "has another topology in some samples, and cannot be bound once"
        points = posed.at(seconds, None).astype(np.float64) if counts else np.zeros((0, 3))
        of = posed.schema.getNumVerticesProperty().getValue() if kind == "Curves" else None
        curves = None if of is None else np.array(of, np.int64)
        why = wrong(points, curves)
        if why is not None:
            return why
        odd = [name for name in posed.params() if kind == "Points" and posed.interpretation(name) == "quat"]
        why = "stays as it is: archives do not agree on the order of a quaternion's numbers"
        self.warnings += [f"{path}: {name} {why}" for name in odd]
        self._carried.add(path)
        faces = posed.faces(0) if _KINDS[kind] == "mesh" and in_parts else None
        return made(path, _KINDS[kind], points, curves, None, faces)


def _kind(found: AlembicObject) -> str:
    """One of `_KINDS`, or empty."""
    return next(filter(found.matches, _KINDS), "")


class Motion:
    """The points of an object over time."""

    def __init__(self, rate: float) -> None:
        """`rate`: samples per second of a single one."""
        self._rate = rate
        self._samples: dict[float, np.ndarray] = {}

    def add(self, seconds: float, points: np.ndarray) -> None:
        self._samples[seconds] = np.ascontiguousarray(points, np.float32)

    @property
    def bytes(self) -> int:
        return sum(points.nbytes for points in self._samples.values())

    def points(self) -> Iterator[Any]:
        """The samples, in the order of their times."""
        return (imath.V3fArrayFromBuffer(self._samples[seconds]) for seconds in sorted(self._samples))

    def bounds(self) -> Iterator[Any]:
        for seconds in sorted(self._samples):
            low, high = (over(self._samples[seconds], axis=0).tolist() for over in (np.min, np.max))
            yield imath.Box3d(imath.V3d(*low), imath.V3d(*high))

    def sampling(self) -> Any:
        """The times, as even steps where they are."""
        times = sorted(self._samples)
        steps = np.diff(times) if len(times) > 1 else np.array([1 / self._rate])
        if np.ptp(steps) < _EVEN:
            return AbcCoreAbstract.TimeSampling(float(steps.mean()), times[0])
        kept = AbcCoreAbstract.TimeVector()
        for seconds in times:
            kept.append(seconds)
        acyclic = AbcCoreAbstract.TimeSamplingType(AbcCoreAbstract.AcyclicFlag.kAcyclic)
        return AbcCoreAbstract.TimeSampling(acyclic, kept)


def write_archive(
    path: str, top: Any, kept: Collection[str], motions: Mapping[str, Motion], rate: float, description: str
) -> list[str]:
    """Writes an archive with the objects `kept` below `top`, as they are but for the points of those that have a
    motion. Returns what is to be warned of. Raises OSError, and RuntimeError for what cannot be read."""
    # These letters end a value there.
    told = description.replace("=", "\\u003d").replace(";", "\\u003b")

    def body(temporary: str) -> None:
        _reserve(temporary, _BESIDE + sum(motion.bytes for motion in motions.values()))
        archive = Abc.CreateArchiveWithInfo(temporary, float(rate), "vrtm", told)
        _Copier(archive, kept, motions).below(top, archive.getTop())

    cut: list[str] = []

    def is_whole(temporary: str) -> bool:
        try:
            written = AlembicFile(temporary)
            cut.extend(_cut(top, written.top))
        except (RuntimeError, SceneError):
            return False
        return written.description == told

    staging.write(path, body, ".abc", is_whole)
    return cut


def _reserve(path: str, size: int) -> None:
    """Raises OSError if there is no room for a file: the package ends the process on a disk that is full."""
    if hasattr(os, "posix_fallocate"):
        with open(path, "wb") as file:
            os.posix_fallocate(file.fileno(), 0, size)


class _Copier:
    """Copies to an archive, which is whole once the copier is gone."""

    def __init__(self, archive: Any, kept: Collection[str], motions: Mapping[str, Motion]) -> None:
        self._archive, self._kept, self._motions = archive, kept, motions

    def below(self, source: Any, target: Any) -> None:
        for number in range(source.getNumChildren()):
            child = source.getChild(number)
            if child.getFullName() in self._kept:
                own = Abc.OObject(target, child.getName(), child.getMetaData())
                self._properties(child.getProperties(), own.getProperties(), self._motions.get(child.getFullName()))
                self.below(child, own)

    def _properties(self, source: Any, target: Any, motion: Motion | None, within: str = "") -> None:
        """Copies properties, those directly within `.geom` with the points of a motion."""
        for number in range(source.getNumProperties()):
            header = source.getPropertyHeader(number)
            name, meta = header.getName(), header.getMetaData()
            if header.isCompound():
                own = Abc.OCompoundProperty(target, name, meta)
                self._properties(Abc.ICompoundProperty(source, name), own, motion, name)
                continue
            if name == ".childBnds" or (within == ".geom" and name == ".velocities"):
                # They belong to the motion that the points had.
                continue
            kinds = Abc.IArrayProperty, Abc.OArrayProperty
            if header.isScalar():
                kinds = Abc.IScalarProperty, Abc.OScalarProperty
            taken = kinds[0](source, name)
            if motion is not None and within == ".geom" and name in ("P", ".selfBnds"):
                sampling, values = motion.sampling(), motion.points() if name == "P" else motion.bounds()
            else:
                sampling, values = taken.getTimeSampling(), (taken.getValue(sample) for sample in _samples(taken))
            # The sampling by its number: the package crashes on a sampling itself.
            own = kinds[1](target, name, header.getDataType(), meta, self._archive.addTimeSampling(sampling))
            for value in values:
                try:
                    own.setValue(value)
                except RuntimeError as error:
                    raise OSError(errno.EIO, cause(error)) from error


def _samples(taken: Any) -> Iterator[Any]:
    return (Abc.ISampleSelector(number) for number in range(taken.getNumSamples()))


def _cut(source: Any, target: Any) -> Iterator[str]:
    """Warnings of copied numbers that need more than 32 bits, which are all that the package hands out of 64."""
    for number in range(target.getNumChildren()):
        child = target.getChild(number)
        same = source.getChild(child.getName())
        for name in _differing(same.getProperties(), child.getProperties()):
            yield f"{child.getFullName()}: {name} has numbers that need more than 32 bits, of which these are kept"
        yield from _cut(same, child)


def _differing(source: Any, target: Any) -> Iterator[str]:
    for number in range(target.getNumProperties()):
        header = target.getPropertyHeader(number)
        name = header.getName()
        if header.isCompound():
            yield from _differing(Abc.ICompoundProperty(source, name), Abc.ICompoundProperty(target, name))
        elif not header.isScalar() and str(header.getDataType().getPod()) in ("kInt64POD", "kUint64POD"):
            both = [Abc.IArrayProperty(of, name) for of in (source, target)]
            keys = [[of.getKey(sample) for sample in _samples(of)] for of in both]
            if keys[0] != keys[1]:
                yield name
