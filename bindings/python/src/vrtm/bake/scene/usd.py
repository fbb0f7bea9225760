"""USD: which meshes of a stage are shapes, and where they are frame by frame."""

from __future__ import annotations

from functools import cached_property
from typing import Any

import numpy as np
from pxr import Sdf, Usd, UsdGeom

from vrtm.bake.left_out import LeftOut
from vrtm.bake.scene.posed import shapes, unknown
from vrtm.bake.scene.timing import Clock, is_between, is_whole, rate
from vrtm.bake.scene.topology import matches
from vrtm.bake.scene.types import SceneError, SceneOptions, Shape
from vrtm.bake.scene.usd_mesh import UsdMesh
from vrtm.bake.scene.usd_skel import Skeletons
from vrtm.bake.scene.usd_stage import (
    authored_rate,
    hidden,
    open_stage,
    stage_clock,
    stage_files,
    stage_frames,
    unreadable,
)
from vrtm.bake.words import others

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

    def to_world(self, shape: Shape, frame: float | None) -> np.ndarray:
        """(4, 4) by which rows of the shape's positions at a frame, or of its rest, are multiplied to lie in the
        world."""
        mesh = self._meshes[shape.name]
        return mesh.to_world(mesh.rest_frame if frame is None else frame)

    def rest_frame(self, shape: Shape) -> float:
        """The frame whose transforms lie above the rest."""
        return self._meshes[shape.name].rest_frame

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
