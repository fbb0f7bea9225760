"""Geometry on the skin in USD files: prims at rest, and the layer that moves them."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
from pxr import Sdf, Usd, UsdGeom, Vt

from vrtm.bake.carry_prims import CarriedPrim, Scatter, made, matrices, wrong
from vrtm.bake.layer.clips import export
from vrtm.bake.layer.write import tell
from vrtm.bake.mark import CARRIED, found_in, is_marked, mark
from vrtm.bake.scene import Scene, SceneOptions
from vrtm.bake.scene.usd_stage import open_stage, stage_files

_KINDS = {"instances": UsdGeom.PointInstancer, "points": UsdGeom.Points, "curves": UsdGeom.BasisCurves}
_KINDS["mesh"] = UsdGeom.Mesh
_VELOCITIES = ("velocities", "angularVelocities", "accelerations")
"""They are those of the shot's own motion, if any."""
_INPUTS, _TOLD = "vrtm_inputs", "vrtm_told"


class UsdScatter(Scatter):
    """Prims of a USD file. Raises SceneError."""

    def __init__(self, file: str, scene: Scene) -> None:
        self._scene = scene
        self.stage = open_stage(file, scene.options if file == scene.path else SceneOptions())
        super().__init__(file, stage_files(self.stage), "prim", (schema.__name__ for schema in _KINDS.values()))
        shot = scene.source.stage if scene.is_usd else self.stage
        self._unit = _unit(self.stage, shot)
        # Time codes of a shot are the scatter's; other files count seconds.
        self._codes = 1.0 if scene.is_usd else self.stage.GetTimeCodesPerSecond()
        # A root layer says how long the stage is, and which prim it is by default.
        self._layer = Sdf.Layer.CreateAnonymous(".usda")
        tell(shot.GetRootLayer(), self._layer, default=False)
        self._times: dict[str, list[float]] = {}
        self._before: dict[str, np.ndarray] = {}

    def time(self, frame: float) -> float:
        return self._scene.clock.time(frame) * self._codes

    def _there(self, path: str) -> list[str] | None:
        if Sdf.Path.IsValidPathString(path) and self.stage.GetPrimAtPath(path):
            return None
        return [str(prim.GetPath()) for prim in Usd.PrimRange.Stage(self.stage)]

    def _below(self, path: str) -> list[str]:
        found = list(_carriable(self.stage.GetPrimAtPath(path)))
        instancers = [UsdGeom.PointInstancer(prim) for prim in found if prim.IsA(UsdGeom.PointInstancer)]
        # Prototypes of instances are carried with these.
        prototypes = [target for of in instancers for target in of.GetPrototypesRel().GetForwardedTargets()]
        paths = [prim.GetPath() for prim in found]
        return [str(own) for own in paths if not any(own.HasPrefix(target) for target in prototypes)]

    def _read(self, path: str, time: float, in_parts: bool) -> CarriedPrim | str:
        return _read(self.stage.GetPrimAtPath(path), Usd.TimeCode(time), in_parts)

    def to_world(self, prim: CarriedPrim, frame: float) -> np.ndarray:
        imageable = UsdGeom.Imageable(self._prim(prim))
        matrix = np.array(imageable.ComputeLocalToWorldTransform(Usd.TimeCode(self.time(frame))))
        return matrix @ np.diag([self._unit, self._unit, self._unit, 1.0])

    def add(self, carried: CarriedPrim, time: float, points: np.ndarray, turns: np.ndarray | None) -> None:
        prim, own = self._prim(carried), Sdf.CreatePrimInLayer(self._layer, carried.path)
        self._times.setdefault(carried.path, []).append(time)
        values = Vt.Vec3fArray.FromNumpy(np.ascontiguousarray(points, np.float32))
        self._set(own, _places(prim).GetName(), Sdf.ValueTypeNames.Point3fArray, time, values)
        if turns is not None:
            # A quaternion and its negative are one rotation: hosts interpolate between neighbours of one sign.
            before = self._before.get(carried.path, np.array([0, 0, 0, 1.0]))
            turns = np.where((turns * before).sum(1, keepdims=True) < 0, -turns, turns)
            self._before[carried.path] = turns
            if _orientations(prim).GetName() == "orientationsf":
                quats = Vt.QuatfArray.FromNumpy(np.ascontiguousarray(turns, np.float32))
                self._set(own, "orientationsf", Sdf.ValueTypeNames.QuatfArray, time, quats)
            else:
                quats = Vt.QuathArray.FromNumpy(np.ascontiguousarray(turns, np.float16))
                self._set(own, "orientations", Sdf.ValueTypeNames.QuathArray, time, quats)
        for name in _VELOCITIES:
            attribute = prim.GetAttribute(name)
            if attribute and attribute.HasAuthoredValue() and name not in own.attributes:
                Sdf.AttributeSpec(own, name, attribute.GetTypeName()).default = Sdf.ValueBlock()

    def write(self, path: str, inputs: str, told: str) -> list[str]:
        self._add_extents()
        mark(self._layer, CARRIED)
        self._layer.customLayerData |= {_INPUTS: inputs, _TOLD: told}
        export(self._layer, path, Sdf.Layer.ExportToString)
        return []

    def known(self, path: str, inputs: str) -> str | None:
        def look(layer: Sdf.Layer) -> str | None:
            told = layer.customLayerData
            return told[_TOLD] if told.get(_INPUTS) == inputs and is_marked(layer) else None

        return found_in(path, look, None)

    def _prim(self, carried: CarriedPrim) -> Usd.Prim:
        return self.stage.GetPrimAtPath(carried.path)

    def _add_extents(self) -> None:
        """Adds the extents of all poses, once these are there."""
        root = Sdf.Layer.CreateAnonymous(".usda")
        root.subLayerPaths = [self._layer.identifier, self.stage.GetRootLayer().identifier]
        for name in ("timeCodesPerSecond", "framesPerSecond"):
            if self._layer.pseudoRoot.HasInfo(name):
                root.pseudoRoot.SetInfo(name, self._layer.pseudoRoot.GetInfo(name))
        stage = Usd.Stage.Open(root, self.stage.GetSessionLayer())
        for muted in self.stage.GetMutedLayers():
            stage.MuteLayer(muted)
        for path, times in self._times.items():
            boundable, own = UsdGeom.Boundable(stage.GetPrimAtPath(path)), self._layer.GetPrimAtPath(path)
            for time in times:
                extent = UsdGeom.Boundable.ComputeExtentFromPlugins(boundable, Usd.TimeCode(time))
                if extent is not None:
                    self._set(own, "extent", Sdf.ValueTypeNames.Float3Array, time, extent)

    def _set(self, prim: Sdf.PrimSpec, name: str, kind: Sdf.ValueTypeName, time: float, value: object) -> None:
        if name not in prim.attributes:
            Sdf.AttributeSpec(prim, name, kind)
        self._layer.SetTimeSample(prim.path.AppendProperty(name), time, value)


