"""USD stages: opened, their files, frames and units, and which of their meshes a renderer shows; messages of USD."""

import contextlib
import math
import os
import re
from collections.abc import Iterable, Iterator, Sequence

import numpy as np
from pxr import Ar, Sdf, Tf, Usd, UsdGeom, UsdShade, UsdUtils

from vrtm.bake import overwrite
from vrtm.bake.left_out import LeftOut
from vrtm.bake.mark import is_carried, is_marked
from vrtm.bake.scene.axes import Axes
from vrtm.bake.scene.timing import FILE, Clock, rate
from vrtm.bake.scene.topology import whole_frames
from vrtm.bake.scene.types import SceneError, SceneOptions
from vrtm.bake.words import cause, near

_IN = re.compile(r"(?:In <([^>]*)>: )?(.*)", re.DOTALL)
_STAGE = re.compile(r"\s*\(\w+ stage .*\)$", re.DOTALL)
ANY = Usd.PrimIsActive & Usd.PrimIsLoaded
"""Prims below an `over` or a `class`, too."""
_MISSING = ("_ReportErrors", "_GetLayerForClip")
"""USD's functions that tell of what a stage lacks."""
_NO_FORMAT = "Cannot determine file format"
"""The reader says in better words which kinds of files USD does not open."""


def open_stage(path: str, options: SceneOptions) -> Usd.Stage:
    """Opens a stage, with variants selected in its session layer. Raises SceneError."""
    try:
        stage = Usd.Stage.Open(path)
    except Tf.ErrorException as error:
        raise SceneError(f"{path}: {cause(error)}") from error
    if stage is None:
        raise SceneError(f"{path}: cannot be opened as a USD stage")
    for layer in filter(is_carried, stage.GetUsedLayers()):
        # Prims that an earlier bake moved are read at rest.
        stage.MuteLayer(layer.identifier)
    with Usd.EditContext(stage, stage.GetSessionLayer()):
        for prim_path, name, variant in options.variants:
            prim = stage.GetPrimAtPath(prim_path) if Sdf.Path.IsValidPathString(prim_path) else None
            if not prim:
                raise SceneError(f"{path}: variant {name}={variant}: there is no prim {prim_path}")
            sets = prim.GetVariantSets()
            if not sets.HasVariantSet(name):
                other = near(name, sets.GetNames())
                raise SceneError(f"{path} {prim_path}: no variant set '{name}' among {sets.GetNames()}{other}")
            chosen = sets.GetVariantSet(name)
            names = chosen.GetVariantNames()
            if variant not in names:
                other = near(variant, names)
                raise SceneError(f"{path} {prim_path}: no variant '{variant}' of '{name}' among {names}{other}")
            chosen.SetVariantSelection(variant)
    return stage


def shown(stage: Usd.Stage) -> Iterable[Usd.Prim]:
    """The prims of a stage, those in instances included, and the prototypes of its point instancers that lie below an
    `over` or a `class`: they are then no prims of their own, but renderers draw their instances."""
    found = dict.fromkeys(Usd.PrimRange.Stage(stage, Usd.TraverseInstanceProxies()))
    instancers = [prim for prim in found if prim.IsA(UsdGeom.PointInstancer)]
    for instancer in instancers:
        for path in UsdGeom.PointInstancer(instancer).GetPrototypesRel().GetForwardedTargets():
            prototype = stage.GetPrimAtPath(path)
            if prototype and prototype not in found:
                below = dict.fromkeys(Usd.PrimRange(prototype, Usd.TraverseInstanceProxies(ANY)))
                instancers += (prim for prim in below if prim.IsA(UsdGeom.PointInstancer))
                found |= below
    return found


def unreadable(stage: Usd.Stage) -> list[tuple[str, str]]:
    """Files that the stage's layers refer to and this build of USD cannot open, each with a sentence's end."""
    found = {}
    for layer in stage.GetUsedLayers():
        for asset in layer.GetCompositionAssetDependencies():
            kind = Sdf.FileFormat.GetFileExtension(asset)
            if kind and not Sdf.FileFormat.FindByExtension(kind):
                reason = f"this build of USD ({'.'.join(map(str, Usd.GetVersion()[1:]))}) opens no .{kind} files"
                found[asset] = f"what it takes from {asset} is missing: {reason}"
    return sorted(found.items())


