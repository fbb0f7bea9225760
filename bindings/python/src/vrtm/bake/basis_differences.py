"""The mesh of basis maps as another program's parser finds it, compared with the scene."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from typing import TYPE_CHECKING

import numpy as np

from vrtm.bake.frames import Frame
from vrtm.bake.scene.axes import Axes, placed
from vrtm.bake.scene.topology import fans
from vrtm.basis import gltf

if TYPE_CHECKING:
    # What has no images, such as Blender, has none of their package.
    from vrtm.bake.mesh_work import MeshWork
    from vrtm.bake.work import Work

_NEAR = 2e-3
"""Of the size of the mesh or of a tile: morph targets are sums."""


class Surface:
    """Triangles, (triangles, 3, 3), whose corners go round counterclockwise where they are seen from the front."""

    def __init__(self, corners: np.ndarray, uvs: np.ndarray) -> None:
        self.low, self.high = corners.min(axis=(0, 1)), corners.max(axis=(0, 1))
        self.size = float(np.ptp(corners, axis=(0, 1)).max()) or 1.0
        centred = (corners - (self.low + self.high) / 2) / self.size
        normals = np.cross(centred[:, 1] - centred[:, 0], centred[:, 2] - centred[:, 0])
        areas, middles = np.linalg.norm(normals, axis=1), centred.mean(axis=1)
        areas /= areas.sum() or 1.0
        self.front = np.append(normals.sum(axis=0), (normals * middles).sum())
        """The mean normal, and the sense in which the surface encloses: one of them tells front from back."""
        mean = areas @ uvs.mean(axis=1)
        self.uvs = np.vstack([mean, (areas[:, None] * middles).T @ (uvs.mean(axis=1) - mean)])
        """The mean of UVs, and how they grow along the axes."""

    def differs(self, meant: Surface) -> Iterator[str]:
        """Differences, as ends of sentences."""
        off = max(np.abs(self.low - meant.low).max(), np.abs(self.high - meant.high).max())
        if not off <= _NEAR * meant.size:
            yield f"it reaches from {self.low.round(4)} to {self.high.round(4)}, not {meant.low} to {meant.high}"
        if self.front @ meant.front < 0:
            yield "it is inside out"
        off = np.abs(self.uvs - meant.uvs).max()
        if not off <= _NEAR:
            yield f"its UVs are off by {off:.3g} in the mean"


def of_gltf(path: str, seconds: Sequence[float], meant: Mapping[int, tuple[str, Surface]]) -> Iterator[str]:
    """Differences of a binary glTF. `seconds`: the times of its poses; `meant`: names and surfaces of poses, by their
    numbers."""
    with open(path, "rb") as file:
        document, values = gltf.read(file.read())
    [mesh], weights = document["meshes"], np.zeros((len(seconds), 0))
    for animation in document.get("animations", ()):
        [sampler] = animation["samplers"]
        times, found = values(sampler["input"]).ravel(), values(sampler["output"])
        if len(times) != len(seconds) or not np.allclose(times, np.array(seconds) - seconds[0], atol=1e-4):
            yield f"its {len(times)} poses are not at the times of {len(seconds)} frames"
            return
        weights = found.reshape(len(times), -1)
    for number, (name, surface) in meant.items():
        corners, uvs = [], []
        for primitive in mesh["primitives"]:
            points, of = (values(primitive["attributes"][kind]) for kind in ("POSITION", "TEXCOORD_0"))
            tile = int(document["materials"][primitive["material"]]["name"]) - 1001
            triangles = values(primitive["indices"]).astype(int).reshape(-1, 3)
            uvs.append(((0, 1) + of * (1, -1) + (tile % 10, tile // 10))[triangles])
            for weight, target in zip(weights[number], primitive.get("targets", ())):
                points = points + weight * values(target["POSITION"])
            corners.append(points[triangles])
        found = Surface(np.concatenate(corners), np.concatenate(uvs))
        yield from (f"{name}: {what}" for what in found.differs(surface))


def of_usd(path: str, work: Work, mesh: MeshWork, frames: Sequence[Frame]) -> Iterator[str]:
    """Differences of a layer with blend shapes, which UsdSkel evaluates."""
    from pxr import Gf, Sdf, Usd, UsdGeom, UsdSkel

    # In memory, so that what is evaluated stays out of the file.
    stage = Usd.Stage.Open(Sdf.Layer.OpenAsAnonymous(path))
    first, last = times = [work.scene.clock.time(frame) for frame in (frames[0], frames[-1])]
    if (stage.GetStartTimeCode(), stage.GetEndTimeCode()) != (first, last):
        yield f"reaches from {stage.GetStartTimeCode():g} to {stage.GetEndTimeCode():g}, not from {first:g} to {last:g}"
    UsdSkel.BakeSkinning(UsdSkel.Root(stage.GetDefaultPrim()), Gf.Interval(first, last))
    own = UsdGeom.Mesh(stage.GetDefaultPrim().GetChild("mesh"))
    triangles = np.array(own.GetFaceVertexIndicesAttr().Get()).reshape(-1, 3)
    if own.GetOrientationAttr().Get() == UsdGeom.Tokens.leftHanded:
        triangles = triangles[:, ::-1]
    uvs = np.array(UsdGeom.PrimvarsAPI(own).GetPrimvar("st").Get(), np.float64)
    for frame, time in zip((frames[0], frames[-1]), times):
        points = np.array(own.GetPointsAttr().Get(time), np.float64)
        found = Surface(points[triangles], uvs[triangles])
        yield from (f"frame {frame}: {what}" for what in found.differs(meant(work, mesh, frame, False)))


def meant(work: Work, mesh: MeshWork, frame: Frame, in_gltf: bool) -> Surface:
    """The mesh in its own space, or in the world of glTF, whose transforms stay as they are at rest."""
    shape, axes = mesh.shape, work.scene.source.axes if in_gltf else Axes()
    to_world = work.scene.source.to_world(shape, None) if in_gltf else np.eye(4)
    points = placed(work.scene.positions(shape, frame).astype(np.float64), to_world)
    if axes.up == "Z":
        points = points[:, [0, 2, 1]] * (1, 1, -1)
    triangles = fans(shape.face_counts)[np.repeat(shape.textured, np.maximum(shape.face_counts - 2, 0))]
    if shape.left_handed != (np.linalg.det(to_world[:3, :3]) < 0):
        triangles = triangles[:, ::-1]
    uvs = shape.uvs[shape.uv_indices[triangles]].astype(np.float64)
    return Surface((axes.meters or 1.0) * points[shape.indices[triangles]], uvs)
