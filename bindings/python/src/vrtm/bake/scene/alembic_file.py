"""Archives of Alembic, through the wheel alembic3d: polygon meshes and subdivision surfaces, with their samples."""

import contextlib
import math
import os
import sys
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from vrtm.bake.scene.timing import USUAL, cycle, is_whole, rate, tidy
from vrtm.bake.scene.topology import check_faces
from vrtm.bake.scene.types import SceneError, SceneOptions, not_loaded

try:
    from alembic3d import Abc, AbcGeom
except Exception as error:
    # It raises whatever it is not prepared for, such as a TypeError where another module has the name of its imath.
    failed = not_loaded(error, "Alembic files", "alembic3d", "alembic", "alembic3d")
    imath = getattr(sys.modules.get("imath"), "__file__", None)
    raise SceneError(f"{failed}{f' (its imath is {imath})' if imath else ''}") from error

SCOPES = {
    "kFacevaryingScope": "faceVarying",
    "kVertexScope": "vertex",
    "kVaryingScope": "varying",
    "kUniformScope": "uniform",
    "kConstantScope": "constant",
}
UV_KINDS, UV_TRIPLES = ("V2f", "V2d", "P2f", "P2d"), ("V3f", "V3d", "P3f", "P3d")
"""Types of parameters that UV sets may have."""
# Seconds within which a sample counts as the one of a frame.
CLOSE = 1e-5
HIDDEN = 0
HDF5 = b"\x89HDF\r\n\x1a\n"


class AlembicFile:
    def __init__(self, path: str) -> None:
        if not os.path.isfile(path):
            raise SceneError(f"{path}: no such file")
        try:
            self._archive = Abc.IArchive(path)
        except RuntimeError as error:
            with open(path, "rb") as file:
                if file.read(len(HDF5)) == HDF5:
                    told = "an Alembic file in HDF5, the format before Ogawa, which this reader does not have: "
                    told += "convert it with 'abcconvert -toOgawa IN.abc OUT.abc', or write it as Ogawa"
                    raise SceneError(f"{path}: {told}") from error
            raise SceneError(f"{path}: not an Alembic file ({error})") from error
        self.path = path

    @property
    def rate(self) -> float | None:
        """Frames per second, as the program that wrote it says; None if it does not."""
        told = self.top.getMetaData()
        for name in ("_ai_DCC_FPS", "FramesPerTimeUnit"):
            with contextlib.suppress(ValueError):
                found = float(told.get(name))
                if 0 < found < math.inf:
                    return found
        return None

    @property
    def top(self) -> Any:
        """The object above all."""
        return self._archive.getTop()

    @property
    def description(self) -> str:
        """The text that the archive was written with; empty if there is none."""
        return self.top.getMetaData().get("_ai_Description")

    def objects(self) -> "Iterator[AlembicObject]":
        """All objects, in the order of the file, each before those below it."""
        return _below(self.top)

    def meshes(self) -> "Iterator[AlembicMesh]":
        """All meshes, in the order of the file."""
        self.unread: list[str] = []
        for found in self.objects():
            for kind in ("PolyMesh", "SubD"):
                if found.matches(kind):
                    yield AlembicMesh(self.path, found, kind)
            if found.matches("NuPatch") and not found.hidden:
                self.unread.append(found.path)

    def meshes_at_first_frame(self) -> list[tuple[str, np.ndarray, np.ndarray, np.ndarray]]:
        """(path, positions, face counts, indices) of all meshes at their first sample."""
        return [(mesh.path, mesh.sample(0), *mesh.faces(0)) for mesh in self.meshes() if not mesh.hidden]


@dataclass(frozen=True)
class AlembicObject:
    """An object of an archive, and its place there."""

    object: Any
    parent: Any
    above: tuple[Any, ...]
    """The transforms above it."""
    hidden: bool
    """True if it, or an object above it, is hidden in the first sample."""
    origin: str
    """The path of the object that an instance stands for; its own path, if it is none."""

    @property
    def path(self) -> str:
        return self.object.getFullName()

    def matches(self, kind: str) -> bool:
        """True if it is of a kind, such as `PolyMesh`."""
        return getattr(AbcGeom, f"I{kind}").matches(self.object.getHeader())

    def schema(self, kind: str) -> Any:
        return getattr(AbcGeom, f"I{kind}")(self.parent, self.object.getName()).getSchema()


