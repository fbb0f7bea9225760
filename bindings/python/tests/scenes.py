"""Small USD scenes, built in code, that several tests read."""

import math
from collections.abc import Mapping, Sequence
from pathlib import Path

import numpy as np
from numpy.typing import ArrayLike
from pxr import Gf, Sdf, Usd, UsdGeom, UsdShade, UsdSkel, Vt

# Two squares side by side.
POINTS = [(0, 0, 0), (1, 0, 0), (2, 0, 0), (0, 1, 0), (1, 1, 0), (2, 1, 0)]
INDICES = [0, 1, 4, 3, 1, 2, 5, 4]
UVS = [(0, 0), (0.5, 0), (1, 0), (0, 1), (0.5, 1), (1, 1)]
TYPES = Sdf.ValueTypeNames


def stage(
    path: Path, first: float | None = 1, last: float | None = 5, fps: float | None = 24, meters: float = 0.01
) -> Usd.Stage:
    """A new stage at a path, with units, a range of frames and a rate, if any."""
    made = Usd.Stage.CreateNew(str(path))
    UsdGeom.SetStageUpAxis(made, UsdGeom.Tokens.y)
    UsdGeom.SetStageMetersPerUnit(made, meters)
    if fps is not None:
        made.SetTimeCodesPerSecond(fps)
        made.SetFramesPerSecond(fps)
    if first is not None:
        made.SetStartTimeCode(first)
        made.SetEndTimeCode(last)
    return made


def saved(made: Usd.Stage) -> str:
    """Saves a stage; returns its path."""
    made.Save()
    return made.GetRootLayer().realPath


