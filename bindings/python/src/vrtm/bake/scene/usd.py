"""USD: the stage, which of its meshes are shapes, and where they are frame by frame."""

from __future__ import annotations

import math
import os
from collections.abc import Iterator, Sequence
from functools import cached_property
from typing import Any

import numpy as np

from vrtm.bake import overwrite
from vrtm.bake.left_out import LeftOut
from vrtm.bake.mark import is_marked
from vrtm.bake.scene.posed import shapes, unknown
from vrtm.bake.scene.timing import FILE, Clock, is_between, is_whole, rate
from vrtm.bake.scene.topology import matches, whole_frames
from vrtm.bake.scene.types import SceneError, SceneOptions, Shape, not_loaded
from vrtm.bake.words import cause, near, others

try:
    from pxr import Ar, Sdf, Tf, Usd, UsdGeom, UsdShade
except ImportError as error:
    raise not_loaded(error, "USD files", "usd-core", "bake", "pxr") from error

from vrtm.bake.scene.usd_mesh import UsdMesh, meters
from vrtm.bake.scene.usd_skel import Skeletons

_FEW = 10
"""Fewer time codes per second are no frames."""

_UNREAD = ("NurbsPatch", "TetMesh")
"""Surfaces with UVs that are no meshes."""


class UsdSource:
    """The meshes of a stage. See `vrtm.bake.scene.Scene`."""

    def __init__(self, path: str, options: SceneOptions) -> None:
        self.warnings: list[str] = []
        self.left_out: list[LeftOut] = []
        self.has_subframes = True
        self._path = path
        self.stage = open_stage(path, options)
        for asset, why in unreadable(self.stage):
            # Materials are none of what is baked.
            if asset.endswith(".mtlx"):
                self.warnings.append(f"{path}: {why}")
            else:
                self.left_out.append(LeftOut(why, path))
        self.clock = stage_clock(self.stage, path, options.fps)
        self.rate = (
            f"{self.clock.frames:.6g} per second (timeCodesPerSecond {self.clock.times:g})" if options.fps else ""
        )
        self.frames = stage_frames(self.stage, path, self.warnings, self.left_out, self.clock)
        self._skeletons = Skeletons(self.stage)
        groups = [(mesh, tuple(str(prim.GetPath()) for prim in of_one)) for of_one, mesh in self._chosen(options)]
        self.shapes, self._meshes = shapes(path, groups, options, self.warnings, self.left_out)
        self._check_times()

    def positions(self, shape: Shape, frame: float) -> np.ndarray:
        """(vertices, 3) of the shape at a frame."""
        return self._meshes[shape.name].positions(frame)

    @cached_property
    def files(self) -> tuple[str, ...]:
        """See `stage_files`."""
        return stage_files(self.stage)

    def close(self) -> None:
        """Lets go of the stage."""
        self._meshes.clear()
        self._skeletons = None
        self.stage = None

    def _chosen(self, options: SceneOptions) -> list[tuple[list[Any], UsdMesh]]:
        """Meshes to take; instances in the same pose stand together."""
        paths: list[str] = []
        taken: dict[Any, tuple[list[Any], UsdMesh]] = {}
        met: set[str] = set()
        if options.population_mask:
            self.left_out.append(LeftOut("what lies outside of --population-mask is not loaded", meant=True))
        for prim in Usd.PrimRange.Stage(self.stage, Usd.TraverseInstanceProxies()):
            path = str(prim.GetPath())
            if prim.GetTypeName() in _UNREAD and (not options.meshes or any(matches(p, path) for p in options.meshes)):
                meant = hidden(prim, self.frames, self.clock) is not None
                self.left_out.append(LeftOut(f"is a {prim.GetTypeName()}, which is not read", path, meant=meant))
            if not prim.IsA(UsdGeom.Mesh):
                continue
            paths.append(path)
            patterns = [pattern for pattern in options.meshes if matches(pattern, path)]
            if options.meshes and not patterns:
                self.left_out.append(LeftOut("not named by --meshes", path, meant=True))
                continue
            met.update(patterns)
            reason = hidden(prim, self.frames, self.clock)
            # A renderer does not show it either.
            meant = reason is not None
            if reason is None:
                mesh = UsdMesh(self._path, prim, self._skeletons, self.frames, self.clock, options, self.warnings)
                try:
                    reason = None if mesh.uv is not None else f"has no UVs{mesh.other_uvs()}"
                except SceneError:
                    if not options.skip_still or options.names(path) or not mesh.stays():
                        raise
                    reason = "nothing deforms there, and it has several UV sets"
                meant = not mesh.deforms
            if reason is not None:
                self.left_out.append(LeftOut(reason, path, meant=meant))
                if options.names(path):
                    raise SceneError(f"{self._path} {path}: {reason}")
                continue
            taken.setdefault(mesh.identity(), ([], mesh))[0].append(prim)
        for pattern in options.meshes:
            if pattern not in met:
                prim = self.stage.GetPrimAtPath(pattern) if Sdf.Path.IsValidPathString(pattern) else None
                if prim:
                    kind = prim.GetTypeName() or "prim without type"
                    raise SceneError(f"{self._path}: '{pattern}' is a {kind}, not a mesh")
                raise unknown(self._path, pattern, paths)
        if not taken:
            why = "; ".join(f"{entry.mesh} {entry.why}" for entry in self.left_out[:5] if entry.mesh)
            raise SceneError(f"{self._path}: no mesh to bake ({why or 'the scene has none'})")
        return list(taken.values())

    def _check_times(self) -> None:
        """Warns of samples that lie where no frame is, and of frames where no sample is."""
        samples = {shape.path: self._meshes[shape.name].samples() for shape in self.shapes}
        of = {path: list(map(self.clock.frame, times)) for path, times in samples.items() if len(times) > 1}
        first, last = self.frames[0], self.frames[-1]
        still = [path for path, at in of.items() if at[-1] <= first or at[0] >= last]
        if first == last:
            # It may have been rounded.
            still = [path for path in still if not of[path][0] - 1 < first < of[path][-1] + 1]
        if still:
            low, high = min(of[path][0] for path in still), max(of[path][-1] for path in still)
            does, its = ("does", "its") if len(still) == 1 else ("do", "their")
            within = f"frames {first}-{last}" if first < last else f"frame {first}"
            where = f"in {within} {still[0]}{others(len(still) - 1)}"
            self.warnings.append(f"{where} {does} not move: {its} samples lie at {low:.6g}-{high:.6g}")
        self._check_rate({path: at for path, at in of.items() if path not in still})

    def _check_rate(self, of: dict[str, list[float]]) -> None:
        """Warns of samples between frames, and of time codes that are no frames. `of`: frames of samples by path."""
        codes, fps = self.stage.GetTimeCodesPerSecond(), authored_rate(self.stage)
        between = {path: [frame for frame in at if not is_whole(frame)] for path, at in of.items()}
        by_codes = self.clock == Clock()
        if of and by_codes and fps and abs(codes / fps - 1) > 1e-3:
            odd = next(filter(None, between.values()), None)
            lost = f", and {len(odd)} samples between them, such as {odd[0]:.4g}, are not baked" if odd else ""
            self.warnings.append(
                f"{self._path}: a second has {codes:g} time codes and {fps:g} frames, but whole time codes are taken "
                f"for frames{lost}: --fps file takes {codes / fps:.4g} time codes for each frame"
            )
            return
        for path, at in of.items():
            if (by_codes and codes < _FEW and between[path]) or is_between(at):
                found = rate([self.clock.time(frame) / codes for frame in at])
                asked = f"--fps {found:.6g} counts frames by them" if found else "--fps counts others"
                self.warnings.append(
                    f"{path}: {len(between[path])} of its {len(at)} samples lie between frames, such as at "
                    f"{between[path][0]:.6g}, and are not baked: a second has {codes:g} time codes; {asked}"
                )
                return


