"""The layer as a program finds it that opens the shot with it, compared with its plan."""

import os
from collections.abc import Iterator, Mapping

import numpy as np
from pxr import Sdf, Usd, UsdGeom

from vrtm.bake.frames import Frame
from vrtm.bake.layer.clips import ATTRIBUTE, CLIP_PRIM
from vrtm.bake.layer.plan import LayerPlan
from vrtm.bake.layer.write import STAGE_FIELDS, named_files, tell
from vrtm.bake.mark import found_in
from vrtm.bake.scene import Scene, Shape
from vrtm.bake.scene.usd_stage import resolved

Files = Mapping[str, tuple[Frame, list[str]]]
"""The frame and the files of each name that a layer has."""


def differences(path: str, root: str | None, scene: Scene, plan: LayerPlan, files: Files) -> Iterator[str]:
    """The differences of a written layer over its shot from a plan, in the first frame and in the last one. `root`: the
    file that has both; `files`: those behind the plan's names."""
    layer, shot = (Sdf.Layer.FindOrOpen(os.path.abspath(file)) for file in (path, scene.path))
    top = Sdf.Layer.FindOrOpen(os.path.abspath(root)) if root else Sdf.Layer.CreateAnonymous(".usda")
    if not root:
        tell(shot, top)
        top.subLayerPaths = [layer.identifier, shot.identifier]
    stage = Usd.Stage.Open(top)
    for of in (layer, top):
        for name in filter(shot.pseudoRoot.HasInfo, STAGE_FIELDS):
            own, wanted = (its.pseudoRoot.GetInfo(name) for its in (of, shot))
            if own != wanted:
                yield f"{name} is {own}, and {wanted} in the shot"
    frames = {min(plan.frames), max(plan.frames)}
    for frame in sorted(frames):
        code, meant = Usd.TimeCode(plan.time_of(frame)), frame if plan.freeze is None else plan.freeze
        yield from (f"{found}, frame {frame}" for found in _wrong_files(layer, stage, code, meant, files))
        for shape in map(scene.shape, plan.shapes if plan.corner_path is not None else ()):
            yield from (f"{found}, frame {frame}" for found in _wrong_uvs(stage, code, meant, shape, plan, files))


def _wrong_files(layer: Sdf.Layer, stage: Usd.Stage, code: Usd.TimeCode, frame: Frame, files: Files) -> Iterator[str]:
    """Attributes of a layer by which a renderer does not find the files of a frame."""
    for path, named in named_files(layer).items():
        if files.keys().isdisjoint(named):
            continue
        attribute = stage.GetAttributeAtPath(path)
        if not attribute or attribute.GetPrim().IsInstanceProxy():
            yield f"{path}: it is inside an instance, where a layer changes nothing"
            continue
        asset = attribute.Get(code)
        own, wanted = files.get(asset.path if asset else "", (None, []))
        if own != frame:
            yield f"{path}: names {asset.path if asset else 'no file'}, not that of frame {frame}"
            continue
        there = resolved(asset, attribute.GetPropertyStack(code)[0].layer)
        lacking = {os.path.realpath(file) for file in wanted} - {*map(os.path.realpath, there)}
        if lacking:
            yield f"{path}: {asset.path} does not lead to {min(lacking)}"


def _wrong_uvs(
    stage: Usd.Stage, code: Usd.TimeCode, frame: Frame, shape: Shape, plan: LayerPlan, files: Files
) -> Iterator[str]:
    """Meshes whose redirected UVs are not those of a frame's file."""
    assert plan.corner_path is not None
    _, (file,) = files[plan.corner_path(shape.name, frame)]
    at = Sdf.Path(CLIP_PRIM).AppendProperty(ATTRIBUTE)
    wanted = found_in(file, lambda layer: np.array(layer.QueryTimeSample(at, float(frame))), None)
    for path in shape.instances:
        prim = stage.GetPrimAtPath(path)
        value = np.array(prim.GetAttribute(ATTRIBUTE).Get(code) or ())
        corners = sum(UsdGeom.Mesh(prim).GetFaceVertexCountsAttr().Get(code))
        if len(value) != corners:
            yield f"{path}.{ATTRIBUTE}: has {len(value)} UVs for {corners} corners"
        elif not np.array_equal(value, wanted):
            yield f"{path}.{ATTRIBUTE}: its UVs are not those of {file}"
