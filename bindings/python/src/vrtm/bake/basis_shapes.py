"""Morph targets as blend shapes of USD. UsdSkel blends points and normals, and no primvar: UVs are the points of a
second mesh."""

import numpy as np
from pxr import Gf, Sdf, Tf, Usd, UsdGeom, UsdSkel, Vt

from vrtm.bake.basis_morphs import Morphed
from vrtm.bake.layer.clips import export, values_hash
from vrtm.bake.layer.write import tell
from vrtm.bake.mark import SHAPES, mark
from vrtm.bake.scene import Scene


def write(path: str, morphed: Morphed, scene: Scene) -> None:
    """Writes a layer whose root is to be referenced where the mesh is: it has the mesh's space and orientation. Raises
    OSError."""
    layer = Sdf.Layer.CreateAnonymous(".usdc")
    stage = Usd.Stage.Open(layer)
    if scene.is_usd:
        tell(Sdf.Layer.FindOrOpen(scene.path), layer, default=False)
    times = [scene.clock.time(frame) for frame in morphed.frames]
    stage.SetStartTimeCode(min(times))
    stage.SetEndTimeCode(max(times))
    root = UsdSkel.Root.Define(stage, "/" + Tf.MakeValidIdentifier(morphed.name))
    stage.SetDefaultPrim(root.GetPrim())
    # Blend shapes need a skeleton, which needs no joint.
    skeleton = UsdSkel.Skeleton.Define(stage, root.GetPath().AppendChild("skeleton"))
    motion = UsdSkel.Animation.Define(stage, root.GetPath().AppendChild("motion"))
    UsdSkel.BindingAPI.Apply(skeleton.GetPrim()).CreateAnimationSourceRel().SetTargets([motion.GetPath()])
    names: list[str] = []
    for target in morphed.targets:
        name = Tf.MakeValidIdentifier(target.name)
        while name in names:
            name += "_"
        names.append(name)
    motion.CreateBlendShapesAttr(names)
    weights = motion.CreateBlendShapeWeightsAttr()
    for time, row in zip(times, morphed.weights):
        weights.Set(Vt.FloatArray.FromNumpy(np.ascontiguousarray(row, np.float32)), time)
    flat = np.zeros((len(morphed.uvs), 1))
    meshes = {
        "mesh": (morphed.rest, [target.positions for target in morphed.targets]),
        "uvs": (np.hstack([morphed.uvs, flat]), [np.hstack([target.uvs, flat]) for target in morphed.targets]),
    }
    for child, (points, offsets) in meshes.items():
        mesh = UsdGeom.Mesh.Define(stage, root.GetPath().AppendChild(child))
        mesh.CreatePointsAttr(_vectors(points))
        mesh.CreateExtentAttr(_vectors(np.stack([points.min(axis=0), points.max(axis=0)])))
        mesh.CreateFaceVertexCountsAttr(Vt.IntArray([3] * len(morphed.triangles)))
        mesh.CreateFaceVertexIndicesAttr(Vt.IntArray.FromNumpy(morphed.triangles.astype(np.int32).ravel()))
        mesh.CreateSubdivisionSchemeAttr(UsdGeom.Tokens.none)
        if morphed.left_handed:
            mesh.CreateOrientationAttr(UsdGeom.Tokens.leftHanded)
        if child == "uvs":
            mesh.CreatePurposeAttr(UsdGeom.Tokens.guide)
        else:
            primvars = UsdGeom.PrimvarsAPI(mesh)
            st = primvars.CreatePrimvar("st", Sdf.ValueTypeNames.TexCoord2fArray, UsdGeom.Tokens.vertex)
            st.Set(Vt.Vec2fArray.FromNumpy(np.ascontiguousarray(morphed.uvs, np.float32)))
        binding = UsdSkel.BindingAPI.Apply(mesh.GetPrim())
        binding.CreateSkeletonRel().SetTargets([skeleton.GetPath()])
        # Skeletons have joints as a rule, and some programs ask for their influences.
        binding.CreateGeomBindTransformAttr(Gf.Matrix4d(1))
        binding.CreateBlendShapesAttr(names)
        for name, moves in zip(names, offsets):
            shape = UsdSkel.BlendShape.Define(stage, mesh.GetPath().AppendChild(name))
            shape.CreateOffsetsAttr(_vectors(moves))
            binding.CreateBlendShapeTargetsRel().AddTarget(shape.GetPath())
    mark(layer, SHAPES)
    export(layer, path, values_hash)


def _vectors(values: np.ndarray) -> Vt.Vec3fArray:
    return Vt.Vec3fArray.FromNumpy(np.ascontiguousarray(values, np.float32))
