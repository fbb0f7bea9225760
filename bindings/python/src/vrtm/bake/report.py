"""The JSON report of a bake; docs/farm.md describes it."""

import dataclasses
import json
import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field

import vrtm
from vrtm.bake import frames, gain, left_out, staging
from vrtm.bake.failure import DONE, INPUT, TOLERANCE, Failure, unwritable
from vrtm.bake.frames import Frame
from vrtm.bake.left_out import LeftOut
from vrtm.bake.mesh_work import FrameResult, MeshWork
from vrtm.bake.rows import UNMEASURED, Strain, mean, tile_name
from vrtm.bake.settings import EACH, Settings
from vrtm.bake.words import counted
from vrtm.bake.work import Work

MOSTLY = 0.5
"""If a larger share of a tile's rigid texels is fixed, its strain says little about what was baked."""
_NONE = 1e-5
"""RMS strain that rounding makes where there is none."""


@dataclass
class Summary:
    """All frames of a mesh."""

    path: str
    frames: list[Frame] = field(default_factory=list)
    measured: dict[Frame, Strain] = field(default_factory=dict)
    """The frames whose strain is known."""
    features: dict[Frame, list[dict]] = field(default_factory=dict)
    """Of these frames, the painted features of each tile."""
    fixed: float = 0.0
    """Share of the rigid texels."""
    rigid: int = 0
    """Number of rigid texels."""
    written: int = 0
    skipped: int = 0
    seconds: float = 0.0
    """Of all processes together."""

    def line(self) -> str:
        count = f"{counted(len(self.frames), 'frame')} ({frames.text(self.frames)})"
        done = f"{counted(self.written, 'file')} written" + (f", {self.skipped} up to date" if self.skipped else "")
        parts = [count, self._strain(), self._worse(), f"{self.fixed:.1%} fixed" if self.rigid else "", done]
        return f"{self.path}: {', '.join(filter(None, parts))}, {self.seconds:.1f} s"

    def _strain(self) -> str:
        if not self.measured:
            return "strain not measured (--measure)"
        total, worst = mean(self.measured.values()), self._worst
        if not total.segments:
            return f"strain not measured: {UNMEASURED}" if total.unmeasured else gain.NOTHING
        if max(total.before, total.after) < _NONE:
            return f"no strain in {counted(len(self.measured), 'measured frame')}"
        change = f"strain {total.before:.3g} -> {total.after:.3g} RMS"
        if len(self.frames) == 1:
            return change
        part = "" if len(self.measured) == len(self.frames) else f" of {len(self.measured)} measured"
        at = self.measured[worst]
        return f"{change} (frame {worst}, the worst{part}: {at.before:.3g} -> {at.after:.3g})"

    @property
    def _worst(self) -> Frame:
        return max(self.measured, key=lambda frame: (self.measured[frame].after, self.measured[frame].before))

    def counted(self) -> dict | None:
        """The frame in which most features are worse, and the worst feature of all frames; None if not measured."""
        if not self.features:
            return None
        worse = {frame: sum(tile["worse"] for tile in tiles) for frame, tiles in self.features.items()}
        frame = max(worse, key=lambda frame: worse[frame])
        worst_of = ((frame, of) for frame, tiles in self.features.items() for tile in tiles for of in tile["worst"])
        found = [{"frame": frame} | feature for frame, feature in worst_of]
        worst = max(found, key=lambda feature: feature["after"] - feature["before"], default=None)
        count = sum(tile["count"] for tile in self.features[frame])
        return {"count": count, "worse": worse[frame], "frame": frame, "worst": worst}

    def _worse(self) -> str:
        told = self.counted()
        if not told or not told["worse"]:
            return ""
        worst, verb = told["worst"], "is" if told["worse"] == 1 else "are"
        return (
            f"{told['worse']} of {counted(told['count'], 'feature')} {verb} worse than without vrtm in frame "
            f"{told['frame']}: {_place(worst)}, frame {worst['frame']}"
        )

    def row(self) -> dict:
        strain = None
        if self.measured:
            total, at = mean(self.measured.values()), self.measured[self._worst]
            worst = {"frame": self._worst, "before": at.before, "after": at.after}
            strain = {"frames": sorted(self.measured), "before": total.before, "after": total.after, "worst": worst}
        done = {"written": self.written, "skipped": self.skipped, "seconds": round(self.seconds, 3)}
        return {"frames": len(self.frames), "strain": strain, "features": self.counted(), "fixed": self.fixed, **done}


