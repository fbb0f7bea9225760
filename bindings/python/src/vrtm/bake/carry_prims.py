"""Prims of geometry on the skin: where their points are at rest, and the layer that moves them."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np
from pxr import Sdf, Usd, UsdGeom, Vt

KINDS = {"instances": UsdGeom.PointInstancer, "points": UsdGeom.Points, "curves": UsdGeom.BasisCurves}
KINDS["mesh"] = UsdGeom.Mesh
_VELOCITIES = ("velocities", "angularVelocities", "accelerations")
"""They are those of the shot's own motion, if any."""


@dataclass(frozen=True, eq=False)
class CarriedPrim:
    """A prim with its values at rest, in its own space."""

    prim: Usd.Prim
    kind: str
    points: np.ndarray
    """(points, 3) f64: places of instances, or points."""
    roots: np.ndarray
    """(roots,): the points by whose places it is bound: the first ones of curves, else all."""
    of: np.ndarray
    """(points,): the index of each point's root in `roots`."""
    turns: np.ndarray | None
    """(points, 3, 3): the rotations of instances."""

    @property
    def path(self) -> str:
        return str(self.prim.GetPath())

    def to_world(self, time: Usd.TimeCode, unit: float) -> np.ndarray:
        """(4, 4) by which rows of points are multiplied to lie in the world; `unit`: of the file, in the scene's."""
        matrix = np.array(UsdGeom.Imageable(self.prim).ComputeLocalToWorldTransform(time))
        return matrix @ np.diag([unit, unit, unit, 1.0])

    def moved(
        self, roots: np.ndarray, turns: np.ndarray, bound: np.ndarray, to_mesh: np.ndarray, from_mesh: np.ndarray
    ) -> tuple[np.ndarray, np.ndarray | None]:
        """Points, and quaternions x, y, z, w of instances, in a pose. `roots`: (roots, 3), places in the pose, in the
        mesh's space; `turns`: (roots, 3, 3); `bound`: (roots,), those that are not too far. `to_mesh`: (4, 4) from the
        prim's space to the mesh's at rest, `from_mesh`: back in the pose."""
        rest = self.points @ to_mesh[:3, :3] + to_mesh[3, :3]
        offsets = rest - rest[self.roots][self.of]
        posed = roots[self.of] + np.einsum("nij,nj->ni", turns[self.of], offsets)
        stays = ~bound[self.of]
        points = posed @ from_mesh[:3, :3] + from_mesh[3, :3]
        points[stays] = self.points[stays]
        if self.turns is None:
            return points, None
        turned = from_mesh[:3, :3].T @ turns @ to_mesh[:3, :3].T @ self.turns
        turned[stays] = self.turns[stays]
        return points, quaternions(turned)


def listed(stage: Usd.Stage, path: str, baked: Sequence[str]) -> list[Usd.Prim]:
    """A prim and those below it that can be carried: no prototypes of instances, and none of the meshes `baked`."""
    found = list(_below(stage.GetPrimAtPath(path)))
    instancers = [UsdGeom.PointInstancer(prim) for prim in found if prim.IsA(UsdGeom.PointInstancer)]
    prototypes = [target for of in instancers for target in of.GetPrototypesRel().GetForwardedTargets()]
    return [
        prim
        for prim in found
        if str(prim.GetPath()) not in baked and not any(prim.GetPath().HasPrefix(target) for target in prototypes)
    ]


def _below(prim: Usd.Prim) -> Iterator[Usd.Prim]:
    prims = iter(Usd.PrimRange(prim))
    for prim in prims:
        if any(prim.IsA(kind) for kind in KINDS.values()):
            yield prim
            prims.PruneChildren()


def read(prim: Usd.Prim, time: Usd.TimeCode) -> CarriedPrim | str:
    """A prim at rest, or why it cannot be carried, as the end of a sentence."""
    kind = next(name for name, schema in KINDS.items() if prim.IsA(schema))
    points = np.array(_places(prim).Get(time) or (), np.float64).reshape(-1, 3)
    if not len(points):
        return "has no points at rest"
    if not np.isfinite(points).all():
        return f"has a point that is not finite: {int(np.argmin(np.isfinite(points).all(1)))}"
    roots = of = np.arange(len(points))
    turns = None
    if kind == "curves":
        counts = np.array(UsdGeom.BasisCurves(prim).GetCurveVertexCountsAttr().Get(time) or (), np.int64)
        if (counts < 1).any() or counts.sum() != len(points):
            return f"has {len(points)} points, and curves with {int(counts.sum())}"
        roots, of = np.cumsum(counts) - counts, np.repeat(np.arange(len(counts)), counts)
    if kind == "instances":
        values = _orientations(prim).Get(time)
        turns = np.tile(np.eye(3), (len(points), 1, 1))
        if values:
            if len(values) != len(points):
                return f"has {len(points)} positions and {len(values)} orientations"
            turns = matrices(np.array(values, np.float64))
    return CarriedPrim(prim, kind, points, roots, of, turns)


def _places(prim: Usd.Prim) -> Usd.Attribute:
    is_instancer = prim.IsA(UsdGeom.PointInstancer)
    return UsdGeom.PointInstancer(prim).GetPositionsAttr() if is_instancer else UsdGeom.PointBased(prim).GetPointsAttr()


