"""Folds of a map that is interpolated bilinearly: quads of four texel centres in which it is not one-to-one.

The rule is that of the library's certificate of maps (method §9): over such a quad the Jacobian is smallest at one of
the four centres."""

import numpy as np

_ROUNDING = 1e-11
"""Jacobians up to this size count as 0: they come from coarsely rounded neighbours that are equal."""


def folds(delta: np.ndarray) -> tuple[int, float]:
    """Number of quads of the map `UV + delta` that fold, and the smallest Jacobian (1 at most). `delta`:
    (height, width, 2), the first row at the top, v up."""
    height, width = delta.shape[:2]
    rows, columns = np.mgrid[:height, :width].astype(np.float64)
    at = np.stack([columns + delta[..., 0] * float(width), (height - 1 - rows) + delta[..., 1] * float(height)], -1)
    across, up = np.diff(at, axis=1), -np.diff(at, axis=0)
    if not across.size or not up.size:
        return 0, 1.0
    low, high, left, right = across[1:], across[:-1], up[:, :-1], up[:, 1:]
    edges = [(a, b) for a in (low, high) for b in (left, right)]
    least = np.minimum.reduce([a[..., 0] * b[..., 1] - a[..., 1] * b[..., 0] for a, b in edges])
    least[np.abs(least) < _ROUNDING] = 0
    return int((least <= 0).sum()), min(1.0, float(least.min()))