def _unit(stage: Usd.Stage, shot: Usd.Stage) -> float:
    """Units of the shot in one of the file, as far as both say it."""
    if stage is shot or not all(map(UsdGeom.StageHasAuthoredMetersPerUnit, (stage, shot))):
        return 1.0
    return UsdGeom.GetStageMetersPerUnit(stage) / UsdGeom.GetStageMetersPerUnit(shot)


def _carriable(prim: Usd.Prim) -> Iterator[Usd.Prim]:
    """A prim and those below it of a kind that can be carried, none of them below another."""
    prims = iter(Usd.PrimRange(prim))
    for prim in prims:
        if any(prim.IsA(kind) for kind in _KINDS.values()):
            yield prim
            prims.PruneChildren()


def _read(prim: Usd.Prim, time: Usd.TimeCode, in_parts: bool) -> CarriedPrim | str:
    """A prim at rest, or why it cannot be carried, as the end of a sentence."""

    def integers(attribute: Usd.Attribute) -> np.ndarray:
        return np.array(attribute.Get(time) or (), np.int64)

    kind = next(name for name, schema in _KINDS.items() if prim.IsA(schema))
    points = np.array(_places(prim).Get(time) or (), np.float64).reshape(-1, 3)
    counts = integers(UsdGeom.BasisCurves(prim).GetCurveVertexCountsAttr()) if kind == "curves" else None
    why = wrong(points, counts)
    if why is not None:
        return why
    turns = faces = None
    if kind == "instances":
        values = _orientations(prim).Get(time)
        turns = np.tile(np.eye(3), (len(points), 1, 1))
        if values:
            if len(values) != len(points):
                return f"has {len(points)} positions and {len(values)} orientations"
            turns = matrices(np.array(values, np.float64))
    if kind == "mesh" and in_parts:
        mesh = UsdGeom.Mesh(prim)
        faces = integers(mesh.GetFaceVertexCountsAttr()), integers(mesh.GetFaceVertexIndicesAttr())
    return made(str(prim.GetPath()), kind, points, counts, turns, faces)


def _places(prim: Usd.Prim) -> Usd.Attribute:
    is_instancer = prim.IsA(UsdGeom.PointInstancer)
    return UsdGeom.PointInstancer(prim).GetPositionsAttr() if is_instancer else UsdGeom.PointBased(prim).GetPointsAttr()


def _orientations(prim: Usd.Prim) -> Usd.Attribute:
    """In single precision, which then counts, where the prim has these."""
    single = prim.GetAttribute("orientationsf")
    return single if single and single.Get(Usd.TimeCode.EarliestTime()) else prim.GetAttribute("orientations")
