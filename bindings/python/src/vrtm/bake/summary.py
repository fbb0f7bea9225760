"""What a bake comes to, mesh by mesh: frames, strain, files and time."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field

from vrtm.bake import frames, gain
from vrtm.bake.frames import Frame
from vrtm.bake.mesh_work import FrameResult, MeshWork
from vrtm.bake.rows import Strain, mean
from vrtm.bake.words import counted

_NONE = 1e-5
"""RMS strain that rounding makes where there is none."""


@dataclass
class Summary:
    """All frames of a mesh."""

    path: str
    frames: list[Frame] = field(default_factory=list)
    measured: dict[Frame, Strain] = field(default_factory=dict)
    """The frames whose strain is known."""
    fixed: float = 0.0
    """Share of the rigid texels."""
    rigid: int = 0
    """How many of these there are."""
    written: int = 0
    skipped: int = 0
    seconds: float = 0.0
    """Of all processes together."""

    def line(self) -> str:
        """A sentence."""
        count = f"{counted(len(self.frames), 'frame')} ({frames.text(self.frames)})"
        done = f"{counted(self.written, 'file')} written" + (f", {self.skipped} up to date" if self.skipped else "")
        parts = [
            count,
            self._strain(),
            f"{self.fixed:.1%} fixed" if self.rigid else "",
            done,
            f"{self.seconds:.1f} s",
        ]
        return f"{self.path}: {', '.join(filter(None, parts))}"

    def _strain(self) -> str:
        if not self.rigid:
            return gain.NOTHING
        if not self.measured:
            return "strain not measured (--measure)"
        total, worst = mean(self.measured.values()), self._worst
        if total.before < _NONE:
            return gain.RIGIDLY
        change = f"strain {total.before:.3g} -> {total.after:.3g} RMS"
        if len(self.frames) == 1:
            return change
        part = "" if len(self.measured) == len(self.frames) else f" of {len(self.measured)} measured"
        at = self.measured[worst]
        return f"{change} (frame {worst}, the worst{part}: {at.before:.3g} -> {at.after:.3g})"

    @property
    def _worst(self) -> Frame:
        return max(self.measured, key=lambda frame: (self.measured[frame].after, self.measured[frame].before))

    def row(self) -> dict:
        """The same for the report."""
        strain = None
        if self.measured:
            total, at = mean(self.measured.values()), self.measured[self._worst]
            worst = {"frame": self._worst, "before": at.before, "after": at.after}
            strain = {"frames": sorted(self.measured), "before": total.before, "after": total.after, "worst": worst}
        done = {"written": self.written, "skipped": self.skipped, "seconds": round(self.seconds, 3)}
        return {"frames": len(self.frames), "strain": strain, "fixed": self.fixed, **done}


def summaries(meshes: dict[str, MeshWork], results: Sequence[FrameResult]) -> Iterator[tuple[str, Summary]]:
    """Of each mesh that has a frame which was baked, by its name."""
    for name, mesh in meshes.items():
        found = Summary(mesh.shape.path)
        tiles: dict[tuple, dict] = {}
        for result in sorted((r for r in results if r.mesh == name and r.tiles), key=lambda r: r.frame):
            found.frames.append(result.frame)
            found.written += result.count("written")
            found.skipped += result.count("skipped")
            found.seconds += result.milliseconds / 1e3
            if result.strain is not None and math.isfinite(result.strain.before):
                found.measured[result.frame] = result.strain
            tiles |= {(tile["udim"], tile["layer"], tile.get("subset")): tile["rigid"] for tile in result.tiles}
        found.rigid = sum(tile["texels"] for tile in tiles.values())
        found.fixed = sum(tile["texels"] * tile["fixed"] for tile in tiles.values()) / max(found.rigid, 1)
        if found.frames:
            yield name, found