def _orientations(prim: Usd.Prim) -> Usd.Attribute:
    """In single precision, which then counts, where the prim has these."""
    single = prim.GetAttribute("orientationsf")
    return single if single and single.Get(Usd.TimeCode.EarliestTime()) else prim.GetAttribute("orientations")


def matrices(quaternions: np.ndarray) -> np.ndarray:
    """(n, 3, 3), whose columns are the axes, of quaternions x, y, z, w of any length; the identity of length 0."""
    length = np.linalg.norm(quaternions, axis=1, keepdims=True)
    q = np.where(length > 0, quaternions / np.where(length > 0, length, 1), [0.0, 0.0, 0.0, 1.0])
    v, w = q[:, :3], q[:, 3, None, None]
    cross = np.cross(np.eye(3)[None], v[:, None, :])
    return np.eye(3) * (2 * w**2 - 1) + 2 * v[:, :, None] * v[:, None, :] + 2 * w * cross


def quaternions(turned: np.ndarray) -> np.ndarray:
    """(n, 4), x, y, z, w, of the rotations that are nearest to matrices: largest eigenvectors (Horn)."""
    m = turned
    k = np.empty((len(m), 4, 4))
    k[:, :3, :3] = m + m.transpose(0, 2, 1) - np.trace(m, axis1=1, axis2=2)[:, None, None] * np.eye(3)
    k[:, :3, 3] = k[:, 3, :3] = np.stack(
        [m[:, 2, 1] - m[:, 1, 2], m[:, 0, 2] - m[:, 2, 0], m[:, 1, 0] - m[:, 0, 1]], axis=1
    )
    k[:, 3, 3] = np.trace(m, axis1=1, axis2=2)
    return np.linalg.eigh(k)[1][..., -1]


class Motion:
    """The layer with the prims over time, as it grows."""

    def __init__(self, shot: Sdf.Layer, fields: Sequence[str]) -> None:
        """`fields`: what the shot says of the stage that the layer has to say, too."""
        self.layer = Sdf.Layer.CreateAnonymous(".usda")
        for name in fields:
            if shot.pseudoRoot.HasInfo(name):
                self.layer.pseudoRoot.SetInfo(name, shot.pseudoRoot.GetInfo(name))
        self._before: dict[str, np.ndarray] = {}

    def add(self, carried: CarriedPrim, time: float, points: np.ndarray, turns: np.ndarray | None) -> None:
        """Adds a pose of a prim."""
        own = Sdf.CreatePrimInLayer(self.layer, carried.path)
        name = _places(carried.prim).GetName()
        values = Vt.Vec3fArray.FromNumpy(np.ascontiguousarray(points, np.float32))
        self._set(own, name, Sdf.ValueTypeNames.Point3fArray, time, values)
        if turns is not None:
            # Of both signs, the one from which a host can interpolate.
            before = self._before.get(carried.path, np.array([0, 0, 0, 1.0]))
            turns = np.where((turns * before).sum(1, keepdims=True) < 0, -turns, turns)
            self._before[carried.path] = turns
            if _orientations(carried.prim).GetName() == "orientationsf":
                quats = Vt.QuatfArray.FromNumpy(np.ascontiguousarray(turns, np.float32))
                self._set(own, "orientationsf", Sdf.ValueTypeNames.QuatfArray, time, quats)
            else:
                quats = Vt.QuathArray.FromNumpy(np.ascontiguousarray(turns, np.float16))
                self._set(own, "orientations", Sdf.ValueTypeNames.QuathArray, time, quats)
        for name in _VELOCITIES:
            attribute = carried.prim.GetAttribute(name)
            if attribute and attribute.HasAuthoredValue() and name not in own.attributes:
                Sdf.AttributeSpec(own, name, attribute.GetTypeName()).default = Sdf.ValueBlock()

    def add_extents(self, carried: Sequence[CarriedPrim], times: Sequence[float]) -> None:
        """Adds the extents of all poses, once these are there."""
        root = Sdf.Layer.CreateAnonymous(".usda")
        below = carried[0].prim.GetStage()
        root.subLayerPaths = [self.layer.identifier, below.GetRootLayer().identifier]
        for name in ("timeCodesPerSecond", "framesPerSecond"):
            if self.layer.pseudoRoot.HasInfo(name):
                root.pseudoRoot.SetInfo(name, self.layer.pseudoRoot.GetInfo(name))
        stage = Usd.Stage.Open(root, below.GetSessionLayer())
        for muted in below.GetMutedLayers():
            stage.MuteLayer(muted)
        for of in carried:
            boundable = UsdGeom.Boundable(stage.GetPrimAtPath(of.prim.GetPath()))
            own = self.layer.GetPrimAtPath(of.prim.GetPath())
            for time in times:
                extent = UsdGeom.Boundable.ComputeExtentFromPlugins(boundable, Usd.TimeCode(time))
                if extent is not None:
                    self._set(own, "extent", Sdf.ValueTypeNames.Float3Array, time, extent)

    def _set(self, prim: Sdf.PrimSpec, name: str, kind: Sdf.ValueTypeName, time: float, value: object) -> None:
        if name not in prim.attributes:
            Sdf.AttributeSpec(prim, name, kind)
        self.layer.SetTimeSample(prim.path.AppendProperty(name), time, value)