def _place(worst: dict) -> str:
    """The place and the errors of the worst feature."""
    return f"the worst at UV {worst['u']:.4g}, {worst['v']:.4g}: {worst['before']:.3g} -> {worst['after']:.3g} RMS"


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
                found.features |= {result.frame: result.features} if result.features else {}
            tiles |= {(tile["udim"], tile["layer"], tile.get("subset")): tile["rigid"] for tile in result.tiles}
        found.rigid = sum(tile["texels"] for tile in tiles.values())
        found.fixed = sum(tile["texels"] * tile["fixed"] for tile in tiles.values()) / max(found.rigid, 1)
        if found.frames:
            yield name, found


def shares(tile: dict) -> str:
    """Shares of a tile's texels that are fixed and that may move, as a sentence."""
    rigid = tile["rigid"]
    told = f"{rigid['fixed']:.1%} of the rigid texels are fixed, {rigid['overlapped']:.1%} overlapped, "
    told += f"{rigid['movable']:.1%} may move; "
    covered = f"{tile['overlap']:.1%} of the covered ones are overlapped, {tile['movable']:.1%} of the grid may move"
    if rigid["texels"]:
        return told + covered
    grey = f"{tile['fixed']:.1%} of the rigid segments are fixed; " if tile["fixed"] else ""
    return grey + covered.replace("ones", "texels")


def advice(settings: Settings, tile: dict) -> str:
    """The cause that fixes most of a tile's fixed texels, and the remedy."""
    rigid = tile["rigid"]
    if settings.overlap != "first" and rigid["overlapped"] > rigid["fixed"] / 2:
        if settings.overlap != EACH:
            return f"UVs overlap: with --overlap {EACH} charts that lie over one another each keep their features"
        if tile["layers"] >= settings.layers:
            return f"more than {settings.layers} charts lie over one another: --max-layers allows more layers"
        return "charts lie over themselves, which no option helps against: their UVs have to be laid out anew"
    causes = []
    if settings.seams != "continue":
        causes.append("features lie on the borders of charts: --seams continue moves them")
    if settings.mask or settings.options.mask_primvar:
        causes.append("the mask is dark there: a lighter one lets them move")
    return ", or ".join(causes) or "features lie on borders beyond which the surface ends, or in narrow gutters"


def document(
    work: Work,
    results: Sequence[FrameResult],
    seconds: float,
    failure: Failure | None,
    warnings: Sequence[str],
    missing: Sequence[LeftOut],
    carried: Sequence[dict] = (),
) -> dict:
    """All figures, frames and meshes in order. `missing`: what is not baked; `carried`: what each mesh carries."""
    settings = work.settings
    info = work.device.info
    baked = dict(summaries(work.meshes, results))
    return {
        "program": {"name": "vrtm bake", "version": vrtm.version()},
        "scene": settings.scene,
        "out": settings.out,
        "layer": settings.layer,
        "settings": dataclasses.asdict(settings),
        "device": {"backend": info.backend, "name": info.name, "reason": info.reason},
        "meshes": [
            {
                "name": mesh.shape.name,
                "path": mesh.shape.path,
                "tiles": list(dict.fromkeys(tile.udim for tile in mesh.tiles)),
                "borders": dataclasses.asdict(mesh.borders),
                **(baked[name].row() if name in baked else {}),
            }
            for name, mesh in work.meshes.items()
        ],
        "frames": [
            {
                "frame": result.frame,
                "mesh": result.mesh,
                "milliseconds": round(result.milliseconds, 3),
                "tiles": result.tiles,
                "files": result.files,
                "warnings": result.warnings,
            }
            for result in sorted(results, key=lambda result: (result.frame, result.mesh))
        ],
        "carried": list(carried),
        "not_baked": [entry.row() for entry in missing],
        "written": sum(result.count("written") for result in results),
        "skipped": sum(result.count("skipped") for result in results),
        "seconds": round(seconds, 3),
        "warnings": list(warnings),
        "exit_code": failure.code if failure else DONE,
        "message": failure.message if failure else "done",
    }


