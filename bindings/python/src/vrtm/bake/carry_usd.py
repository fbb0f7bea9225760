"""Geometry on the surface in USD files: prims at rest, and the layer that moves them."""

from collections.abc import Iterator, Sequence

import numpy as np
from pxr import Sdf, Usd, UsdGeom, Vt

from vrtm.bake.carry_prims import CarriedPrim, Pose, Scatter, made, matrices, wrong
from vrtm.bake.frames import Frame
from vrtm.bake.layer.clips import export
from vrtm.bake.layer.write import tell
from vrtm.bake.mark import CARRIED, found_in, is_marked, mark
from vrtm.bake.scene import Scene, SceneOptions
from vrtm.bake.scene.usd_stage import axes_of, instances_above, open_stage, stage_files

_KINDS = {"instances": UsdGeom.PointInstancer, "points": UsdGeom.Points, "curves": UsdGeom.BasisCurves}
_KINDS["mesh"] = UsdGeom.Mesh
_VELOCITIES = ("velocities", "angularVelocities", "accelerations")
"""They are those of the shot's own motion, if any."""
_INPUTS, _TOLD = "vrtm_inputs", "vrtm_told"


class UsdScatter(Scatter):
    """Prims of a USD file. Raises SceneError."""

    def __init__(self, file: str, scene: Scene, frames: Sequence[Frame]) -> None:
        self._scene, self._frames = scene, frames
        self.stage = open_stage(file, scene.options if file == scene.path else SceneOptions())
        super().__init__(file, stage_files(self.stage), "prim", (schema.__name__ for schema in _KINDS.values()))
        # Where both are one, times must not be rounded.
        self._codes = self.stage.GetTimeCodesPerSecond() / scene.source.codes
        self._layer = Sdf.Layer.CreateAnonymous(".usda")
        # Its times and places are those of the file. A root layer says which prim is the default.
        tell(self.stage.GetRootLayer(), self._layer, default=False)
        self._times: dict[str, list[float]] = {}
        self._before: dict[str, np.ndarray] = {}

    def time(self, frame: float) -> float:
        return self._scene.clock.time(frame) * self._codes

    def _there(self, path: str) -> list[str] | None:
        if Sdf.Path.IsValidPathString(path) and self.stage.GetPrimAtPath(path):
            return None
        return [str(prim.GetPath()) for prim in Usd.PrimRange.Stage(self.stage, Usd.TraverseInstanceProxies())]

    def _below(self, path: str) -> list[str]:
        found = list(_carriable(self.stage.GetPrimAtPath(path)))
        instancers = [UsdGeom.PointInstancer(prim) for prim in found if prim.IsA(UsdGeom.PointInstancer)]
        # Prototypes of instances are carried with these.
        prototypes = [target for of in instancers for target in of.GetPrototypesRel().GetForwardedTargets()]
        paths = [prim.GetPath() for prim in found]
        return [str(own) for own in paths if not any(own.HasPrefix(target) for target in prototypes)]

    def _read(self, path: str, time: float, in_parts: bool) -> CarriedPrim | str:
        prim = self.stage.GetPrimAtPath(path)
        found = _read(prim, Usd.TimeCode(time), in_parts)
        if isinstance(found, CarriedPrim):
            found = self._changes(prim, Usd.TimeCode(time)) or found
        if isinstance(found, CarriedPrim):
            why = "is no instance any more, since what is inside is carried"
            said = [f"{instance}: {why}" for instance in instances_above(self.stage, path)]
            self.warnings += [line for line in said if line not in self.warnings]
        return found

    def _changes(self, prim: Usd.Prim, rest: Usd.TimeCode) -> str | None:
        """The reason that a prim cannot be bound once, as the end of a sentence: others of its points are there in some
        frames."""
        by_count = [_places(prim), prim.GetAttribute("protoIndices")]
        by_value = map(prim.GetAttribute, ("ids", "curveVertexCounts", "faceVertexCounts", "faceVertexIndices"))
        for attribute, compared in (*((of, len) for of in by_count), *((of, list) for of in by_value)):
            if not attribute or not attribute.ValueMightBeTimeVarying():
                continue
            at_rest = compared(attribute.Get(rest) or ())
            for frame in self._frames:
                if compared(attribute.Get(Usd.TimeCode(self.time(frame))) or ()) != at_rest:
                    return f"the number or order of its {attribute.GetName()} changes, first in frame {frame}"
        return None

    def to_world(self, prim: CarriedPrim, frame: float) -> np.ndarray:
        imageable = UsdGeom.Imageable(self._prim(prim))
        return np.array(imageable.ComputeLocalToWorldTransform(Usd.TimeCode(self.time(frame)))) @ self._to_shot()

    def _to_shot(self) -> np.ndarray:
        return axes_of(self.stage).to(self._scene.source.axes)

    def add(self, carried: CarriedPrim, time: float, points: np.ndarray, turns: np.ndarray | None) -> None:
        prim, own = self._prim(carried), Sdf.CreatePrimInLayer(self._layer, carried.path)
        for instance in instances_above(self.stage, carried.path):
            Sdf.CreatePrimInLayer(self._layer, instance).instanceable = False
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

    def differences(self, path: str, prim: CarriedPrim, times: Sequence[float], poses: Sequence[Pose]) -> Iterator[str]:
        stage = self._over(Sdf.Layer.FindOrOpen(path))
        own, to_shot = stage.GetPrimAtPath(prim.path), self._to_shot()
        if not own or own.IsInstanceProxy():
            yield "it is inside an instance, where a layer changes nothing"
            return
        lacking = set(times) - set(_places(own).GetTimeSamples())
        if lacking:
            yield f"{_places(own).GetName()}: has no sample at {min(lacking):g}"
        for pose in poses:
            code = Usd.TimeCode(pose.time)
            points = np.array(_places(own).Get(code) or (), np.float64).reshape(-1, 3)
            to_world = np.array(UsdGeom.Imageable(own).ComputeLocalToWorldTransform(code)) @ to_shot
            for found in (pose.differs(points, to_world), *_invalid(own, code), _turned(own, code, pose)):
                if found is not None:
                    yield f"frame {pose.frame}: {found}"

    def _over(self, layer: Sdf.Layer) -> Usd.Stage:
        """A layer over the file."""
        root = Sdf.Layer.CreateAnonymous(".usda")
        root.subLayerPaths = [layer.identifier, self.stage.GetRootLayer().identifier]
        # As the shot has it: layers of another rate are scaled in time.
        root.timeCodesPerSecond = self.stage.GetTimeCodesPerSecond()
        stage = Usd.Stage.Open(root, self.stage.GetSessionLayer())
        for muted in self.stage.GetMutedLayers():
            stage.MuteLayer(muted)
        return stage

    def _add_extents(self) -> None:
        """Adds the extents of all poses, once these are there."""
        stage = self._over(self._layer)
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