def open_stage(path: str, options: SceneOptions) -> Usd.Stage:
    """Opens a stage, with variants selected in its session layer. Raises SceneError."""
    try:
        if options.population_mask:
            stage = Usd.Stage.OpenMasked(path, Usd.StagePopulationMask(list(options.population_mask)))
            stage.ExpandPopulationMask()
        else:
            stage = Usd.Stage.Open(path)
    except Tf.ErrorException as error:
        raise SceneError(f"{path}: {cause(error)}") from error
    if stage is None:
        raise SceneError(f"{path}: cannot be opened as a USD stage")
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
            if variant not in chosen.GetVariantNames():
                names = chosen.GetVariantNames()
                raise SceneError(
                    f"{path} {prim_path}: no variant '{variant}' of '{name}' among {names}{near(variant, names)}"
                )
            chosen.SetVariantSelection(variant)
    return stage


def unreadable(stage: Usd.Stage) -> list[tuple[str, str]]:
    """What the stage's layers refer to and this build of USD cannot open, each with a sentence's end."""
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
    layers = [layer for layer in stage.GetUsedLayers() if layer.realPath]
    found = {layer.realPath for layer in layers}
    ours = {layer.identifier for layer in layers if is_marked(layer)}
    for prim in Usd.PrimRange.Stage(stage, Usd.TraverseInstanceProxies()):
        for name in prim.GetMetadata("clips") or ():
            found.update(asset.resolvedPath for asset in Usd.ClipsAPI(prim).ComputeClipAssetPaths(name))
        if prim.IsA(UsdShade.Shader) or prim.IsA(UsdShade.NodeGraph):
            for attribute in prim.GetAuthoredAttributes():
                if attribute.GetTypeName() == Sdf.ValueTypeNames.Asset:
                    found.update(_assets(attribute, ours))
    files = sorted({Ar.SplitPackageRelativePathOuter(path)[0] for path in found})
    return tuple(path for path in files if os.path.isfile(path) and not overwrite.is_ours(path))


