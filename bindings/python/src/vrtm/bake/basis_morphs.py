"""Basis maps as geometry: the mesh, split until UVs in between are near enough in all frames, with morph targets."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np

import vrtm
from vrtm.bake.frames import Frame
from vrtm.bake.raster import area
from vrtm.bake.scene import Shape
from vrtm.bake.scene.axes import GLTF, placed
from vrtm.bake.scene.topology import fans
from vrtm.basis.gltf import Morph, glb
from vrtm.basis.morph import morphs

if TYPE_CHECKING:
    # What has no images, such as Blender, has none of their package.
    from vrtm.bake.mesh_work import MeshWork
    from vrtm.bake.work import Work

_TOLERANCE = 1 / 2048
"""In UV: the least error that the mesh is split for, that of a texture of 4096 by two texels."""
_SHAPE = 5e-4
"""The most that positions of morph targets may be off by, as a share of the mesh's size."""


@dataclass(frozen=True, eq=False)
class Morphed:
    """A mesh with morph targets, and the weights of the frames."""

    name: str
    rest: np.ndarray
    """(vertices, 3), in the mesh's own space."""
    uvs: np.ndarray
    """(vertices, 2), v up, those of all tiles side by side."""
    place: np.ndarray
    """(vertices, 2): the tile of each, as what its UVs are rounded down to."""
    triangles: np.ndarray
    """(triangles, 3), of vertices."""
    left_handed: bool
    """True if the front of a triangle is where its corners go round clockwise."""
    targets: list[Morph]
    frames: Sequence[Frame | str]
    weights: np.ndarray
    """(frames, targets)."""
    figures: dict

    def glb(self, seconds: Sequence[float], matrix: np.ndarray) -> bytes:
        """Binary glTF, with a primitive per tile. `seconds`: the times of the frames; `matrix`: `to_gltf` of the
        mesh."""
        of_triangle, triangles = self.place[self.triangles[:, 0]], self.triangles
        if self.left_handed != (np.linalg.det(matrix[:3, :3]) < 0):
            triangles = triangles[:, ::-1]
        tiles = {
            str(1001 + u + 10 * v): triangles[(of_triangle == (u, v)).all(axis=1)]
            for u, v in np.unique(of_triangle, axis=0).tolist()
        }
        targets = [replace(target, positions=target.positions @ matrix[:3, :3]) for target in self.targets]
        rest, times = placed(self.rest, matrix), np.array(seconds) - seconds[0]
        program = f"vrtm {vrtm.version()}"
        return glb(self.name, rest, self.uvs - self.place, tiles, targets, times, self.weights, program)


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

    return of_poses(mesh.shape, part.asset, poses, solve, frames, names, weights, settings.bound, settings.texture_size)


def of_poses(
    shape: Shape,
    asset: vrtm.Asset,
    poses: Sequence[np.ndarray],
    solve: Callable[[int], None],
    frames: Sequence[Frame | str],
    names: Sequence[str],
    weights: np.ndarray,
    bound: float,
    texture_size: int,
) -> Morphed:
    """The same for a mesh with its asset, which `solve` solves for the pose with a number. `bound`: the error in UV;
    `texture_size`: texels, for figures."""
    tolerance = max(bound, _TOLERANCE)
    solve(0)
    with asset.refine(tolerance=tolerance) as refinement:
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

    rest, own = refined(shape.rest), pattern.corner_uvs[first].astype(np.float64)
    moved = np.stack([refined(pose) - rest for pose in poses])
    shifted = np.stack([uvs[first] - own for uvs in redirected])
    size = float(np.ptp(shape.rest, axis=0).max(initial=0)) or 1.0
    made, all_weights = morphs(names, weights, moved, shifted, _SHAPE * size)
    total = np.einsum("fm,mvc->fvc", all_weights, np.stack([morph.uvs for morph in made])) if made else 0 * shifted
    off = np.linalg.norm(total - shifted, axis=-1).max(axis=1, initial=0) * texture_size
    turned = _areas(own + total, triangles) * _areas(own, triangles) < 0
    figures = {
        "triangles": len(triangles),
        "mesh_triangles": len(fans(shape.face_counts)),
        "targets": [morph.name for morph in made],
        "error": float(off.max(initial=0)),
        "worst": frames[int(off.argmax())],
        "error_between": between * texture_size,
        "folds": int(turned.sum(axis=1).max(initial=0)),
    }
    return Morphed(
        shape.name, rest, own, place[first], triangles, shape.left_handed, made, frames, all_weights, figures
    )


def to_gltf(work: Work, mesh: MeshWork) -> np.ndarray:
    """(4, 4) by which rows of positions of a mesh are multiplied to lie in the world of glTF as they do in the scene at
    rest."""
    return work.scene.source.to_world(mesh.shape, None) @ work.scene.source.axes.to(GLTF)


def _areas(uvs: np.ndarray, triangles: np.ndarray) -> np.ndarray:
    """(..., triangles): twice the areas, with their signs."""
    return area(*(uvs[..., triangles[:, k], :] for k in range(3)))
