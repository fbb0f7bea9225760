"""USD: which meshes of a stage are shapes, and where they are frame by frame."""

from collections.abc import Iterator
from contextlib import suppress
from functools import cached_property
from typing import Any

from pxr import Sdf, Usd, UsdGeom

from vrtm.bake.left_out import LeftOut
from vrtm.bake.scene import usd_stage
from vrtm.bake.scene.posed import PosedSource
from vrtm.bake.scene.timing import Clock, is_between, is_whole, rate
from vrtm.bake.scene.types import SceneError, SceneOptions
from vrtm.bake.scene.usd_mesh import UsdMesh
from vrtm.bake.scene.usd_skel import Skeletons
from vrtm.bake.words import others

_FEW = 10
"""Fewer time codes per second are no frames."""

_UNREAD = ("NurbsPatch", "TetMesh")
"""Surfaces with UVs that are no meshes."""


class UsdSource(PosedSource[UsdMesh]):
    """The meshes of a stage. See `vrtm.bake.scene.Scene`."""

    def __init__(self, path: str, options: SceneOptions) -> None:
        super().__init__(path, options)
        self.stage = usd_stage.open_stage(path, options)
        for asset, why in usd_stage.unreadable(self.stage):
            # Materials are none of what is baked.
            if asset.endswith(".mtlx"):
                self.warnings.append(f"{path}: {why}")
            else:
                self.left_out.append(LeftOut(why, path))
        self.clock = usd_stage.stage_clock(self.stage, path, options.fps)
        self.codes, self.axes = self.stage.GetTimeCodesPerSecond(), usd_stage.axes_of(self.stage)
        told = f"{self.clock.frames:.6g} per second (timeCodesPerSecond {self.clock.times:g})"
        self.rate = told if options.fps else ""
        self.frames = usd_stage.stage_frames(self.stage, path, self.warnings, self.left_out, self.clock)
        self._skeletons = Skeletons(self.stage)
        self._others: list[Usd.Prim] = []
        self._take(self._chosen())
        self._check_times()

    @cached_property
    def files(self) -> tuple[str, ...]:
        return usd_stage.stage_files(self.stage)

    def close(self) -> None:
        self._meshes.clear()
        self._skeletons = None
        self.stage = None

    def _unbaked(self) -> Iterator[UsdMesh]:
        for prim in self._others:
            with suppress(SceneError):
                if usd_stage.hidden(prim, self.frames, self.clock) is None:
                    yield UsdMesh(prim, self._skeletons, self)

    def _chosen(self) -> list[list[UsdMesh]]:
        """Meshes to take; instances in the same pose stand together."""
        options = self.options
        taken: dict[Any, list[UsdMesh]] = {}
        for prim in usd_stage.shown(self.stage):
            path = str(prim.GetPath())
            if prim.GetTypeName() in _UNREAD and not self._why_not(path):
                meant = usd_stage.hidden(prim, self.frames, self.clock) is not None
                self.left_out.append(LeftOut(f"is a {prim.GetTypeName()}, which is not read", path, meant=meant))
            if not prim.IsA(UsdGeom.Mesh):
                continue
            if not self._takes(path):
                self._others.append(prim)
                continue
            reason = usd_stage.hidden(prim, self.frames, self.clock)
            if reason is not None:
                self._leave_out(path, reason, True)
                continue
            mesh = UsdMesh(prim, self._skeletons, self)
            try:
                reason = None if mesh.uv is not None else f"has no UVs{mesh.other_uvs()}"
            except SceneError:
                if not options.lenient or options.names(path) or not mesh.stays():
                    raise
                reason = "nothing deforms there, and it has several UV sets"
            if reason is not None:
                self._others.append(prim)
                self._leave_out(path, reason, not mesh.deforms)
            else:
                taken.setdefault(mesh.identity(), []).append(mesh)
        self._check_chosen(taken)
        return list(taken.values())

    def _kind(self, path: str) -> str:
        prim = self.stage.GetPrimAtPath(path) if Sdf.Path.IsValidPathString(path) else None
        return (prim.GetTypeName() or "prim without type") if prim else ""

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
        codes, fps = self.stage.GetTimeCodesPerSecond(), usd_stage.authored_rate(self.stage)
        between = {path: [frame for frame in at if not is_whole(frame)] for path, at in of.items()}
        by_codes = self.clock == Clock()
        if of and by_codes and fps and abs(codes / fps - 1) > 1e-3:
            odd = next(filter(None, between.values()), None)
            lost = f", and {len(odd)} samples between them, such as {odd[0]:.4g}, are not baked" if odd else ""
            told = f"a second has {codes:g} time codes and {fps:g} frames, but whole time codes are taken for frames"
            then = f"--fps file takes {codes / fps:.4g} time codes for each frame"
            self.warnings.append(f"{self.path}: {told}{lost}: {then}")
            return
        for path, at in of.items():
            if (by_codes and codes < _FEW and between[path]) or is_between(at):
                lost = f"{path}: {len(between[path])} of its {len(at)} samples lie between frames, such as at "
                lost += f"{between[path][0]:.6g}, and are not baked"
                if isinstance(self.options.fps, (int, float)) or self.clock.time(1) != 1:
                    # It is asked for.
                    self.rate += f"; {lost}"
                    return
                found = rate([self.clock.time(frame) / codes for frame in at])
                asked = f"--fps {found:.6g} counts frames by them" if found else "--fps counts others"
                self.warnings.append(f"{lost}: a second has {codes:g} time codes; {asked}")
                return