def _assets(attribute: Usd.Attribute, ours: set[str]) -> Iterator[str]:
    """The files that an attribute names at any time, those of all tiles where it names a pattern. `ours`: layers of
    earlier bakes, which name files of their own in every frame."""
    for time in (Usd.TimeCode.Default(), *attribute.GetTimeSamples()):
        layers = [spec.layer for spec in attribute.GetPropertyStack(time)]
        asset = attribute.Get(time) if layers and layers[0].identifier not in ours else None
        if not asset:
            continue
        if UsdShade.UdimUtils.IsUdimIdentifier(asset.path):
            yield from (path for path, _ in UsdShade.UdimUtils.ResolveUdimTilePaths(asset.path, layers[0]))
        elif asset.resolvedPath:
            yield asset.resolvedPath


def authored_rate(stage: Usd.Stage) -> float | None:
    """framesPerSecond, where a stage says it."""
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
    """Of all time samples of meshes and animations."""
    prims = Usd.PrimRange.Stage(stage, Usd.TraverseInstanceProxies())
    found = (prim for prim in prims if prim.IsA(UsdGeom.PointBased) or prim.GetTypeName() == "SkelAnimation")
    return sorted(
        {t for prim in found for attribute in prim.GetAuthoredAttributes() for t in attribute.GetTimeSamples()}
    )


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
    slack = 0.0 if clock == Clock() else 1e-3
    return whole_frames(clock.frame(first), clock.frame(last), where, warnings, left_out, slack)


def meshes_of(stage: Usd.Stage) -> Iterator[Usd.Prim]:
    """All meshes that are active, loaded and defined, those of instances as proxies."""
    return (prim for prim in Usd.PrimRange.Stage(stage, Usd.TraverseInstanceProxies()) if prim.IsA(UsdGeom.Mesh))


def hidden(prim: Usd.Prim, frames: Sequence[int], clock: Clock) -> str | None:
    """Why a renderer does not show a mesh, as the end of a sentence; None if it shows it."""
    imageable = UsdGeom.Imageable(prim)
    purpose = imageable.ComputePurpose()
    if purpose in (UsdGeom.Tokens.guide, UsdGeom.Tokens.proxy):
        return f"has the purpose '{purpose}'"
    codes = map(clock.time, _turns(prim, frames, clock))
    if all(imageable.ComputeVisibility(code) == UsdGeom.Tokens.invisible for code in codes):
        return "is invisible in all frames"
    return None


def _turns(prim: Usd.Prim, frames: Sequence[int], clock: Clock) -> set[int]:
    """The frames from which a mesh may be visible or not: there are few of them, however many frames there are."""
    turns = {frames[0]}
    while prim:
        visibility = prim.GetAttribute(UsdGeom.Tokens.visibility)
        times = visibility.GetTimeSamples() if visibility else ()
        turns.update(math.ceil(min(max(clock.frame(time), frames[0]), frames[-1])) for time in times)
        prim = prim.GetParent()
    return turns


def meshes_at_first_frame(
    file: str,
) -> tuple[list[tuple[str, np.ndarray, np.ndarray, np.ndarray]], dict[str, float | None]]:
    """(path, positions, face counts, indices) of all meshes of a file, at rest: skinned ones in their bind pose,
    others at their first time sample; and by their paths how many meters their units are. Raises SceneError."""
    stage = open_stage(file, SceneOptions())
    found, units = [], {}
    for prim in meshes_of(stage):
        mesh = UsdGeom.Mesh(prim)
        time = Usd.TimeCode.EarliestTime()
        arrays = [mesh.GetPointsAttr(), mesh.GetFaceVertexCountsAttr(), mesh.GetFaceVertexIndicesAttr()]
        points, counts, indices = (np.array(attribute.Get(time) or ()) for attribute in arrays)
        path = str(prim.GetPath())
        units[path] = meters(mesh.GetPointsAttr(), time)
        found.append((path, points.reshape(-1, 3), counts.astype(np.int32), indices.astype(np.int32)))
    return found, units