def mesh(
    made: Usd.Stage,
    path: str,
    points: ArrayLike = POINTS,
    uvs: ArrayLike | None = UVS,
    interpolation: str = "vertex",
    indices: Sequence[int] | None = None,
    name: str = "st",
    faces: ArrayLike = INDICES,
    poses: Mapping[float, ArrayLike] | None = None,
    pref: bool = False,
) -> UsdGeom.Mesh:
    """A mesh of quadrilaterals without subdivision, two squares unless told otherwise. `poses`: points by time code.
    `pref`: with the points as Pref, too."""
    prim = UsdGeom.Mesh.Define(made, path)
    corners = np.asarray(faces, np.int32).reshape(-1)
    prim.CreatePointsAttr(np.float32(points))
    prim.CreateFaceVertexCountsAttr([4] * -(-len(corners) // 4))
    prim.CreateFaceVertexIndicesAttr(corners)
    prim.CreateSubdivisionSchemeAttr("none")
    prim.CreateExtentAttr(UsdGeom.PointBased.ComputeExtent(np.float32(points)))
    for frame, pose in (poses or {}).items():
        prim.GetPointsAttr().Set(np.float32(pose), frame)
    if uvs is not None:
        primvar(prim.GetPrim(), name, TYPES.TexCoord2fArray, np.float32(uvs), interpolation, indices)
    if pref:
        primvar(prim.GetPrim(), "Pref", TYPES.Point3fArray, np.float32(points), "vertex")
    return prim


def primvar(
    prim: Usd.Prim,
    name: str,
    kind: Sdf.ValueTypeName,
    values: ArrayLike,
    interpolation: str,
    indices: Sequence[int] | None = None,
) -> UsdGeom.Primvar:
    """A primvar, indexed if there are indices."""
    made = UsdGeom.PrimvarsAPI(prim).CreatePrimvar(name, kind, interpolation)
    made.Set(values)
    if indices is not None:
        made.SetIndices(Vt.IntArray.FromNumpy(np.int32(indices)))
    return made


def instance(made: Usd.Stage, path: str, target: str, file: str = "") -> Usd.Prim:
    """An instance of a prim of the stage, or of another file."""
    prim = made.DefinePrim(path)
    prim.GetReferences().AddReference(file, target)
    prim.SetInstanceable(True)
    return prim


def stretch(prim: UsdGeom.Mesh, frames: Sequence[float]) -> None:
    """Time samples in which the right edge moves by 0.1 per frame after the first."""
    for frame in frames:
        prim.GetPointsAttr().Set([(x + 0.1 * (frame - frames[0]) * (x == 2), y, z) for x, y, z in POINTS], frame)


def arm(path: Path, last: int = 10) -> Usd.Stage:
    """An arm of two joints that bends by 90 degrees about x = 1 from frame 1 to the last, with a blend shape of the
    last vertex: by 1 in z at weight 1, by 3 at 0.5, where it has an in-between. The mesh is bound 10 to the left of
    where it is modelled, its first joint is not animated, and there is an animated shape that the mesh does not
    have."""
    made = stage(path, 1, last)
    UsdSkel.Root.Define(made, "/arm")
    skeleton = UsdSkel.Skeleton.Define(made, "/arm/skeleton")
    skeleton.CreateJointsAttr(["upper", "upper/lower"])
    one, at_elbow = Gf.Matrix4d(1), Gf.Matrix4d().SetTranslate((1, 0, 0))
    skeleton.CreateBindTransformsAttr([one, at_elbow])
    skeleton.CreateRestTransformsAttr([one, at_elbow])
    animation = UsdSkel.Animation.Define(made, "/arm/animation")
    animation.CreateJointsAttr(["upper/lower"])
    animation.CreateTranslationsAttr([(1, 0, 0)])
    animation.CreateScalesAttr([Gf.Vec3h(1, 1, 1)])
    rotations = animation.CreateRotationsAttr()
    animation.CreateBlendShapesAttr(["another", "bulge"])
    weights = animation.CreateBlendShapeWeightsAttr()
    for frame in range(1, last + 1):
        share = (frame - 1) / (last - 1)
        half = math.radians(90 * share) / 2
        rotations.Set([Gf.Quatf(math.cos(half), 0, 0, math.sin(half))], frame)
        weights.Set([1 - share, share], frame)
    UsdSkel.BindingAPI.Apply(skeleton.GetPrim()).CreateAnimationSourceRel().SetTargets([animation.GetPath()])
    skin = mesh(made, "/arm/skin", [(x + 10, y, z) for x, y, z in POINTS])
    binding = UsdSkel.BindingAPI.Apply(skin.GetPrim())
    binding.CreateGeomBindTransformAttr(Gf.Matrix4d().SetTranslate((-10, 0, 0)))
    binding.CreateSkeletonRel().SetTargets([skeleton.GetPath()])
    binding.CreateJointIndicesPrimvar(False, 1).Set([0, 0, 1, 0, 0, 1])
    binding.CreateJointWeightsPrimvar(False, 1).Set([1.0] * 6)
    bulge = UsdSkel.BlendShape.Define(made, "/arm/skin/bulge")
    bulge.CreateOffsetsAttr([(0, 0, 1)])
    bulge.CreatePointIndicesAttr([5])
    between = bulge.CreateInbetween("half")
    between.SetWeight(0.5)
    between.SetOffsets([(0, 0, 3)])
    binding.CreateBlendShapesAttr(["bulge"])
    binding.CreateBlendShapeTargetsRel().SetTargets([bulge.GetPath()])
    return made


def arm_at(share: float) -> np.ndarray:
    """The arm's closed form, at a share of its 90 degrees; in the skeleton's space."""
    points = np.array(POINTS, float)
    angle = math.radians(90 * share)
    points[5, 2] = 6 * share if share < 0.5 else 3 - 4 * (share - 0.5)
    for vertex in (2, 5):
        x, y, z = points[vertex] - (1, 0, 0)
        points[vertex] = 1 + x * math.cos(angle) - y * math.sin(angle), x * math.sin(angle) + y * math.cos(angle), z
    return points


def preview_material(
    made: Usd.Stage, path: str, texture: str = "colour.<UDIM>.png", uv: str = "st"
) -> UsdShade.Material:
    """UsdPreviewSurface with a texture, whose UV set is named by the material's interface, as exporters write it."""
    material = UsdShade.Material.Define(made, path)
    name = material.CreateInput("uvset", TYPES.String)
    name.Set(uv)
    surface = shader(made, f"{path}/surface", "UsdPreviewSurface")
    image = shader(made, f"{path}/colour", "UsdUVTexture")
    reader = shader(made, f"{path}/uv", "UsdPrimvarReader_float2")
    reader.CreateInput("varname", TYPES.String).ConnectToSource(name)
    image.CreateInput("file", TYPES.Asset).Set(Sdf.AssetPath(texture))
    image.CreateInput("st", TYPES.Float2).ConnectToSource(reader.CreateOutput("result", TYPES.Float2))
    surface.CreateInput("diffuseColor", TYPES.Color3f).ConnectToSource(image.CreateOutput("rgb", TYPES.Float3))
    material.CreateSurfaceOutput().ConnectToSource(surface.CreateOutput("surface", TYPES.Token))
    return material


def materialx_material(made: Usd.Stage, path: str, plugged: bool = True, graph: bool = True) -> UsdShade.Material:
    """A MaterialX network: in a node graph or not, with a reader of UVs and a transform of them, or with neither."""
    material = UsdShade.Material.Define(made, path)
    inner = path
    if graph:
        inner = f"{path}/graph"
        UsdShade.NodeGraph.Define(made, inner)
    image = shader(made, f"{inner}/colour", "ND_image_color3")
    image.CreateInput("file", TYPES.Asset).Set(Sdf.AssetPath("colour.<UDIM>.exr"))
    if plugged:
        reader = shader(made, f"{inner}/uv", "ND_geompropvalue_vector2")
        reader.CreateInput("geomprop", TYPES.String).Set("st")
        scale = shader(made, f"{inner}/scale", "ND_multiply_vector2FA")
        scale.CreateInput("in1", TYPES.Float2).ConnectToSource(reader.CreateOutput("out", TYPES.Float2))
        scale.CreateInput("in2", TYPES.Float).Set(2.0)
        image.CreateInput("texcoord", TYPES.Float2).ConnectToSource(scale.CreateOutput("out", TYPES.Float2))
    colour = image.CreateOutput("out", TYPES.Color3f)
    if graph:
        port = UsdShade.NodeGraph(made.GetPrimAtPath(inner)).CreateOutput("colour", TYPES.Color3f)
        port.ConnectToSource(colour)
        colour = port
    surface = shader(made, f"{path}/surface", "ND_surface_unlit")
    surface.CreateInput("emission_color", TYPES.Color3f).ConnectToSource(colour)
    material.CreateSurfaceOutput("mtlx").ConnectToSource(surface.CreateOutput("out", TYPES.Token))
    return material


def shader(made: Usd.Stage, path: str, name: str) -> UsdShade.Shader:
    """A node of a network."""
    node = UsdShade.Shader.Define(made, path)
    node.CreateIdAttr(name)
    return node


def bind(prim: Usd.Prim | UsdGeom.Imageable, material: UsdShade.Material) -> None:
    """Binds a material to a prim."""
    UsdShade.MaterialBindingAPI.Apply(prim.GetPrim()).Bind(material)
