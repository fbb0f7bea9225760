"""Copies of objects of an Alembic archive, of which some have other points over time."""

from __future__ import annotations

import errno
import os
from collections.abc import Collection, Iterator, Mapping
from typing import Any

import imath
import numpy as np
from alembic3d import Abc, AbcCoreAbstract

from vrtm.bake import staging
from vrtm.bake.scene.alembic_file import AlembicFile
from vrtm.bake.scene.types import SceneError
from vrtm.bake.words import cause

_EVEN = 1e-9
"""Seconds by which steps in time may differ."""
_BESIDE = 1 << 20
"""Bytes of an archive besides points that move, as a rule."""


class Motion:
    """The points of an object over time."""

    def __init__(self, rate: float) -> None:
        """`rate`: samples per second of a single one."""
        self._rate = rate
        self._samples: dict[float, np.ndarray] = {}

    def add(self, seconds: float, points: np.ndarray) -> None:
        """Adds (points, 3) at a time."""
        self._samples[seconds] = np.ascontiguousarray(points, np.float32)

    @property
    def bytes(self) -> int:
        return sum(points.nbytes for points in self._samples.values())

    def points(self) -> Iterator[Any]:
        """The samples, in the order of their times."""
        return (imath.V3fArrayFromBuffer(self._samples[seconds]) for seconds in sorted(self._samples))

    def bounds(self) -> Iterator[Any]:
        """The boxes around them."""
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
        """Copies the objects below one."""
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
