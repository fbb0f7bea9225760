"""Redirected corner UVs as value clips: a small file per shape and frame, which tasks of a farm write independently,
and the metadata by which a mesh takes its values from them."""

from __future__ import annotations

import os

import numpy as np
from pxr import Sdf, UsdGeom, Vt

from vrtm.bake.layer.plan import PRIMVAR, LayerPlan
from vrtm.bake.scene.types import Shape

CLIP_PRIM = "/redirected"
ATTRIBUTE = f"primvars:{PRIMVAR}"


def corner_uv_layer(shape: Shape, frame: float, uvs: np.ndarray) -> Sdf.Layer:
    """One frame's corner UVs, those of the control cage if the shape was refined. `uvs`: (corners, 2)."""
    uvs = np.asarray(uvs, np.float32)
    if uvs.shape != (len(shape.indices), 2):
        raise ValueError(
            f"uvs: the shape {uvs.shape} is not ({len(shape.indices)}, 2), one pair per corner of {shape.name}"
        )
    if shape.cage_corners is not None:
        uvs = uvs[shape.cage_corners]
    layer = Sdf.Layer.CreateAnonymous()
    attribute = _declare(layer)
    layer.SetTimeSample(attribute.path, float(frame), Vt.Vec2fArray.FromNumpy(np.ascontiguousarray(uvs)))
    layer.startTimeCode = layer.endTimeCode = float(frame)
    return layer


def write_corner_uvs(path: str | os.PathLike[str], shape: Shape, frame: float, uvs: np.ndarray) -> None:
    """Writes one frame's corner UVs to a USD file (.usdc, .usda or .usd), which `write_layer` joins with the others.

    The file depends on these values alone, and appears under its name when it is whole.
    """
    export(corner_uv_layer(shape, frame, uvs), path)


def author_clips(prim: Sdf.PrimSpec, shape: Shape, plan: LayerPlan, manifest: str) -> None:
    """Makes the primvar of a mesh take its values from the files of the frames; between them they are interpolated."""
    assert plan.corner_path is not None
    frames = sorted(plan.frames)
    # No default value: it would be stronger than the clips.
    attribute = Sdf.AttributeSpec(prim, ATTRIBUTE, Sdf.ValueTypeNames.TexCoord2fArray)
    attribute.SetInfo("interpolation", UsdGeom.Tokens.faceVarying)
    clips = {
        "primPath": CLIP_PRIM,
        "assetPaths": Sdf.AssetPathArray([plan.corner_path(shape.name, frame) for frame in frames]),
        "active": Vt.Vec2dArray([(frame, index) for index, frame in enumerate(frames)]),
        "times": Vt.Vec2dArray([(frame, frame) for frame in frames]),
        "manifestAssetPath": Sdf.AssetPath(manifest),
    }
    prim.SetInfo("clips", {"vrtm": clips})


def write_manifest(path: str | os.PathLike[str]) -> None:
    """Writes the file that tells USD which attributes the clips have, so that it need not open all of them."""
    layer = Sdf.Layer.CreateAnonymous()
    _declare(layer)
    export(layer, path)


def export(layer: Sdf.Layer, path: str | os.PathLike[str]) -> None:
    """Writes a layer under another name, and renames it."""
    path = os.fspath(path)
    os.makedirs(os.path.dirname(path) or ".", exist_ok=True)
    folder, name = os.path.split(path)
    part = os.path.join(folder, f".{os.getpid()}.part.{name}")
    try:
        if not layer.Export(part):
            raise OSError(f"{path}: cannot be written")
        os.replace(part, path)
        # A stage of this process may hold what was there before.
        loaded = Sdf.Layer.Find(os.path.abspath(path))
        if loaded:
            loaded.Reload(force=True)
    finally:
        if os.path.exists(part):
            os.remove(part)


def _declare(layer: Sdf.Layer) -> Sdf.AttributeSpec:
    prim = Sdf.CreatePrimInLayer(layer, CLIP_PRIM)
    return Sdf.AttributeSpec(prim, ATTRIBUTE, Sdf.ValueTypeNames.TexCoord2fArray)
