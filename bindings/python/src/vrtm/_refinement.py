"""Refinements: meshes split for hosts that support only UV sets."""

import ctypes
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from . import _abi
from ._arrays import filled
from ._library import Owned, check, library, new
from ._names import natural, told
from ._records import RefinementInfo


@dataclass(frozen=True)
class Pattern:
    """Recipe for the refined mesh from the mesh. Vertices and corners have three sources each, with weights that add
    up to 1: positions of the refined mesh are (positions[vertex_sources] * vertex_weights[..., None]).sum(1)."""

    vertex_sources: NDArray[np.uint32]
    """(vertices, 3) of uint32: vertices of the mesh. The mesh's own vertices come first."""
    vertex_weights: NDArray[np.float32]
    """(vertices, 3) of float32: the weights of vertex_sources."""
    face_sources: NDArray[np.uint32]
    """(faces,) of uint32: the face of the mesh that contains each face."""
    face_corners: NDArray[np.uint32]
    """(faces,) of uint32: the number of corners."""
    corner_vertices: NDArray[np.uint32]
    """(corners,) of uint32: the vertex of each corner."""
    corner_sources: NDArray[np.uint32]
    """(corners, 3) of uint32: source corners of the mesh."""
    corner_weights: NDArray[np.float32]
    """(corners, 3) of float32: the weights of corner_sources."""
    corner_uvs: NDArray[np.float32]
    """(corners, 2) of float32: the original UVs, with the tile's place added."""


class Refinement(Owned):
    """The mesh of an asset, its triangles split where interpolated UVs would err; made by Asset.refine. It keeps the
    data that it needs, and may be used after the asset is closed."""

    def __init__(self, asset: _abi.vrtm_asset, uv_set: int, tolerance: float, max_triangles: int) -> None:
        desc = new(_abi.vrtm_refinement_desc)
        desc.uv_set = natural("uv_set", uv_set, 32)
        desc.tolerance = tolerance
        desc.max_triangles = natural("max_triangles", max_triangles, 64)
        handle = _abi.vrtm_refinement()
        check(library.vrtm_refinement_create(asset, ctypes.byref(desc), ctypes.byref(handle)))
        self._own(handle, library.vrtm_refinement_destroy)

    @property
    def info(self) -> RefinementInfo:
        """Sizes and accuracy of the refinement."""
        return told(RefinementInfo, library.vrtm_refinement_get_info, self._handle)

    def extend(self) -> None:
        """Splits further, for the asset's last result. Existing splits stay: extended for each frame of a shot,
        the refinement has one topology for all frames."""
        check(library.vrtm_refinement_extend(self._handle))

    def pattern(self) -> Pattern:
        """Recipe for the refined mesh from the mesh. It changes only when the refinement is extended."""
        info = self.info
        counts = {"vertex": info.vertices, "face": info.faces, "corner": info.corners}
        struct = new(_abi.vrtm_refinement_pattern)
        struct.vertex_count, struct.face_count, struct.corner_count = counts.values()
        arrays: dict[str, Any] = {}
        for name in Pattern.__annotations__:
            rows = counts[name.split("_")[0]]
            floats = name.endswith(("weights", "uvs"))
            columns = (2,) if name == "corner_uvs" else (3,) if name.endswith(("sources", "weights")) else ()
            shape = (rows,) if name == "face_sources" else (rows, *columns)
            arrays[name] = np.empty(shape, np.float32 if floats else np.uint32)
            setattr(struct, name, arrays[name].ctypes.data)
        check(library.vrtm_refinement_fetch_pattern(self._handle, ctypes.byref(struct)))
        return Pattern(**arrays)

    def corner_uvs(self, *, out: NDArray[np.float32] | None = None) -> NDArray[np.float32]:
        """The redirected UV of each corner in the asset's last result, (corners, 2) of float32."""
        count = self.info.corners

        def write(at: int) -> None:
            check(library.vrtm_refinement_fetch_corner_uvs(self._handle, at, count))

        return filled(out, (count, 2), write)
