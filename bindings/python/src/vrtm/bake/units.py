"""Whether a pose is in the units of the rest."""

from __future__ import annotations

import numpy as np

from vrtm.bake.scene import Shape

_OTHER = 9.9
"""How many times as long or as short the median edge is in another unit: the nearest ones differ by 10."""
_EDGES = 20000
"""Of a large mesh so many edges are looked at."""


def ratio(shape: Shape, positions: np.ndarray) -> float:
    """The median of how many times as long as at rest the edges of a mesh are; 1 if it has none with a length."""
    first = np.arange(len(shape.indices))
    last = np.cumsum(shape.face_counts) - 1
    following = first + 1
    following[last[shape.face_counts > 0]] = (last - shape.face_counts + 1)[shape.face_counts > 0]
    step = max(1, len(first) // _EDGES)
    a, b = shape.indices[first[::step]], shape.indices[following[::step]]
    rest, pose = (np.linalg.norm(np.subtract(p[a], p[b], dtype=np.float64), axis=-1) for p in (shape.rest, positions))
    longs = rest > 0
    return float(np.median(pose[longs] / rest[longs])) if longs.any() else 1.0


def differ(ratio: float) -> bool:
    """Whether such a ratio looks like another unit."""
    # A pose that has collapsed is in no unit.
    return ratio >= _OTHER or 1e-6 < ratio <= 1 / _OTHER
