"""Archives of Alembic with a skin and what is on it, written by the package that reads them."""

from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

import imath
import numpy as np
from alembic3d import Abc, AbcCoreAbstract, AbcGeom
from numpy.typing import ArrayLike

VERTEX = AbcGeom.GeometryScope.kVertexScope
FPS = 25.0


def v3f(points: ArrayLike) -> Any:
    return imath.V3fArrayFromBuffer(np.ascontiguousarray(points, np.float32))


def array(kind: Any, values: Sequence[Any]) -> Any:
    made = kind(len(values))
    for index, value in enumerate(values):
        made[index] = value
    return made


def ints(values: Any) -> Any:
    return array(imath.IntArray, np.asarray(values).reshape(-1).tolist())


def sampled(archive: Any, start: float = 1.0, fps: float = FPS) -> int:
    """The number of a sampling at frames from `start` on."""
    return archive.addTimeSampling(AbcCoreAbstract.TimeSampling(1 / fps, start / fps))


def placed(parent: Any, name: str, matrices: Sequence[np.ndarray], sampling: int = 0) -> Any:
    """A transform; the matrices place rows of points."""
    made = AbcGeom.OXform(parent, name, sampling)
    for matrix in matrices:
        sample = AbcGeom.XformSample()
        sample.setMatrix(imath.M44d(*map(float, np.asarray(matrix).reshape(-1))))
        made.getSchema().set(sample)
    return made


def mesh(
    parent: Any,
    name: str,
    poses: Sequence[ArrayLike],
    faces: ArrayLike,
    sampling: int = 0,
    uvs: ArrayLike | None = None,
    subd: bool = False,
    indices: Sequence[int] | None = None,
    scope: Any = VERTEX,
    then: ArrayLike | None = None,
) -> Any:
    """A mesh of quadrilaterals, with UVs per vertex if there are some. `then`: the faces after the first sample."""
    kind = "OSubD" if subd else "OPolyMesh"
    made, of = getattr(AbcGeom, kind)(parent, name, sampling), getattr(AbcGeom, f"{kind}SchemaSample")
    for number, points in enumerate(poses):
        corners = ints(faces if number == 0 or then is None else then)
        sample = of(v3f(points), corners, ints([4] * (len(corners) // 4)))
        if uvs is not None and number == 0:
            values = array(imath.V2fArray, [imath.V2f(*map(float, uv)) for uv in uvs])
            chosen = (array(imath.UnsignedIntArray, indices),) if indices else ()
            sample.setUVs(AbcGeom.OV2fGeomParamSample(values, *chosen, scope))
        made.getSchema().set(sample)
    return made


def points(parent: Any, name: str, poses: Sequence[np.ndarray], sampling: int = 0, ids: Any = None) -> Any:
    """Points with ids, widths and velocities."""
    made = AbcGeom.OPoints(parent, name, sampling)
    for of in poses:
        count = len(of)
        numbers = array(imath.IntArray, list(range(5, 5 + count)) if ids is None else ids)
        widths = AbcGeom.OFloatGeomParamSample(array(imath.FloatArray, [0.1 * k for k in range(count)]), VERTEX)
        made.getSchema().set(AbcGeom.OPointsSchemaSample(v3f(of), numbers, v3f(np.full((count, 3), 9)), widths))
    return made


def curves(parent: Any, name: str, of: np.ndarray, counts: Sequence[int]) -> Any:
    """Linear curves with widths."""
    made = AbcGeom.OCurves(parent, name)
    widths = AbcGeom.OFloatGeomParamSample(array(imath.FloatArray, [0.2] * len(of)), VERTEX)
    kinds = AbcGeom.CurveType.kLinear, AbcGeom.CurvePeriodicity.kNonPeriodic
    made.getSchema().set(AbcGeom.OCurvesSchemaSample(v3f(of), ints(counts), *kinds, widths))
    return made


def write(path: Path, author: Callable[[Any, Any], None]) -> Path:
    """An archive with what `author` puts below /model."""
    path.parent.mkdir(parents=True, exist_ok=True)
    archive = Abc.CreateArchiveWithInfo(str(path), FPS, "test", "")
    author(archive, AbcGeom.OXform(archive.getTop(), "model"))
    return path


def found(path: Path, name: str) -> Any:
    """The object of a path, as its schema."""
    parent = Abc.IArchive(str(path)).getTop()
    *above, last = name.strip("/").split("/")
    for part in above:
        parent = parent.getChild(part)
    header = parent.getChild(last).getHeader()
    kinds = (AbcGeom.IPoints, AbcGeom.ICurves, AbcGeom.IPolyMesh, AbcGeom.ISubD, AbcGeom.IXform, AbcGeom.IFaceSet)
    return next(kind for kind in kinds if kind.matches(header))(parent, last)


def posed(path: Path, name: str, frame: float) -> np.ndarray:
    """(points, 3) f64 of an object at a frame."""
    near = Abc.ISampleSelector(frame / FPS, Abc.ISampleSelector.TimeIndexType.kNearIndex)
    return np.array(found(path, name).getSchema().getPositionsProperty().getValue(near), np.float64)


def properties(path: Path, name: str) -> dict[str, tuple[list[str], str]]:
    """Of each property of an object, the keys or values of its samples, and what is told of it."""

    def of(within: Any, above: str) -> dict[str, tuple[list[str], str]]:
        all_ = {}
        for number in range(within.getNumProperties()):
            header = within.getPropertyHeader(number)
            own = f"{above}/{header.getName()}"
            if header.isCompound():
                all_ |= of(Abc.ICompoundProperty(within, header.getName()), own)
                continue
            read = (Abc.IScalarProperty if header.isScalar() else Abc.IArrayProperty)(within, header.getName())
            samples = [Abc.ISampleSelector(k) for k in range(read.getNumSamples())]
            keys = [str(read.getValue(k)) if header.isScalar() else read.getKey(k) for k in samples]
            all_[own] = keys, header.getMetaData().serialize()
        return all_

    return of(found(path, name).getProperties(), "")
