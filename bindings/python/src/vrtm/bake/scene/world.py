"""Transforms above a mesh. Translations do not count: they stretch nothing, and far away they cost digits."""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np

from vrtm.bake.frames import Frame

Linear = Callable[[float], np.ndarray]
"""The linear part of a transform to the world at a frame: (3, 3) f64, by which rows of points are multiplied."""

_LOOKED_AT = 10_000
_EVEN = 1.001
"""Up to this ratio a scale is the same along all axes."""


def placed(points: np.ndarray, linear: np.ndarray) -> np.ndarray:
    """(points, 3) f64 as they lie in the world, but for a translation."""
    return points.astype(np.float64) @ linear


def uneven_scale(linear: Linear, frames: Sequence[Frame]) -> str | None:
    """What to warn of where a transform that is not applied stretches a mesh over time, by more along one axis than
    along another; the end of a sentence. Of very many frames some are looked at."""
    frames = frames[:: -(-len(frames) // _LOOKED_AT)]
    first = linear(frames[0])
    if abs(np.linalg.det(first)) == 0:
        return None
    ratios = []
    for frame in frames[1:]:
        scales = np.linalg.svd(np.linalg.solve(first, linear(frame)), compute_uv=False)
        ratios.append(scales[0] / max(scales[2], 1e-9 * scales[0], 1e-300))
    worst = int(np.argmax(ratios)) if ratios else 0
    if not ratios or ratios[worst] <= _EVEN:
        return None
    return (
        f"the transforms above it scale it {ratios[worst]:.3g} times as much along one axis as along another (frame "
        f"{frames[1 + worst]}, against frame {frames[0]}), which is not taken for a stretch: --world does"
    )