class AlembicMesh:
    """One mesh of an archive, or another object with points."""

    def __init__(self, file: str, found: AlembicObject, kind: str) -> None:
        self.origin, self.hidden, self.path, self._above = found.origin, found.hidden, found.path, found.above
        self.where = f"{file} {self.path}"
        self.schema = found.schema(kind)
        self._positions = self.schema.getPositionsProperty()
        self.samples = self._positions.getNumSamples()
        self._sampling = self._positions.getTimeSampling()
        self._times: dict[bool, list[float]] = {}

    def times(self, world: bool) -> list[float]:
        """Seconds of its samples, ascending, with `world` also of those of the transforms above it; none if there is
        one alone."""
        if world not in self._times:
            found = {
                sampling.getSampleTime(index) for sampling, count in self._sampled(world) for index in range(count)
            }
            self._times[world] = sorted(found)
        return self._times[world]

    def _sampled(self, world: bool) -> list[tuple[Any, int]]:
        """Time samplings, and how many samples each has."""
        above = [t for t in self._above if world and not t.isConstant()]
        found = [(self._sampling, self.samples), *((t.getTimeSampling(), t.getNumSamples()) for t in above)]
        return [(sampling, count) for sampling, count in found if count > 1]

    def rate(self, world: bool) -> tuple[float | None, bool]:
        """Frames per second by its samples, and whether others fit as well."""
        kind, seconds = self._sampled(world)[0][0].getTimeSamplingType(), self.times(world)
        if kind.isCyclic():
            return tidy(1 / kind.getTimePerCycle()), False
        found, period = rate(seconds), cycle(seconds)
        if found is None or period is None or period[1] > 1:
            return found, False
        # Evenly spaced times that are listed one by one are those of a shutter.
        half = kind.isAcyclic() and found / 2 in USUAL
        found = found / 2 if half else found
        return found, not (20 < found and is_whole(found * period[0]))

    def sample(self, index: int) -> np.ndarray:
        """(vertices, 3) f32 of a sample."""
        return np.array(self._positions.getValue(self._selector(index))).reshape(-1, 3)

    def count(self, index: int) -> int:
        return self._positions.getDimension(self._selector(index)).numPoints()

    def _selector(self, index: int) -> Any:
        """Selects by time: a whole number, too, would be taken for one."""
        return _at(self._sampling.getSampleTime(index))

    def faces(self, index: int) -> tuple[np.ndarray, np.ndarray]:
        properties = self.schema.getFaceCountsProperty(), self.schema.getFaceIndicesProperty()
        counts, indices = (np.array(found.getValue(self._selector(index)), np.int32) for found in properties)
        return counts, indices

    def at(self, seconds: float, expected: tuple[np.ndarray, np.ndarray] | None) -> np.ndarray:
        """(vertices, 3) f32 at a time. Raises SceneError where faces are not the expected ones."""
        before = self._sampling.getFloorIndex(seconds, self.samples)
        after = self._sampling.getCeilIndex(seconds, self.samples)
        start, end = self._sampling.getSampleTime(before), self._sampling.getSampleTime(after)
        share = 0.0 if end - start < CLOSE else min(max((seconds - start) / (end - start), 0), 1)
        if share * (end - start) < CLOSE:
            after, share = before, 0.0
        elif (1 - share) * (end - start) < CLOSE:
            before, share = after, 0.0
        if expected is not None and str(self.schema.getTopologyVariance()) == "kHeterogenousTopology":
            for index in {before, after}:
                time = self._sampling.getSampleTime(index)
                where = f"{self.where}: sample {index} ({time:.4f} s): the topology changes"
                check_faces(where, *self.faces(index), *expected)
        first = self.sample(before)
        if share == 0:
            return first
        return first + np.float32(share) * (self.sample(after) - first)

    @property
    def is_moved(self) -> bool:
        """True if transforms above it change over time."""
        return any(not transform.isConstant() for transform in self._above)

    def is_still(self, options: SceneOptions) -> bool:
        """True if the scene has one pose of it alone."""
        return self.samples <= 1 and not (options.world and self.is_moved)

    def to_world(self, seconds: float) -> np.ndarray:
        """(4, 4): the transforms above it, by which rows of points are multiplied."""
        return to_world(self._above, seconds)

    def param(self, name: str, kinds: tuple[str, ...]) -> tuple[np.ndarray, np.ndarray, str] | None:
        """(values, elements, interpolation) of a geometry parameter at the first sample: value of entry k is
        values[elements[k]]. None if no parameter of that name has one of these types."""
        group = self.schema.getArbGeomParams()
        header = group.getPropertyHeader(name) if group.valid() else None
        for kind in kinds if header else ():
            made = getattr(AbcGeom, f"I{kind}GeomParam")
            if made.matches(header):
                return _param(made(group, name))
        return None

    def params(self) -> list[str]:
        group = self.schema.getArbGeomParams()
        return [group.getPropertyHeader(k).getName() for k in range(group.getNumProperties())] if group.valid() else []

    def interpretation(self, name: str) -> str:
        """The meaning of a geometry parameter, such as `point` or `quat`; empty where it is not said."""
        return self.schema.getArbGeomParams().getPropertyHeader(name).getMetaData().get("interpretation")

    def uvs(self, name: str | None) -> tuple[np.ndarray, np.ndarray, str, str] | None:
        """(values, elements, interpolation, name) of a UV set, None for the mesh's own; None if it has none."""
        own = self.schema.getUVsParam()
        if own.valid() and name in (None, own.getName()):
            return (*_param(own), own.getName())
        # Houdini has UVs of three numbers, the first two of which are u and v, among the parameters.
        sets = ((other, self.param(other, UV_KINDS + UV_TRIPLES)) for other in ([name] if name else ["uv", "st"]))
        return next(((*found, other) for other, found in sets if found), None)