def _carriable(prim: Usd.Prim) -> Iterator[Usd.Prim]:
    """A prim and those below it of a kind that can be carried, none of them below another."""
    prims = iter(Usd.PrimRange(prim, Usd.TraverseInstanceProxies()))
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
        for name, count in (
            ("protoIndices", len(prim.GetAttribute("protoIndices").Get(time) or ())),
            ("orientations", len(values or points)),
        ):
            if count != len(points):
                return f"has {len(points)} positions and {count} {name}"
        turns = matrices(np.array(values, np.float64)) if values else np.tile(np.eye(3), (len(points), 1, 1))
    if kind == "mesh" and in_parts:
        mesh = UsdGeom.Mesh(prim)
        faces = integers(mesh.GetFaceVertexCountsAttr()), integers(mesh.GetFaceVertexIndicesAttr())
    return made(str(prim.GetPath()), kind, points, counts, turns, faces)


def _invalid(prim: Usd.Prim, code: Usd.TimeCode) -> Iterator[str]:
    """Breaches of the rules of a prim's schema, by which renderers would not draw it."""
    count = len(_places(prim).Get(code) or ())
    if prim.IsA(UsdGeom.PointInstancer):
        of = UsdGeom.PointInstancer(prim)
        drawn = len(of.ComputeInstanceTransformsAtTime(code, code, of.ExcludeProtoXform, of.IgnoreMask))
        if drawn != count:
            yield f"has {count} positions, of which renderers draw {drawn}"
    if prim.IsA(UsdGeom.BasisCurves) and sum(UsdGeom.Curves(prim).GetCurveVertexCountsAttr().Get(code)) != count:
        yield f"curveVertexCounts are not those of {count} points"
    if prim.IsA(UsdGeom.Mesh):
        mesh = UsdGeom.Mesh(prim)
        faces = mesh.GetFaceVertexIndicesAttr().Get(code), mesh.GetFaceVertexCountsAttr().Get(code)
        valid, why = UsdGeom.Mesh.ValidateTopology(*faces, count)
        if not valid:
            yield f"is no valid mesh: {why}"


def _turned(prim: Usd.Prim, code: Usd.TimeCode, pose: Pose) -> str | None:
    """The difference of orientations, as renderers evaluate them."""
    if pose.turns is None:
        return None
    of = UsdGeom.PointInstancer(prim)
    every = of.ComputeInstanceTransformsAtTime(code, code, of.ExcludeProtoXform, of.IgnoreMask)
    found = np.array(every, np.float64).reshape(-1, 4, 4)[:, :3, :3]
    found = found / np.linalg.norm(found, axis=2, keepdims=True)
    meant = matrices(pose.turns).transpose(0, 2, 1)
    # Halves have 11 bits.
    off = np.abs(found - meant).max() if found.shape == meant.shape else np.inf
    return None if off < 4e-3 else f"{_orientations(prim).GetName()}: an axis is off by {off:.3g}"


def _places(prim: Usd.Prim) -> Usd.Attribute:
    is_instancer = prim.IsA(UsdGeom.PointInstancer)
    return UsdGeom.PointInstancer(prim).GetPositionsAttr() if is_instancer else UsdGeom.PointBased(prim).GetPointsAttr()


def _orientations(prim: Usd.Prim) -> Usd.Attribute:
    """In single precision, which then counts, where the prim has these."""
    single = prim.GetAttribute("orientationsf")
    return single if single and single.Get(Usd.TimeCode.EarliestTime()) else prim.GetAttribute("orientations")