def stage_files(stage: Usd.Stage) -> tuple[str, ...]:
    """The files of all layers and value clips that a stage uses, and the textures that its shaders and materials name.
    Those that vrtm wrote are left out: a shot may have the layer of an earlier bake below it, which the next one
    replaces."""
    found = {layer.realPath for layer in stage.GetUsedLayers() if layer.realPath}
    ours = marked(stage)
    for prim in shown(stage):
        for name in prim.GetMetadata("clips") or ():
            found.update(asset.resolvedPath for asset in Usd.ClipsAPI(prim).ComputeClipAssetPaths(name))
        if prim.IsA(UsdShade.Shader) or prim.IsA(UsdShade.NodeGraph):
            for attribute in prim.GetAuthoredAttributes():
                if attribute.GetTypeName() == Sdf.ValueTypeNames.Asset:
                    found.update(assets(attribute, ours))
    files = sorted({Ar.SplitPackageRelativePathOuter(path)[0] for path in found})
    return tuple(path for path in files if os.path.isfile(path) and not overwrite.is_ours(path))


def marked(stage: Usd.Stage) -> set[str]:
    """The layers of earlier bakes, which name files of their own in every frame."""
    return {layer.identifier for layer in stage.GetUsedLayers() if layer.realPath and is_marked(layer)}


def assets(attribute: Usd.Attribute, ours: set[str]) -> Iterator[str]:
    """The files that an attribute names at any time, those of all tiles where it names a pattern, but for what `ours`,
    layers, name."""
    for time in (Usd.TimeCode.Default(), *attribute.GetTimeSamples()):
        layers = [spec.layer for spec in attribute.GetPropertyStack(time)]
        asset = attribute.Get(time) if layers and layers[0].identifier not in ours else None
        yield from resolved(asset, layers[0]) if asset else ()


def resolved(asset: Sdf.AssetPath, layer: Sdf.Layer) -> list[str]:
    """The files that a layer names: those of all tiles where it names a pattern, none that are not there."""
    if UsdShade.UdimUtils.IsUdimIdentifier(asset.path):
        return [path for path, _ in UsdShade.UdimUtils.ResolveUdimTilePaths(asset.path, layer)]
    return [asset.resolvedPath] if asset.resolvedPath else []


def axes_of(stage: Usd.Stage) -> Axes:
    """The axes of a stage, as far as its root layer says them."""
    root = stage.GetPseudoRoot()
    up, meters = (
        root.GetMetadata(name) if root.HasAuthoredMetadata(name) else None
        for name in (UsdGeom.Tokens.upAxis, UsdGeom.Tokens.metersPerUnit)
    )
    return Axes(up and str(up), meters)


def instances_above(stage: Usd.Stage, path: Sdf.Path | str) -> list[Sdf.Path]:
    """The instances at and above a path, from above: layers change what is inside once they are plain prims."""
    found = {prefix: stage.GetPrimAtPath(prefix) for prefix in Sdf.Path(path).GetPrefixes()}
    return [prefix for prefix, prim in found.items() if prim and prim.IsInstanceable()]


def authored_rate(stage: Usd.Stage) -> float | None:
    return stage.GetFramesPerSecond() if stage.HasAuthoredMetadata("framesPerSecond") else None


def stage_clock(stage: Usd.Stage, where: str, fps: float | str | None) -> Clock:
    """The clock of a stage. Raises SceneError for rates that cannot be."""
    if fps is None:
        return Clock()
    codes = stage.GetTimeCodesPerSecond()
    if fps == FILE:
        fps = authored_rate(stage)
    if fps is None:
        fps = (rate([time / codes for time in sample_times(stage)]) if codes > 0 else None) or codes
    if not (0 < codes < math.inf and 0 < fps < math.inf):
        raise SceneError(f"{where}: --fps cannot count {fps:g} frames and {codes:g} time codes per second")
    return Clock(codes, fps)


def sample_times(stage: Usd.Stage) -> list[float]:
    """Times of all samples of meshes and animations."""
    found = (prim for prim in shown(stage) if prim.IsA(UsdGeom.PointBased) or prim.GetTypeName() == "SkelAnimation")
    return sorted({t for prim in found for of in prim.GetAuthoredAttributes() for t in of.GetTimeSamples()})


