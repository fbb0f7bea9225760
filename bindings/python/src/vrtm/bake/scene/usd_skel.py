"""UsdSkel: where blend shapes and joints put the points of a mesh."""

from __future__ import annotations

from typing import Any

import numpy as np
from pxr import Usd, UsdSkel, Vt

from vrtm.bake.scene.axes import placed
from vrtm.bake.scene.types import SceneError
from vrtm.bake.scene.usd_stage import ANY, shown

_MOVED_BY = ("skel:skeleton", "primvars:skel:jointIndices", "skel:blendShapeTargets")
_NO_API = "the API SkelBindingAPI is not applied to it"


class Skeletons:
    """The skeletons of a stage, each read once."""

    def __init__(self, stage: Usd.Stage) -> None:
        self._cache = UsdSkel.Cache()
        self._bound: dict[str, tuple[Any, Any]] = {}
        for prim in shown(stage):
            if not prim.IsA(UsdSkel.Root):
                continue
            root, below = UsdSkel.Root(prim), (() if prim.IsDefined() else (ANY,))
            self._cache.Populate(root, Usd.TraverseInstanceProxies(*below))
            for binding in self._cache.ComputeSkelBindings(root, Usd.TraverseInstanceProxies(*below)):
                skeleton = self._cache.GetSkelQuery(binding.GetSkeleton())
                for target in binding.GetSkinningTargets():
                    self._bound[str(target.GetPrim().GetPath())] = (skeleton, target)

    def skin(self, prim: Usd.Prim, where: str) -> Skin | None:
        """The skinning of a mesh; None if it has none."""
        bound = self._bound.get(str(prim.GetPath()))
        return Skin(prim, *bound, where) if bound else None

    def why_still(self, prim: Usd.Prim) -> str:
        """The reason why no skeleton moves a mesh that is made for one, as a sentence; empty if nothing is odd."""
        name = next((name for name in _MOVED_BY if prim.HasProperty(name)), "")
        bound = self._bound.get(str(prim.GetPath()))
        if bound is not None:
            prim, name = bound[0].GetPrim(), "skel:animationSource"
            why = "" if prim.HasAPI(UsdSkel.BindingAPI) or not prim.HasProperty(name) else _NO_API
        else:
            above = prim
            while above and not above.IsA(UsdSkel.Root):
                above = above.GetParent()
            why = "it is not below a SkelRoot" if not above else "USD finds no skeleton for it"
            why = why if not above or prim.HasAPI(UsdSkel.BindingAPI) else _NO_API
        return f"{prim.GetPath()} has {name}, which is ignored, since {why}" if name and why else ""


class Skin:
    """One skinned mesh. Positions are in the space of its skeleton, or, without joints, of the mesh."""

    def __init__(self, prim: Usd.Prim, skeleton: Any, target: Any, where: str) -> None:
        self._where = where
        self._skeleton = skeleton
        self._target = target
        self._animation = skeleton.GetAnimQuery()
        self._shapes = None
        if target.HasBlendShapes() and self._animation:
            self._shapes = UsdSkel.BlendShapeQuery(UsdSkel.BindingAPI(prim))
            self._point_indices = self._shapes.ComputeBlendShapePointIndices()
            self._offsets = self._shapes.ComputeSubShapePointOffsets()
        self._jointed = bool(target.HasJointInfluences())

    @property
    def moves(self) -> bool:
        return bool(self._animation)

    def samples(self) -> list[float]:
        """The time codes of the samples of its animation."""
        joints = self._animation.GetJointTransformTimeSamples() if self._jointed and self._animation else []
        return [*joints, *(self._animation.GetBlendShapeWeightTimeSamples() if self._shapes is not None else [])]

    @property
    def space(self) -> Usd.Prim | None:
        """The prim in whose space positions are; None: the mesh itself."""
        return self._skeleton.GetPrim() if self._jointed else None

    def identity(self) -> str:
        """Key of a skinning, equal for instances that the same animation moves."""
        animation = self._animation.GetPrim() if self._animation else None
        skeleton = self._skeleton.GetPrim()
        parts = [
            prim and (prim.GetPrimInPrototype() if prim.IsInstanceProxy() else prim) for prim in (animation, skeleton)
        ]
        return " ".join(str(prim.GetPath()) if prim else "" for prim in parts)

    def bound(self, points: np.ndarray) -> np.ndarray:
        """Points of the mesh in the bind pose: moved to the skeleton's space."""
        return placed(points, np.array(self._target.GetGeomBindTransform())) if self._jointed else points

    def posed(self, points: np.ndarray, time: Usd.TimeCode) -> np.ndarray:
        """(points, 3) at a time code: blend shapes, then joints. Raises SceneError."""
        values = Vt.Vec3fArray.FromNumpy(np.ascontiguousarray(points, np.float32))
        if self._shapes is not None:
            self._blend(values, time)
        if self._jointed:
            # A skeleton without an animation stays in its rest pose, which need not be its bind pose.
            transforms = self._skeleton.ComputeSkinningTransforms(time)
            if not transforms or not self._target.ComputeSkinnedPoints(transforms, values, time):
                raise SceneError(f"{self._where}: its skeleton cannot pose it at time code {time}")
        return np.array(values)

    def _blend(self, points: Vt.Vec3fArray, time: Usd.TimeCode) -> None:
        weights = self._animation.ComputeBlendShapeWeights(time)
        mapper = self._target.GetBlendShapeMapper()
        if mapper is not None and not mapper.IsIdentity():
            weights = mapper.Remap(weights, Vt.FloatArray())
        parts = self._shapes.ComputeSubShapeWeights(weights)
        if not parts or not self._shapes.ComputeDeformedPoints(*parts, self._point_indices, self._offsets, points):
            raise SceneError(f"{self._where}: its blend shapes cannot pose it at time code {time}")
