"""Parts that the figures share: a painted model with its maps, and panels of it."""

from dataclasses import dataclass
from pathlib import Path

import numpy as np
import paint
import sheet
import solve
import stage


@dataclass
class Options:
    work: Path  # for textures and maps
    scenes: Path  # asset folders of the built-in scenes; those made here are written beside them
    assets: Path  # the assets beside the checkout
    samples: int = 24
    peers: bool = True  # whether to run the other parameterisers


class Subject:
    """A model with its textures in a folder."""

    def __init__(self, options, name, model, painted, grid, **how):
        self.options, self.model, self.grid, self.how = options, model, grid, how
        self.folder = options.work / name
        self.folder.mkdir(parents=True, exist_ok=True)
        painted.write(self.folder)
        self.udims = list(painted.colour)

    def solve(self, frame, **options):
        """Solves a frame (from 0) and writes its maps; those of tiles without rigidity change nothing."""
        solved = solve.solved(self.model, self.model.frames[frame], self.grid, **options)
        for udim in self.udims:
            map = solved.maps.get(udim)
            if map is None:
                v, u = (np.mgrid[:128, :128] + 0.5) / 128
                map = np.stack([u + udim - 1001, 1 - v], -1)
            zero = np.zeros_like(map[..., :1])
            paint.warp.write(self.folder / f"map{frame}.{udim}.exr", np.concatenate([map, zero], -1))
        return solved

    def map(self, frame):
        return self.folder / f"map{frame}.<UDIM>.exr"

    def panel(self, view, frame=None, redirected=False, look=stage.lit, uvs=None, scale=1.0, crisp=False):
        """An image: at rest, or a frame with the original UVs, through its map, or with UVs of its own."""
        points = self.model.rest if frame is None else self.model.frames[frame]
        map = self.map(frame) if redirected else None
        how = dict(self.how) if look is stage.lit else {k: v for k, v in self.how.items() if k == "rounded"}
        samples = self.options.samples if look is stage.lit else max(self.options.samples // 2, 4)
        return sheet.flat(
            stage.render(
                self.model, points, view, self.folder, map, look=look, samples=samples, uvs=uvs, scale=scale, **how
            )
        )

    def comparison(self, view, frame, titles=("at rest", "original UVs", "vrtm", "rigid: original, vrtm, both")):
        """Rest, original UVs, ours, and where rigid features are with either."""
        return [
            (titles[0], self.panel(view)),
            (titles[1], self.panel(view, frame)),
            (titles[2], self.panel(view, frame, True)),
            (titles[3], self.panel(view, frame, True, stage.overlap)),
        ]


def record(name, solved):
    """A line of results."""
    return {
        "case": name,
        "before": solved.before,
        "after": solved.after,
        "folds": solved.folds,
        "seconds": solved.seconds,
    }
