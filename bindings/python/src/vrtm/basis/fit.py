"""Basis maps of a set of redirections: the fewest, in 16 or 8 bits, whose weighted sums stay within a bound.

The deltas of all frames (redirection minus UV) are the rows of a matrix D. The K leading singular vectors of D are the
maps whose sums come nearest to it in the mean square (Eckart and Young 1936; from the frames' inner products, Sirovich
1987). The bound holds the largest error: so texels are weighted by their largest errors over the frames, and the
vectors taken anew, a few times. The maps are then rounded, and each frame's weights fitted to the maps as stored.

Both a map per frame and the sum are interpolated bilinearly by renderers, so that their difference is largest at a
texel's centre: a bound over the texels holds between them, too. The sum has no constant part, so that the weights of
the rest pose, all 0, leave each texel in its place.
"""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from vrtm.basis.stored import HALF, Range, stored

_ROUNDS = 4
"""Times that texels are weighted anew. Two maps of an arm, off by 42 texels at first, are off by 31 after four rounds,
and by 28 after twelve."""
_FLOOR = 0.05
"""Weight of a texel without error, as a share of that of the texel with the largest error."""
_AT_ONCE = 1 << 15
"""Texels of all frames that are worked on together."""


@dataclass(frozen=True, eq=False)
class Basis:
    """Basis maps with the weights of the frames that they were fitted to."""

    maps: np.ndarray
    """(K, texels, 2) float16, or float32 of stored integers: what to add to a texel's UV, for a weight of 1."""
    weights: np.ndarray
    """(frames, K) float32; the largest of each map is 1 or -1."""
    errors: np.ndarray
    """(frames,): the largest distance of the sum from the frame's own delta, in UV."""
    ranges: list[Range]
    """Ranges of the maps' stored numbers."""

    def __len__(self) -> int:
        return len(self.maps)


def fit(
    deltas: np.ndarray, bound: float, accepts: Callable[[Basis], bool] = lambda basis: True, form: str = HALF
) -> Basis | None:
    """The smallest basis found whose sums are off by `bound` (in UV) at most, at every texel of every frame, and that
    `accepts`; None if there is none. `deltas`: (frames, texels, 2). `form`: what the maps are stored in, one of
    `FORMATS`."""
    frames, texels, _ = deltas.shape
    if not deltas.any():
        empty = np.zeros((0, texels, 2), np.float16)
        return Basis(empty, np.zeros((frames, 0), np.float32), np.zeros(frames), [])
    # What no frame moves, no map has to move.
    moving = np.flatnonzero(deltas.any(axis=(0, 2)))
    columns = np.ascontiguousarray(deltas[:, moving], np.float32)

    def of(count: int, form: str) -> Basis:
        found = _of_size(columns, count, bound, form)
        maps = np.zeros((count, texels, 2), found.maps.dtype)
        maps[:, moving] = found.maps
        return Basis(maps, found.weights, found.errors, found.ranges)

    def is_near(basis: Basis) -> bool:
        return bool(basis.errors.max() <= bound)

    # A map more never makes the sum worse by more than rounding does, which is much in 8 bits.
    fine = "unorm16" if form == "unorm8" else form
    near = of(frames, fine)
    if not is_near(near):
        return None
    near = _least(0, near, lambda count: of(count, fine), is_near)
    # Each further map brings its own rounding, and may fold where fewer maps do not: from the least number upwards.
    failed, best, step = len(near) - 1, near if form == fine else of(len(near), form), 1
    while not (is_near(best) and accepts(best)):
        if len(best) == frames:
            return None
        failed, best, step = len(best), of(min(frames, len(near) + step), form), 2 * step
    return _least(failed, best, lambda count: of(count, form), lambda basis: is_near(basis) and accepts(basis))


def _least(failed: int, best: Basis, of: Callable[[int], Basis], holds: Callable[[Basis], bool]) -> Basis:
    """The smallest basis that holds, by bisection: a basis of `failed` maps does not hold, `best` does."""
    while failed + 1 < len(best):
        tried = of((failed + len(best)) // 2)
        if holds(tried):
            best = tried
        else:
            failed = len(tried)
    return best


def fitted_weights(maps: np.ndarray, deltas: np.ndarray) -> np.ndarray:
    """(frames, K) float32: the weights whose sums of these maps come nearest to deltas, in the mean square."""
    of_maps, mixed = np.zeros((len(maps),) * 2), np.zeros((len(deltas), len(maps)))
    for part in _parts(maps.shape[1]):
        size = 2 * (min(part.stop, maps.shape[1]) - part.start)
        own, wanted = (values[:, part].reshape(len(values), size).astype(np.float64) for values in (maps, deltas))
        of_maps += own @ own.T
        mixed += wanted @ own.T
    return np.linalg.lstsq(of_maps, mixed.T, rcond=1e-12)[0].T.astype(np.float32)


def errors(maps: np.ndarray, weights: np.ndarray, deltas: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """The largest distance of the sums from deltas, in UV: (frames,) over the texels, and (texels,) over the frames."""
    of_frames, of_texels = np.zeros(len(deltas)), np.zeros(deltas.shape[1])
    for part in _parts(deltas.shape[1]):
        off = np.linalg.norm(summed(maps[:, part], weights) - deltas[:, part], axis=-1)
        np.maximum(of_frames, off.max(axis=1, initial=0), out=of_frames)
        of_texels[part] = off.max(axis=0, initial=0)
    return of_frames, of_texels


def summed(maps: np.ndarray, weights: np.ndarray) -> np.ndarray:
    """(frames, texels, 2) f64: the sums of maps (K, texels, 2) with weights (frames, K)."""
    return np.tensordot(weights.astype(np.float64), maps.astype(np.float64), 1)


def _of_size(columns: np.ndarray, count: int, bound: float, form: str) -> Basis:
    """The first basis of `count` maps within the bound, or else the one with the smallest largest error. The first one
    tried is the nearest in the mean square."""
    importance, best = np.ones(columns.shape[1]), None
    for _ in range(_ROUNDS if count < len(columns) else 1):
        vectors = _leading(columns, importance, count)
        # Such that the largest weight of each map is 1.
        scaled = (vectors * np.abs(vectors).max(axis=0)).T.astype(np.float32)
        maps, ranges = stored(np.tensordot(scaled, columns, 1), form)
        weights = fitted_weights(maps, columns)
        of_frames, of_texels = errors(maps, weights, columns)
        if best is None or of_frames.max() < best.errors.max():
            best = Basis(maps, weights, of_frames, ranges)
        if of_frames.max() <= bound:
            break
        importance *= _FLOOR + of_texels / max(of_texels.max(), 1e-30)
        importance /= importance.mean()
    assert best is not None
    return best


def _leading(columns: np.ndarray, importance: np.ndarray, count: int) -> np.ndarray:
    """(frames, count): the leading left singular vectors, of texels that weigh differently."""
    products = np.zeros((len(columns),) * 2)
    for part in _parts(columns.shape[1]):
        some = columns[:, part].astype(np.float64)
        products += np.einsum("ftc,gtc,t->fg", some, some, importance[part], optimize=True)
    return np.linalg.eigh(products)[1][:, ::-1][:, :count]


def _parts(texels: int) -> list[slice]:
    return [slice(start, start + _AT_ONCE) for start in range(0, texels, _AT_ONCE)]
