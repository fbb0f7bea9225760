"""Morph targets as blend shapes of USD: the mesh, and its UVs as a mesh of their own, whose points are the UVs. UsdSkel
blends points and normals, and no primvar: what it blends of the second mesh is what the UVs of the first should be."""

from __future__ import annotations

import numpy as np
from pxr import Gf, Sdf, Tf, Usd, UsdGeom, UsdSkel, Vt

from vrtm.bake.basis_morphs import Morphed
from vrtm.bake.layer import export, values_hash
from vrtm.bake.layer.write import STAGE_FIELDS
from vrtm.bake.mark import SHAPES, mark
from vrtm.bake.scene import Scene


def write(path: str, morphed: Morphed, scene: Scene) -> None:
    """Writes a layer with a root for reference, to be placed where the mesh is. Raises OSError."""
    layer = Sdf.Layer.CreateAnonymous(".usdc")
    stage = Usd.Stage.Open(layer)
    below = Sdf.Layer.FindOrOpen(scene.path) if scene.is_usd else None
    times = [float(frame) for frame in morphed.frames]
    if below is not None:
        times = [scene.clock.time(frame) for frame in times]
        for name in STAGE_FIELDS:
            if name != "defaultPrim" and below.pseudoRoot.HasInfo(name):
                layer.pseudoRoot.SetInfo(name, below.pseudoRoot.GetInfo(name))
    stage.SetStartTimeCode(min(times))
    stage.SetEndTimeCode(max(times))
    root = UsdSkel.Root.Define(stage, "/" + Tf.MakeValidIdentifier(morphed.name))
    stage.SetDefaultPrim(root.GetPrim())
    # Blend shapes need a skeleton, which needs no joint.
    skeleton = UsdSkel.Skeleton.Define(stage, root.GetPath().AppendChild("skeleton"))
    motion = UsdSkel.Animation.Define(stage, root.GetPath().AppendChild("motion"))
    UsdSkel.BindingAPI.Apply(skeleton.GetPrim()).CreateAnimationSourceRel().SetTargets([motion.GetPath()])
    tokens = _tokens([target.name for target in morphed.targets])
    motion.CreateBlendShapesAttr(tokens)
    weights = motion.CreateBlendShapeWeightsAttr()
    for time, row in zip(times, morphed.weights):
        weights.Set(Vt.FloatArray.FromNumpy(np.ascontiguousarray(row, np.float32)), time)
    flat = np.zeros((len(morphed.uvs), 1))
    uvs = np.hstack([morphed.uvs, flat])
    shapes = {token: target.positions for token, target in zip(tokens, morphed.targets)}
    mesh = _mesh(stage, root.GetPath().AppendChild("mesh"), skeleton, morphed.rest, morphed.triangles, shapes)
    primvar = UsdGeom.PrimvarsAPI(mesh).CreatePrimvar("st", Sdf.ValueTypeNames.TexCoord2fArray, UsdGeom.Tokens.vertex)
    primvar.Set(Vt.Vec2fArray.FromNumpy(np.ascontiguousarray(morphed.uvs, np.float32)))
    shapes = {token: np.hstack([target.uvs, flat]) for token, target in zip(tokens, morphed.targets)}
    of_uvs = _mesh(stage, root.GetPath().AppendChild("uvs"), skeleton, uvs, morphed.triangles, shapes)
    of_uvs.CreatePurposeAttr(UsdGeom.Tokens.guide)
    mark(layer, SHAPES)
    export(layer, path, values_hash)


def _tokens(names: list[str]) -> list[str]:
    """The names of targets as USD takes them, each of them once."""
    found: list[str] = []
    for name in names:
        token = Tf.MakeValidIdentifier(name)
        while token in found:
            token += "_"
        found.append(token)
    return found


def _mesh(
    stage: Usd.Stage,
    path: Sdf.Path,
    skeleton: UsdSkel.Skeleton,
    points: np.ndarray,
    triangles: np.ndarray,
    shapes: dict[str, np.ndarray],
) -> UsdGeom.Mesh:
    """A mesh with the blend shapes that move any of its points, each with the offsets of those alone."""
    mesh = UsdGeom.Mesh.Define(stage, path)
    mesh.CreatePointsAttr(_vectors(points))
    mesh.CreateExtentAttr(_vectors(np.stack([points.min(axis=0), points.max(axis=0)])))
    mesh.CreateFaceVertexCountsAttr(Vt.IntArray([3] * len(triangles)))
    mesh.CreateFaceVertexIndicesAttr(Vt.IntArray.FromNumpy(np.ascontiguousarray(triangles.ravel(), np.int32)))
    mesh.CreateSubdivisionSchemeAttr(UsdGeom.Tokens.none)
    binding = UsdSkel.BindingAPI.Apply(mesh.GetPrim())
    binding.CreateSkeletonRel().SetTargets([skeleton.GetPath()])
    # Skeletons have joints as a rule, and some programs ask for their influences.
    binding.CreateGeomBindTransformAttr(Gf.Matrix4d(1))
    names, targets = [], []
    for name, offsets in shapes.items():
        moving = np.flatnonzero(offsets.astype(np.float32).any(axis=1))
        if len(moving):
            shape = UsdSkel.BlendShape.Define(stage, path.AppendChild(name))
            shape.CreateOffsetsAttr(_vectors(offsets[moving]))
            shape.CreatePointIndicesAttr(Vt.IntArray.FromNumpy(moving.astype(np.int32)))
            names.append(name)
            targets.append(shape.GetPath())
    binding.CreateBlendShapesAttr(names)
    binding.CreateBlendShapeTargetsRel().SetTargets(targets)
    return mesh


def _vectors(values: np.ndarray) -> Vt.Vec3fArray:
    return Vt.Vec3fArray.FromNumpy(np.ascontiguousarray(values, np.float32))
