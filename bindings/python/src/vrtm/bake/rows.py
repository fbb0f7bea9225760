"""Rows of the report: of a tile, its strain and its map, and of files."""

import dataclasses
import math
import os
from collections.abc import Iterable
from dataclasses import dataclass

import vrtm
from vrtm.bake import gain
from vrtm.bake.part import TileWork
from vrtm.bake.settings import Settings

UNMEASURED = "the painted features are too small for the grid (--size)"
"""The reason why no strain is known."""


@dataclass(frozen=True)
class Strain:
    """RMS strain of rigid segments, without the warp and with it."""

    segments: int
    before: float
    after: float
    unmeasured: bool = False
    """True if something is rigid, and no segment is."""

    @staticmethod
    def of(told: dict) -> "Strain":
        """The strain of a tile, from its row."""
        return Strain(told["segments"], told["before"]["rms"], told["after"]["rms"], told.get("unmeasured", False))


def mean(strains: Iterable[Strain]) -> Strain:
    """The strain of all of their segments."""
    found = list(strains)
    segments = sum(own.segments for own in found)

    def rms(values: Iterable[float]) -> float:
        return math.sqrt(sum(own.segments * value**2 for own, value in zip(found, values)) / max(segments, 1))

    unmeasured = any(own.unmeasured for own in found)
    return Strain(segments, rms(own.before for own in found), rms(own.after for own in found), unmeasured)


def strain(tile: TileWork) -> dict:
    """The strain of all rigid segments, and apart from that of those that may move."""
    report = tile.tile.report()
    fixed = report.segments_fixed * report.strain_fixed**2
    segments = report.segments + report.segments_fixed

    def rms(moving: float) -> dict:
        return {"rms": math.sqrt((report.segments * moving**2 + fixed) / max(segments, 1))}

    return {
        "segments": segments,
        "unmeasured": not segments and tile.tile.info.movable_nodes > 0 and gain.is_painted(tile),
        "before": rms(report.before.rms),
        "after": rms(report.after.rms),
        "movable": {
            "segments": report.segments,
            "before": dataclasses.asdict(report.before),
            "after": dataclasses.asdict(report.after),
            "harm": report.harm,
            "help": report.help,
        },
    }


def features(tile: vrtm.Tile) -> dict:
    """The number of painted features, how many are worse than without the warp or much strained, and the worst."""
    report = tile.report()
    return {
        "count": report.features,
        "worse": report.features_worse,
        "strained": {"before": report.features_strained_before, "after": report.features_strained_after},
        "worst": [dataclasses.asdict(feature) for feature in tile.worst_features()],
    }


def figures(tile: TileWork, size: tuple[int, int], found: vrtm.MapInfo | None, settings: Settings) -> dict:
    """Figures of a solve that its file keeps: none that changes from run to run, such as times. `found`: facts about
    maps of the size."""
    report, pose = tile.tile.report(), tile.part.asset.report()
    names = ("energy_before", "energy", "min_jacobian", "folds", "max_displacement")
    counts = ("charts", "charts_fallback", "charts_apart")
    kept: dict = {name: getattr(report, name) for name in (*names, *counts)}
    kept |= {name: getattr(pose, name) for name in ("scale", "scale_spread")}
    facts = tile.tile.info
    nodes = (facts.grid_width + 1) * (facts.grid_height + 1)
    kept |= {"overlap": facts.overlap, "fixed": facts.fixed, "movable": facts.movable_nodes / nodes}
    overlapped = facts.rigid_overlapped / max(facts.rigid_nodes, 1)
    kept["rigid"] = {
        "texels": facts.rigid_nodes,
        "overlapped": overlapped,
        "fixed": facts.fixed,
        "movable": 1 - facts.fixed if facts.rigid_nodes else 0.0,
    }
    if settings.measure:
        if not facts.rigid_nodes:
            # Paint that is grey all over: its segments tell.
            kept["fixed"] = report.segments_fixed / max(report.segments + report.segments_fixed, 1)
        kept["strain"], kept["features"] = strain(tile), features(tile.tile)
    if found is not None:
        kept["map"] = dataclasses.asdict(found) | {"size": list(size)}
    return kept


def place(tile: TileWork) -> dict:
    """The keys of a tile's row that distinguish it from the others of its mesh."""
    subset = {"subset": tile.part.subset} if tile.part.subset else {}
    return {"udim": tile.udim, "layer": tile.layer, "layers": tile.tile.layers} | subset


def row(tile: TileWork, files: list[dict], figures: dict, settings: Settings) -> dict:
    """A tile's row of the report; `files`: those of its files."""
    written = any(entry["state"] == "written" for entry in files)
    found = {name: value for name, value in figures.items() if name not in ("strain", "features", "map")}
    line: dict = place(tile) | {"state": "written" if written else "skipped", "grid": list(tile.cells)} | found
    line["strain"], line["features"] = figures.get("strain"), figures.get("features")
    line["map"] = None
    if "map" in figures:
        found = figures["map"]
        texels = {part: found[f"error_{part}"] * settings.texture_size for part in ("rms", "p99", "max")}
        line["map"] = {
            "size": found.get("size", list(tile.size)),
            "folds": found["folds"],
            "min_jacobian": found["min_jacobian"],
            "error_texels": {"texture_size": settings.texture_size} | texels,
            "sufficient_size": [found["sufficient_width"], found["sufficient_height"]],
        }
    line["files"] = files
    return line


def tile_name(row: dict) -> str:
    """A tile as messages name it: its number, the layer if it has several, and the subset if these are baked apart."""
    layer = f" layer {row['layer']}" if row["layers"] > 1 else ""
    return f"{row['udim']}{layer}" + (f" of {row['subset']}" if "subset" in row else "")


def file(path: str, is_new: bool, settings: Settings) -> dict:
    state = "written" if is_new else "skipped"
    return {"path": os.path.relpath(path, settings.out).replace(os.sep, "/"), "state": state}