def write(path: str, content: dict) -> None:
    """Writes it whole. Raises Failure."""
    try:
        staging.write_bytes(path, (json.dumps(content, indent=1) + "\n").encode())
    except OSError as error:
        raise unwritable(f"--report {path}", error) from error


def strict(settings: Settings, missing: Sequence[LeftOut]) -> Failure | None:
    """The failure that --strict makes of all that is not baked."""
    wrong = left_out.lines(left_out.unmeant(missing)) if settings.strict else []
    more = f" (and {len(wrong) - 1} more, named above)" if len(wrong) > 1 else ""
    return Failure(INPUT, f"--strict: {wrong[0]}{more}") if wrong else None


def nothing(results: Sequence[FrameResult]) -> Failure | None:
    """The failure of a bake of which no pose could be used."""
    wrong = [result.left_out[0] for result in results if result.left_out and not result.tiles]
    return Failure(INPUT, wrong[0].line()) if wrong and len(wrong) == len(results) else None


def tolerance(work: Work, results: Sequence[FrameResult]) -> Failure | None:
    """The failure of the worst tile, if a limit is exceeded, or could not be compared with what it limits."""
    settings = work.settings
    # In this order, not in that in which they were done: of equals the first one is told.
    ordered = sorted(results, key=lambda result: (result.frame, result.mesh))
    rows = [(result, tile) for result in ordered for tile in result.tiles]
    fixed = [(r, t) for r, t in rows if t["fixed"] > MOSTLY]
    if settings.max_strain is not None and fixed:
        result, tile = max(fixed, key=lambda entry: entry[1]["fixed"])
        message = f"--max-strain cannot be met in {len(fixed)} of {len(rows)}: {_named(result, tile)}: {shares(tile)}"
        return Failure(TOLERANCE, f"{message}; {advice(work.meshes[result.mesh].settings, tile)}")
    unknown = []
    for option, limit in settings.limits.items():
        name, of = _LIMITED[option]
        found = [(of(t), r, t) for r, t in rows]
        known = [entry for entry in found if math.isfinite(entry[0])]
        unknown += [(option, _named(r, t), UNMEASURED) for value, r, t in found if not math.isfinite(value)]
        unknown += [(option, f"{r.mesh}, frame {r.frame}", r.left_out[0].why) for r in ordered if not r.tiles]
        over = [entry for entry in known if entry[0] > limit]
        if over:
            value, result, tile = max(over, key=lambda entry: entry[0])
            more = f", {_place(tile['features']['worst'][0])}" if option == "--max-worse" else ""
            message = f"{option} {limit:g} was exceeded in {len(over)} of {len(found)}: {_named(result, tile)}: {name}"
            return Failure(TOLERANCE, f"{message} {value:.4g}{more}")
    for option, place, why in unknown:
        # A limit never counts as kept where nothing was measured.
        return Failure(TOLERANCE, f"{option} could not be checked in {len(unknown)} places: {place}: {why}")
    return None


def _named(result: FrameResult, tile: dict) -> str:
    return f"{result.mesh}, frame {result.frame}, tile {tile_name(tile)}"


def _strain_of(tile: dict) -> float:
    strain = Strain.of(tile["strain"])
    return math.nan if strain.unmeasured else strain.after


def _worse_of(tile: dict) -> float:
    strain, features = Strain.of(tile["strain"]), tile["features"]
    # Rigid sets of few segments count as no features.
    return math.nan if strain.unmeasured or (strain.segments and not features["count"]) else features["worse"]


_LIMITED = {
    "--max-strain": ("RMS strain of", _strain_of),
    "--max-error": ("texels that 1 % of the map is off by:", lambda tile: tile["map"]["error_texels"]["p99"]),
    "--max-worse": ("features that are worse than without vrtm:", _worse_of),
}
"""Of each option that limits a figure of tiles: its name, and the figure, NaN if it is not known."""