def _below(parent: Any, above: tuple[Any, ...] = (), hidden: bool = False, origin: str = "") -> Iterator[AlembicObject]:
    for number in range(parent.getNumChildren()):
        child = parent.getChild(number)
        own = child.instanceSourcePath() if child.isInstanceRoot() else f"{origin}/{child.getName()}"
        found = AlembicObject(child, parent, above, hidden or _hidden(child), own)
        yield found
        transforms = (*above, found.schema("Xform")) if found.matches("Xform") else above
        yield from _below(child, transforms, found.hidden, own)


def _at(seconds: float) -> Any:
    return Abc.ISampleSelector(float(seconds), Abc.ISampleSelector.TimeIndexType.kNearIndex)


def to_world(above: Sequence[Any], seconds: float) -> np.ndarray:
    """(4, 4) of transforms, the outermost first, by which rows of points are multiplied."""
    total = np.eye(4)
    for transform in above:
        own = _matrix(transform, seconds)
        # A transform may leave out those above it.
        total = own @ total if transform.getInheritsXforms(_at(seconds)) else own
    return total


def _matrix(transform: Any, seconds: float) -> np.ndarray:
    """A transform, interpolated between its samples."""
    sampling, count = transform.getTimeSampling(), transform.getNumSamples()
    if count == 0:
        return np.eye(4)
    times = [sampling.getSampleTime(found(seconds, count)) for found in (sampling.getFloorIndex, sampling.getCeilIndex)]
    parts = []
    for time in times:
        matrix = transform.getValue(_at(time)).getMatrix()
        parts.append(np.array([[matrix[row][column] for column in range(4)] for row in range(4)]))
    share = 0.0 if times[1] - times[0] < CLOSE else min(max((seconds - times[0]) / (times[1] - times[0]), 0), 1)
    return parts[0] + share * (parts[1] - parts[0])


def _hidden(item: Any) -> bool:
    """True if an object is hidden in the first sample, and so all below it."""
    properties = item.getProperties()
    if properties.getPropertyHeader("visible") is None:
        return False
    value = Abc.ICharProperty(properties, "visible").getValue()
    return (ord(value) if isinstance(value, str) else int(value)) == HIDDEN


def _param(param: Any) -> tuple[np.ndarray, np.ndarray, str]:
    sample = param.getIndexedValue()
    values = np.array(sample.getVals())
    elements = np.array(sample.getIndices(), np.int64) if param.isIndexed() else np.arange(len(values))
    scope = str(sample.getScope())
    if scope == "kUnknownScope":
        scope = str(param.getScope())
    return values, elements, SCOPES.get(scope, scope)
