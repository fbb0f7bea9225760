"""Redirected corner UVs as value clips: a small file per shape and frame, which tasks of a farm write independently,
and the metadata by which a mesh takes its values from them."""

import errno
import os
from collections.abc import Callable, Iterable

import numpy as np
from pxr import Sdf, Tf, UsdGeom, Vt

from vrtm.bake import staging
from vrtm.bake.fingerprint import Fingerprint
from vrtm.bake.layer.plan import PRIMVAR, LayerPlan
from vrtm.bake.mark import CORNERS, found_in, mark
from vrtm.bake.scene.types import Shape
from vrtm.bake.words import cause

CLIP_PRIM = "/redirected"
ATTRIBUTE = f"primvars:{PRIMVAR}"


def corner_uv_layer(shape: Shape, frame: float, uvs: np.ndarray) -> Sdf.Layer:
    """One frame's corner UVs, those of the control cage if the shape was refined. `uvs`: (corners, 2)."""
    if shape.cage_corners is not None:
        uvs = uvs[shape.cage_corners]
    layer = Sdf.Layer.CreateAnonymous()
    attribute = _declare(layer)
    layer.SetTimeSample(attribute.path, float(frame), Vt.Vec2fArray.FromNumpy(np.ascontiguousarray(uvs, np.float32)))
    layer.startTimeCode = layer.endTimeCode = float(frame)
    mark(layer, CORNERS)
    return layer


def author_clips(prim: Sdf.PrimSpec, shape: Shape, plan: LayerPlan, manifest: str) -> None:
    """Makes the primvar of a mesh take its values from the files of the frames; between them they are interpolated."""
    assert plan.corner_path is not None
    frames = sorted(plan.frames) if plan.freeze is None else [plan.freeze]
    # No default value: it would be stronger than the clips.
    attribute = Sdf.AttributeSpec(prim, ATTRIBUTE, Sdf.ValueTypeNames.TexCoord2fArray)
    attribute.SetInfo("interpolation", UsdGeom.Tokens.faceVarying)
    clips = {
        "primPath": CLIP_PRIM,
        "assetPaths": Sdf.AssetPathArray([plan.corner_path(shape.name, frame) for frame in frames]),
        "active": Vt.Vec2dArray([(plan.time_of(frame), index) for index, frame in enumerate(frames)]),
        "times": Vt.Vec2dArray([(plan.time_of(frame), frame) for frame in frames]),
        "manifestAssetPath": Sdf.AssetPath(manifest),
    }
    prim.SetInfo("clips", {"vrtm": clips})


def manifest_path(layer: str) -> str:
    """The file beside a layer that tells USD which attributes its clips have, so that it need not open all of them."""
    return f"{os.path.splitext(layer)[0]}.manifest.usda"


def write_manifest(path: str | os.PathLike[str]) -> None:
    """Writes the manifest of a layer's clips. Raises OSError."""
    layer = Sdf.Layer.CreateAnonymous()
    _declare(layer)
    mark(layer, "manifest")
    export(layer, path, Sdf.Layer.ExportToString)


def export(layer: Sdf.Layer, path: str | os.PathLike[str], told: Callable[[Sdf.Layer], str]) -> None:
    """Writes a layer, which appears under its name when it is whole: when `told` says the same of the file as of the
    layer. Raises OSError."""
    path = os.fspath(path)
    expected = told(layer)

    def body(temporary: str) -> None:
        try:
            if not layer.Export(temporary):
                raise OSError(errno.EIO, "it cannot be written", path)
        except Tf.ErrorException as error:
            # USD raises an exception of its own for what the system reports.
            raise OSError(errno.EIO, cause(error), path) from error

    def is_whole(temporary: str) -> bool:
        return found_in(temporary, lambda found: told(found) == expected, False)

    # USD's writers put a file of their own in the place of what is there: they get a name with an ending.
    staging.write(path, body, os.path.splitext(path)[1], is_whole)
    # A stage of this process may hold what was there before.
    for loaded in same_file(Sdf.Layer.GetLoadedLayers(), path):
        loaded.Reload(force=True)


def same_file(layers: Iterable[Sdf.Layer], path: str) -> list[Sdf.Layer]:
    """The layers that are one file, under whatever names they were found."""
    real = os.path.realpath(path)
    return [layer for layer in layers if layer.realPath and os.path.realpath(layer.realPath) == real]


def values_hash(layer: Sdf.Layer) -> str:
    """A hash of all values over time in a layer."""
    hashed = Fingerprint()

    def visit(path: Sdf.Path) -> None:
        for time in layer.ListTimeSamplesForPath(path):
            hashed.text(path, time).array(np.asarray(layer.QueryTimeSample(path, time)))

    layer.Traverse("/", visit)
    return hashed.hex()


def _declare(layer: Sdf.Layer) -> Sdf.AttributeSpec:
    prim = Sdf.CreatePrimInLayer(layer, CLIP_PRIM)
    return Sdf.AttributeSpec(prim, ATTRIBUTE, Sdf.ValueTypeNames.TexCoord2fArray)
