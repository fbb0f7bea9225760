"""The units of a mesh's rest and poses, and the scaling of the rest where they differ.

A deformation makes some edges longer and others shorter. Where all of them are longer by one factor, in all frames,
the rest is in another unit, or the whole mesh has another size on purpose: in both cases what is painted on it has
grown along, and the rest is scaled. A factor that changes from frame to frame is an animation.
"""

import math
from bisect import bisect_left, bisect_right
from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from vrtm.bake.frames import Frame
from vrtm.bake.scene import SceneError, Shape
from vrtm.bake.scene.topology import corner_starts, next_corners

_ALIKE, _EXACT = 1.01, 1.0001
"""Ratios up to which factors count as one, and as one that is known to some digits."""
_PURE, _RIGID = 0.95, 0.3
"""Shares of the faces that a factor must have, to be that of a mesh which is not deformed otherwise, and of one that
is."""
_LARGE = 1.5
"""From this factor on, faces that are all scaled by it tell of another unit even where the rest of the mesh deforms."""
_IMPLAUSIBLE = 2.0
"""A median of the edges' ratios that no deformation has in all frames."""
_OTHER = 9.9
"""A ratio that ends a bake where nothing explains it: the nearest units of one system differ by 10."""
_LOOKED_AT = 5
"""Frames that are looked at."""
_FACES = 5000
"""Of a large mesh so many faces are looked at."""


@dataclass(frozen=True)
class Lengths:
    """Lengths of the edges of a pose, in those at rest."""

    median: float
    factor: float
    """The factor that most faces have, those whose edges all have the same."""
    share: float
    """The share of these faces."""

    @property
    def size(self) -> float:
        """The factor of the whole mesh."""
        return self.factor if self.share >= _RIGID else self.median

    def over(self, factor: float) -> "Lengths":
        """The same against a rest that is scaled."""
        return Lengths(self.median / factor, self.factor / factor, self.share)

    @property
    def is_odd(self) -> bool:
        """True if the rest may be in another unit."""
        least = _ALIKE if self.share >= _PURE else _LARGE if self.share >= _RIGID else math.inf
        return _apart(self.factor, 1) > least or (self.median > 1e-6 and _apart(self.median, 1) >= _IMPLAUSIBLE)


