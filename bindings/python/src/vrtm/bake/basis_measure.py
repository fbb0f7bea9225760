"""What sums of basis maps are worth: errors, folds and strain of a frame, and folds at random values of controls."""

from __future__ import annotations

import dataclasses
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from vrtm.bake import basis_tiles
from vrtm.bake.basis_tiles import TileMaps
from vrtm.bake.frames import Frame
from vrtm.bake.scene.types import Shape
from vrtm.bake.work import Work
from vrtm.basis.controls import Driver
from vrtm.basis.fit import summed

_RANDOM = 32
"""Poses of random controls that are looked at for folds."""


@dataclass
class Measure:
    """The basis maps of a mesh, as stored."""

    work: Work
    shape: Shape
    tiles: list[TileMaps]
    maps: np.ndarray
    stop: Callable[[], None]

    def row(self, weights: np.ndarray, delta: np.ndarray, frame: Frame) -> dict:
        """What is measured of a frame. Errors are in texels of the texture."""
        self.stop()
        total = summed(self.maps, weights[None])[0]
        off = np.linalg.norm(total - delta, axis=1)[delta.any(axis=1) | total.any(axis=1)]
        off = off * self.work.settings.texture_size if len(off) else np.zeros(1)
        pose = self.work.scene.positions(self.shape, frame)
        strains = {
            name: basis_tiles.strain(self.tiles, self.shape, pose, maps)
            for name, maps in (("own_uvs", np.zeros_like(delta)), ("map", delta), ("basis", total))
        }
        return {
            "frame": frame,
            "weights": [float(weight) for weight in weights],
            "error": float(off.max()),
            "error_p99": float(np.quantile(off, 0.99)),
            "error_mean": float(off.mean()),
            "folds": {"map": basis_tiles.folds_of(self.tiles, delta), "basis": basis_tiles.folds_of(self.tiles, total)},
            "strain": {name: None if found is None else dataclasses.asdict(found) for name, found in strains.items()},
        }

    def random(self, driver: Driver, known: np.ndarray, most: int) -> dict:
        """Whether the sum folds in more than `most` places, those of the poses' own maps, where controls are anywhere
        between the least and the largest of the poses, `known`."""
        low, high = np.minimum(known.min(axis=0), 0), np.maximum(known.max(axis=0), 0)
        # The same in each bake.
        tried = np.random.default_rng(1).uniform(low, high, (_RANDOM, len(low)))
        worst, count, folding = None, 0, 0
        for values, weights in zip(tried, driver(tried)):
            self.stop()
            found = basis_tiles.folds_of(self.tiles, summed(self.maps, weights[None].astype(np.float32))[0])
            folding += found > most
            if found > count:
                worst, count = dict(zip(driver.names, map(float, values.round(4)))), found
        return {"poses": _RANDOM, "folding": folding, "folds": count, "folds_of_maps": most, "worst": worst}
