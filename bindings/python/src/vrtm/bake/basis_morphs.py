"""Basis maps as geometry: the mesh, split until UVs in between are near enough in all frames, with morph targets."""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np

import vrtm
from vrtm.bake.frames import Frame
from vrtm.bake.mesh_work import MeshWork
from vrtm.bake.raster import area
from vrtm.bake.scene.topology import fans
from vrtm.bake.work import Work
from vrtm.basis.gltf import glb
from vrtm.basis.morph import morphs

_TOLERANCE = 1 / 2048
"""In UV: the least error that the mesh is split for, that of a texture of 4096 by two texels."""
_SHAPE = 5e-4
"""The most that positions of morph targets may be off by, as a share of the mesh's size."""


def morphed(
    work: Work,
    mesh: MeshWork,
    frames: Sequence[Frame],
    names: Sequence[str],
    weights: np.ndarray,
    stop: Callable[[], None],
) -> tuple[bytes, dict]:
    """Binary glTF of a mesh without subsets, split and with its targets, a primitive per tile; and figures. `weights`:
    (frames, targets) of the targets with `names`. Raises SceneError, Failure."""
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
    place = place[first]
    of_triangle = place[triangles[:, 0]]
    primitives = {
        str(1001 + u + 10 * v): triangles[(of_triangle == (u, v)).all(axis=1)]
        for u, v in np.unique(of_triangle, axis=0).tolist()
    }
    times = (np.array(frames, float) - float(frames[0])) / _rate(settings.options.fps)
    program = f"vrtm {vrtm.version()}"
    return glb(mesh.shape.name, rest, own - place, primitives, made, times, all_weights, program), figures


def _areas(uvs: np.ndarray, triangles: np.ndarray) -> np.ndarray:
    """(..., triangles): twice the areas, with their signs."""
    return area(*(uvs[..., triangles[:, k], :] for k in range(3)))


def _rate(fps: float | str | None) -> float:
    """Frames per second of the animation, where the scene's are not asked for."""
    return float(fps) if isinstance(fps, (int, float)) else 24.0