def stage_frames(
    stage: Usd.Stage, where: str, warnings: list[str], left_out: list[LeftOut], clock: Clock
) -> Sequence[int]:
    """Whole frames from the stage's start to its end; of a stage without these, or with a start after its end, of
    all time samples of its meshes and animations; (1,) where nothing moves."""
    first, last = stage.GetStartTimeCode(), stage.GetEndTimeCode()
    backwards = first > last
    if backwards:
        warnings.append(f"{where}: its start time code, {first:g}, is after its end, {last:g}: its time samples count")
    if backwards or not stage.HasAuthoredTimeCodeRange():
        times = sample_times(stage)
        first, last = (times[0], times[-1]) if times else (clock.time(1),) * 2
    return whole_frames(clock.frame(first), clock.frame(last), where, warnings, left_out)


def hidden(prim: Usd.Prim, frames: Sequence[int], clock: Clock) -> str | None:
    """The reason that a renderer does not show a mesh, as the end of a sentence; None if it shows it."""
    imageable = UsdGeom.Imageable(prim)
    purpose = imageable.ComputePurpose()
    if purpose in (UsdGeom.Tokens.guide, UsdGeom.Tokens.proxy):
        return f"has the purpose '{purpose}'"
    # The frames from which it may be visible or not: there are few of them, however many frames there are.
    turns = {frames[0]}
    while prim:
        visibility = prim.GetAttribute(UsdGeom.Tokens.visibility)
        times = visibility.GetTimeSamples() if visibility else ()
        turns.update(math.ceil(min(max(clock.frame(time), frames[0]), frames[-1])) for time in times)
        prim = prim.GetParent()
    codes = map(clock.time, turns)
    every = all(imageable.ComputeVisibility(code) == UsdGeom.Tokens.invisible for code in codes)
    return "is invisible in all frames" if every else None


def meshes_at_first_frame(
    file: str,
) -> tuple[list[tuple[str, np.ndarray, np.ndarray, np.ndarray]], dict[str, float | None]]:
    """(path, positions, face counts, indices) of all meshes of a file, at rest: skinned ones in their bind pose,
    others at their first time sample; and by their paths how many meters their units are. Raises SceneError."""
    stage = open_stage(file, SceneOptions())
    found, units = [], {}
    for prim in filter(UsdGeom.Mesh, shown(stage)):
        mesh = UsdGeom.Mesh(prim)
        time = Usd.TimeCode.EarliestTime()
        arrays = [mesh.GetPointsAttr(), mesh.GetFaceVertexCountsAttr(), mesh.GetFaceVertexIndicesAttr()]
        points, counts, indices = (np.array(attribute.Get(time) or ()) for attribute in arrays)
        path = str(prim.GetPath())
        units[path] = meters(mesh.GetPointsAttr(), time)
        found.append((path, points.reshape(-1, 3), counts.astype(np.int32), indices.astype(np.int32)))
    return found, units


def meters(attribute: Usd.Attribute, time: Usd.TimeCode) -> float | None:
    """Meters of the unit of an attribute: as its layer says, else the stage's own; None if neither says it."""
    layers = [spec.layer for spec in attribute.GetPropertyStack(time)[:1]]
    for layer in (*layers, attribute.GetStage().GetRootLayer()):
        if layer.pseudoRoot.HasInfo(UsdGeom.Tokens.metersPerUnit):
            return float(layer.pseudoRoot.GetInfo(UsdGeom.Tokens.metersPerUnit))
    return None


@contextlib.contextmanager
def collected(said: list[LeftOut | str]) -> Iterator[None]:
    """Adds USD's messages in the block, in all threads, to `said`: missing references, layers and clips, and warnings.
    They would otherwise go to stderr in USD's own words, or get lost."""
    delegate = UsdUtils.CoalescingDiagnosticDelegate()
    try:
        yield
    finally:
        for found in delegate.TakeUncoalescedDiagnostics():
            entry = _entry(found.commentary, found.sourceFunction)
            if entry not in said and _NO_FORMAT not in found.commentary:
                said.append(entry)


def _entry(text: str, function: str) -> LeftOut | str:
    place, what = _IN.fullmatch(_STAGE.sub("", text)).groups()
    what = f"USD: {' '.join(what.split())}"
    if function.endswith(_MISSING):
        return LeftOut(what, place or "")
    return f"{place}: {what}" if place else what