class Ruler:
    """The edges of a mesh, as they are measured in its poses."""

    def __init__(self, shape: Shape) -> None:
        counts = shape.face_counts[:: max(1, len(shape.face_counts) // _FACES)]
        starts = corner_starts(shape.face_counts)[:: max(1, len(shape.face_counts) // _FACES)]
        starts, counts = starts[counts > 0], counts[counts > 0]
        self._first = corner_starts(counts)
        corners = np.repeat(starts - self._first, counts) + np.arange(counts.sum())
        self._ends = shape.indices[corners], shape.indices[corners[next_corners(counts)]]
        self._rest = self._measured(shape.rest)

    def _measured(self, positions: np.ndarray) -> np.ndarray:
        a, b = self._ends
        return np.linalg.norm(np.subtract(positions[a], positions[b], dtype=np.float64), axis=-1)

    def lengths(self, positions: np.ndarray) -> Lengths:
        """The lengths of a pose. A mesh without edges that have a length is as at rest."""
        with np.errstate(all="ignore"):
            ratios = self._measured(positions) / self._rest
        known = np.isfinite(ratios)
        if not known.any():
            return Lengths(1.0, 1.0, 0.0)
        least = np.minimum.reduceat(np.where(known, ratios, np.inf), self._first)
        most = np.maximum.reduceat(np.where(known, ratios, 0), self._first)
        faces = np.isfinite(least)
        alike = np.sort(least[faces & (least > 1e-6) & (most <= least * _ALIKE)])
        shared = _densest(alike, _ALIKE)
        # Most of all those that are not bent in the least tell it.
        factor = float(np.median(_densest(shared, _EXACT))) if len(shared) else 1.0
        return Lengths(float(np.median(ratios[known])), factor, len(shared) / np.count_nonzero(faces))

    def strain(self, positions: np.ndarray) -> float:
        """RMS difference of the edges of a pose from those at rest, each by 1 at most."""
        with np.errstate(all="ignore"):
            strain = np.minimum(np.abs(self._measured(positions) / self._rest - 1), 1)
        known = np.isfinite(strain)
        return float(np.sqrt(np.mean(strain[known] ** 2))) if known.any() else 0.0


def spread(frames: Sequence[Frame]) -> list[Frame]:
    """A few frames, from the first to the last."""
    last = len(frames) - 1
    return [frames[index] for index in sorted({round(last * k / (_LOOKED_AT - 1)) for k in range(_LOOKED_AT)})]


@dataclass(frozen=True)
class Finding:
    """Facts about the rest of a mesh."""

    factor: float = 1.0
    """The rest is to be multiplied by it."""
    reason: str = ""
    """Origin of the factor."""
    warning: str = ""
    """The end of a sentence; empty if nothing is odd."""
    ends: bool = False
    """True if the warning ends the bake."""


class Units:
    """Compares the poses of a mesh with its rest."""

    def __init__(self, shape: Shape, frames: Sequence[Frame], positions: Callable[[Frame], np.ndarray]) -> None:
        """`frames`: all that the scene has, so that whatever is baked of it has the same rest."""
        self._shape, self._frames, self._positions = shape, frames, positions
        self._ruler = Ruler(shape)
        self._scale = 1.0
        # The frame whose size is nearest to that of the rest.
        self._anchor = frames[0]
        self._jumps: set[tuple[Frame, Frame]] = set()

    def _at(self, frame: Frame) -> Lengths | None:
        try:
            return self._ruler.lengths(self._positions(frame)).over(self._scale)
        except SceneError:
            # It is said of the frames that are baked.
            return None

    def finding(self) -> Finding:
        """The factor of the rest, and the warning about it."""
        first = self._at(self._frames[0])
        if first is None:
            return Finding()
        declared, reason = self._shape.rest_unit, ""
        # Files often say a unit that they do not have: the lengths decide which of both it is.
        if _apart(declared, 1) > _ALIKE and 1e-6 < first.median < math.inf:
            if _apart(first.median, declared) < _apart(first.median, 1):
                self._scale, reason = declared, "as metersPerUnit says"
                first = first.over(declared)
        if not first.is_odd:
            return Finding(self._scale, reason)
        measured = {self._frames[0]: first} | {frame: self._at(frame) for frame in spread(self._frames)[1:]}
        of = {frame: entry for frame, entry in measured.items() if entry is not None}
        self._anchor = min(of, key=lambda frame: _apart(of[frame].size, 1))
        found = list(of.values())
        factor = _common(found)
        least, most = (pick(entry.size for entry in found) for pick in (min, max))
        where = f"at rest (the rest is from {self._shape.rest_from})"
        if factor is not None:
            self._scale = float(f"{self._scale * factor:.6g}")
            told = f"all of its edges are {factor:.6g} times as long as {where} in all frames: this is another unit, "
            told += "or another size, and no deformation, so that the rest is scaled by it; --allow-units leaves it"
            return Finding(self._scale, "by the lengths of its edges", told)
        between = f"{least:.4g}" if _apart(least, most) < _ALIKE else f"{least:.4g} to {most:.4g}"
        if all(_apart(entry.median, 1) >= _IMPLAUSIBLE for entry in found) and (least > 1 or most < 1):
            ends = all(_apart(entry.median, 1) >= _OTHER for entry in found)
            then = "--allow-units bakes it all the same" if ends else "nothing is converted"
            told = f"its edges are {between} times as long as {where}, as if one of them were in another unit: {then}"
            return Finding(self._scale, reason, told, ends)
        if least > _ALIKE or most < 1 / _ALIKE:
            told = f"all of its edges are {between} times as long as {where}, as if it grew: if the rest is in another "
            return Finding(self._scale, reason, f"{told}unit, scale it; nothing is converted")
        return Finding(self._scale, reason)

    def jump(self, frame: Frame, positions: np.ndarray) -> Finding:
        """The warning about a frame: the whole mesh has another size than at rest, and got it from one frame to the
        next. A mesh that grows may grow by any factor."""
        here = self._ruler.lengths(positions).over(self._scale)
        gross = here.median > 1e-6 and _apart(here.median, 1) >= _OTHER
        if not gross and not (here.share >= _PURE and _apart(here.factor, 1) > _LARGE):
            return Finding()
        start = self._at(self._anchor)
        if start is None or frame == self._anchor or (gross and _apart(start.median, 1) >= _OTHER):
            # The first finding covers such a scene.
            return Finding()
        (before, start), (after, end) = sorted([(self._anchor, start), (frame, here)], key=lambda entry: entry[0])
        while between := self._frames[bisect_right(self._frames, before) : bisect_left(self._frames, after)]:
            middle = between[len(between) // 2]
            half = self._at(middle)
            if half is None:
                break
            if _apart(start.size, half.size) > _apart(half.size, end.size):
                after, end = middle, half
            else:
                before, start = middle, half
        change = end.size / start.size if start.size > 1e-6 else math.inf
        # It collapses or grows, by less from frame to frame.
        if _apart(change, 1) < _LARGE or (not gross and (before, after) in self._jumps):
            return Finding()
        self._jumps.add((before, after))
        ends = gross and _apart(change, 1) >= _OTHER
        then = "--allow-units bakes it all the same" if ends else "nothing is converted"
        rest = f"at rest (median; the rest is from {self._shape.rest_from})"
        told = f"its edges are {here.median:.3g} times as long as {rest}, and in frame {after} {change:.3g} times "
        told += f"as long as in frame {before}, as if one of them were in another unit: {then}"
        return Finding(warning=told, ends=ends)


def _densest(ascending: np.ndarray, ratio: float) -> np.ndarray:
    """The longest run of ascending numbers within a ratio."""
    counts = np.searchsorted(ascending, ascending * ratio, "right") - np.arange(len(ascending))
    best = int(np.argmax(counts)) if len(ascending) else 0
    return ascending[best : best + int(counts.max(initial=0))]


def _apart(a: float, b: float) -> float:
    """The ratio of two numbers, the larger over the smaller."""
    low, high = min(a, b), max(a, b)
    return high / low if low > 0 else math.inf


def _common(found: Sequence[Lengths]) -> float | None:
    """The one factor of all frames; None if there is none."""
    pure = [entry for entry in found if entry.share >= _PURE]
    factor = (pure or found)[0].factor
    if not pure and (found[0].share < _RIGID or _apart(factor, 1) <= _LARGE):
        return None

    def has_it(entry: Lengths) -> bool:
        off = _apart(entry.median, factor)
        if entry.share >= _RIGID and _apart(entry.factor, factor) <= _ALIKE:
            return bool(pure) or off <= 1.25
        return entry.share < _PURE and (off <= _LARGE if pure else off <= 1.25 and off < _apart(entry.median, 1))

    return factor if all(map(has_it, found)) else None
