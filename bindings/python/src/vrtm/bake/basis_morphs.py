"""Basis maps as geometry: the mesh, split until UVs in between are near enough in all frames, with morph targets."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
from pxr import Gf, Sdf, Tf, Usd, UsdGeom, UsdSkel, Vt

import vrtm
from vrtm.bake.frames import Frame
from vrtm.bake.layer import export, values_hash
from vrtm.bake.layer.write import tell
from vrtm.bake.mark import SHAPES, mark
from vrtm.bake.mesh_work import MeshWork
from vrtm.bake.raster import area
from vrtm.bake.scene import Scene
from vrtm.bake.scene.topology import fans
from vrtm.bake.work import Work
from vrtm.basis.gltf import Morph, glb
from vrtm.basis.morph import morphs

_TOLERANCE = 1 / 2048
"""In UV: the least error that the mesh is split for, that of a texture of 4096 by two texels."""
_SHAPE = 5e-4
"""The most that positions of morph targets may be off by, as a share of the mesh's size."""


@dataclass(frozen=True, eq=False)
class Morphed:
    """A mesh with morph targets, and the weights of the frames."""

    name: str
    rest: np.ndarray
    """(vertices, 3)."""
    uvs: np.ndarray
    """(vertices, 2), v up, those of all tiles side by side."""
    place: np.ndarray
    """(vertices, 2): the tile of each, as what its UVs are rounded down to."""
    triangles: np.ndarray
    """(triangles, 3), of vertices."""
    targets: list[Morph]
    frames: list[Frame]
    weights: np.ndarray
    """(frames, targets)."""
    figures: dict

    def glb(self, fps: float | str | None) -> bytes:
        """Binary glTF, with a primitive per tile."""
        tiles = self.place[self.triangles[:, 0]]
        found = {1001 + u + 10 * v: (tiles == (u, v)).all(axis=1) for u, v in np.unique(tiles, axis=0).tolist()}
        times = (np.array(self.frames, float) - float(self.frames[0])) / _rate(fps)
        own, named = self.uvs - self.place, {str(udim): self.triangles[which] for udim, which in found.items()}
        program = f"vrtm {vrtm.version()}"
        return glb(self.name, self.rest, own, named, self.targets, times, self.weights, program)


def morphed(
    work: Work,
    mesh: MeshWork,
    frames: Sequence[Frame],
    names: Sequence[str],
    weights: np.ndarray,
    stop: Callable[[], None],
) -> Morphed:
    """A mesh without subsets, split and with its targets. `weights`: (frames, targets) of the targets with `names`.
    Raises SceneError, Failure."""
    settings, (part,) = work.settings, mesh.parts
    poses = [work.scene.positions(mesh.shape, frame) for frame in frames]

    def solve(k: int) -> None:
        part.solve(frames[k], poses[k], mesh.tiles, False, mesh.releases, settings.warm, stop)

    tolerance = max(settings.bound, _TOLERANCE)
    solve(0)
    with part.asset.refine(tolerance=tolerance) as refinement:
        between = refinement.info.error
        for k in range(1, len(frames)):
            solve(k)
            refinement.extend()
            between = max(between, refinement.info.error)
        pattern = refinement.pattern()
        redirected = []
        for k in range(len(frames)):
            solve(k)
            redirected.append(refinement.corner_uvs())
    corners = fans(pattern.face_corners)
    tiles = np.floor(pattern.corner_uvs[corners].mean(axis=1)).astype(int)
    place = np.zeros((len(pattern.corner_uvs), 2), int)
    place[corners] = tiles[:, None]
    # A vertex of the file is one of the mesh with its UVs in all frames.
    every = np.stack([pattern.corner_uvs, *redirected], axis=1).reshape(len(place), -1)
    keys = np.hstack([pattern.corner_vertices[:, None].astype(np.float64), place, every])
    _, first, number = np.unique(keys, axis=0, return_index=True, return_inverse=True)
    triangles = number.reshape(-1)[corners]
    vertices = pattern.corner_vertices[first]
    sources, shares = pattern.vertex_sources[vertices], pattern.vertex_weights[vertices].astype(np.float64)

    def refined(positions: np.ndarray) -> np.ndarray:
        return np.einsum("vsc,vs->vc", positions.astype(np.float64)[sources], shares)

    rest, own = refined(mesh.shape.rest), pattern.corner_uvs[first].astype(np.float64)
    moved = np.stack([refined(pose) - rest for pose in poses])
    shifted = np.stack([uvs[first] - own for uvs in redirected])
    size = float(np.ptp(mesh.shape.rest, axis=0).max(initial=0)) or 1.0
    made, all_weights = morphs(names, weights, moved, shifted, _SHAPE * size)
    total = np.einsum("fm,mvc->fvc", all_weights, np.stack([morph.uvs for morph in made])) if made else 0 * shifted
    off = np.linalg.norm(total - shifted, axis=-1).max(axis=1, initial=0) * settings.texture_size
    turned = _areas(own + total, triangles) * _areas(own, triangles) < 0
    figures = {
        "triangles": len(triangles),
        "mesh_triangles": len(fans(mesh.shape.face_counts)),
        "targets": [morph.name for morph in made],
        "error": float(off.max(initial=0)),
        "worst": frames[int(off.argmax())],
        "error_between": between * settings.texture_size,
        "folds": int(turned.sum(axis=1).max(initial=0)),
    }
    return Morphed(mesh.shape.name, rest, own, place[first], triangles, made, list(frames), all_weights, figures)


def _areas(uvs: np.ndarray, triangles: np.ndarray) -> np.ndarray:
    """(..., triangles): twice the areas, with their signs."""
    return area(*(uvs[..., triangles[:, k], :] for k in range(3)))


def _rate(fps: float | str | None) -> float:
    """Frames per second of the animation, where the scene's are not asked for."""
    return float(fps) if isinstance(fps, (int, float)) else 24.0


def write_shapes(path: str, morphed: Morphed, scene: Scene) -> None:
    """Writes morph targets as blend shapes of USD: a layer with a root for reference, to be placed where the mesh is.
    It has the mesh, and a mesh whose points are its UVs. UsdSkel blends points and normals, and no primvar: the blended
    points of the second mesh are the UVs of the first. Raises OSError."""
    layer = Sdf.Layer.CreateAnonymous(".usdc")
    stage = Usd.Stage.Open(layer)
    below = Sdf.Layer.FindOrOpen(scene.path) if scene.is_usd else None
    times = [float(frame) for frame in morphed.frames]
    if below is not None:
        times = [scene.clock.time(frame) for frame in times]
        tell(below, layer, default=False)
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
