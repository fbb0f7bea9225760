"""vrtm on a model: maps for a frame, strain, time."""

import statistics
import time
from dataclasses import dataclass, field

import numpy as np
import vrtm


@dataclass
class Solved:
    before: float  # strain inside rigid features with the original UVs, RMS over all tiles
    after: float
    seconds: float  # of the solve alone
    folds: int
    maps: dict  # UDIM number: redirection with the tile's place added, (size, size, 2)
    reports: dict = field(default_factory=dict)


def opened(device, model, grid, settings=None):
    """The asset of a model with its maps set."""
    asset = vrtm.Asset(
        device, model.rest, model.indices, face_counts=model.counts, uvs=model.uvs, uv_indices=model.uv_indices
    )
    for udim, map in model.rigidity.items():
        asset.tile(udim).set_rigidity(map.astype(np.float32))
        asset.tile(udim).set_settings(grid_width=grid, grid_height=grid, **(settings or {}))
    return asset


def solved(model, pose, grid, map_size=None, settings=None, quality="normal", repeats=1):
    """Solves for a pose (vertices, 3); the time is the median of `repeats` solves, not counting the first."""
    with vrtm.Device("cpu") as device, opened(device, model, grid, settings) as asset:
        asset.solve(pose, quality=quality, measure=True)
        tiles = [asset.tile(udim) for udim in model.rigidity]
        reports = {tile.udim: tile.report() for tile in tiles}
        maps = {tile.udim: tile.fetch("redirection_udim", map_size or grid) for tile in tiles}
        times = []
        for _ in range(repeats):
            asset.solve(model.rest, quality=quality)
            start = time.perf_counter()
            asset.solve(pose, quality=quality)
            times.append(time.perf_counter() - start)
    weights = np.array([report.nodes_active for report in reports.values()], float)

    def rms(which):
        values = np.array([getattr(report, which).rms for report in reports.values()])
        return float(np.sqrt((weights * values**2).sum() / max(weights.sum(), 1)))

    folds = sum(report.folds for report in reports.values())
    return Solved(rms("before"), rms("after"), statistics.median(times), folds, maps, reports)
