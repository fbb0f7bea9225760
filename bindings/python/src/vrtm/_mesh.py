"""A mesh's arrays as the library's struct."""

from __future__ import annotations

import ctypes
from typing import Any

import numpy as np

from . import _abi
from ._arrays import Pinned, array_of
from ._library import new
from ._names import natural, value_of


def mesh(pinned: Pinned, positions: Any, indices: Any, given: dict[str, Any]) -> _abi.vrtm_mesh_desc:
    """The struct for vrtm_asset_create. `given`: the keyword arguments of Asset."""
    desc = new(_abi.vrtm_mesh_desc)
    desc.positions = ctypes.pointer(pinned.vectors("positions", positions, 3, more=1))
    corners = array_of("indices", indices)
    face_counts = given["face_counts"]
    if corners.ndim == 2 and face_counts is None and given["face_offsets"] is None:
        # One row per face.
        face_counts = np.full(corners.shape[0], corners.shape[1], np.uint32)
    _list(pinned, desc, "indices", corners, "index_count")
    _list(pinned, desc, "face_counts", face_counts, "face_count")
    _list(pinned, desc, "face_offsets", given["face_offsets"], "face_offset_count")
    _list(pinned, desc, "textured_faces", given["textured_faces"], "textured_face_count")
    if given["seams"] is not None:
        pairs = array_of("seams", given["seams"])
        if pairs.size and (pairs.ndim != 2 or pairs.shape[1] != 2):
            raise ValueError(f"seams: has the shape {pairs.shape}, not (count, 2)")
        _list(pinned, desc, "seams", pairs, "seam_count")
        desc.seam_count //= 2
    _uvs(pinned, desc, "uvs", given["uvs"], "uv_indices", given["uv_indices"])
    if uv_sets := list(given["uv_sets"]):
        sets = pinned.keep((_abi.vrtm_uv_set * len(uv_sets))())
        for k, (struct, uvs) in enumerate(zip(sets, uv_sets)):
            # A pair (uvs, uv_indices), or the UVs alone, which may be a pair (u, v).
            paired = isinstance(uvs, tuple) and len(uvs) == 2 and array_of(f"uv_sets[{k}]", uvs[0]).ndim == 2
            of_set, corners_of_set = uvs if paired else (uvs, None)
            _uvs(pinned, struct, f"uv_sets[{k}]", of_set, f"uv_sets[{k}] indices", corners_of_set)
        desc.uv_sets, desc.uv_set_count = sets, len(uv_sets)
    desc.weld = value_of("weld", given["weld"])
    desc.weld_position_tolerance = given["weld_position_tolerance"]
    desc.weld_uv_tolerance = given["weld_uv_tolerance"]
    desc.max_layers = natural("max_layers", given["max_layers"], 64)
    return desc


def _list(pinned: Pinned, struct: ctypes.Structure, name: str, value: Any, count: str, *, none: bool = False) -> None:
    if value is None:
        return
    array = pinned.indices(name, value, none=none)
    setattr(struct, name, array.ctypes.data)
    setattr(struct, count, len(array))


def _uvs(pinned: Pinned, struct: ctypes.Structure, name: str, uvs: Any, indices_name: str, indices: Any) -> None:
    if uvs is None:
        raise ValueError(f"{name}: a mesh without UVs has no texture")
    if isinstance(uvs, tuple) and len(uvs) == 2 and array_of(name, uvs[0]).ndim == 1:
        # u and v in separate arrays.
        struct.u = ctypes.pointer(pinned.vectors(f"{name}[0]", uvs[0], 1))
        struct.v = ctypes.pointer(pinned.vectors(f"{name}[1]", uvs[1], 1))
    else:
        struct.uvs = ctypes.pointer(pinned.vectors(name, uvs, 2))
    if indices is not None:
        array = pinned.indices(indices_name, indices, none=True)
        struct.uv_indices, struct.uv_index_count = array.ctypes.data, len(array)
