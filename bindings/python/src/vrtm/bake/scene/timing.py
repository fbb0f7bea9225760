"""When a file has samples, and which of its times are frames."""

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

FILE = "file"
"""The rate of frames that the file itself says."""
CLOSE = 1e-3
"""Frames within which a time is one: files keep times with few digits."""
USUAL = (24.0, 25.0, 30.0)
_FASTEST = 61.0
"""More samples per second are no frames, but lie between them."""
_MOST = 64
"""Samples of motion blur in a frame."""


@dataclass(frozen=True)
class Clock:
    """The time of a file at each frame."""

    times: float = 1.0
    """Units of the file's time per second: time codes, or 1."""
    frames: float = 1.0
    """Frames per second."""

    def time(self, frame: float) -> float:
        """The file's time at a frame."""
        return frame * self.times / self.frames

    def frame(self, time: float) -> float:
        """The frame at a time, mostly one between two."""
        return time * self.frames / self.times


def is_whole(number: float) -> bool:
    """True if a number of frames is a whole one, but for rounding."""
    return abs(number - round(number)) < CLOSE


def cycle(times: Sequence[float]) -> tuple[float, int] | None:
    """(period, samples in it) of ascending times: of motion blur, all samples around a frame are one cycle. None if
    they do not repeat."""
    known = np.asarray(times, np.float64)
    for samples in range(1, min(len(known) // 2, _MOST) + 1):
        steps = known[samples:] - known[:-samples]
        if np.ptp(steps) <= CLOSE * steps.mean():
            return float(steps.mean()), samples
    return None


def rate(seconds: Sequence[float]) -> float | None:
    """Frames per second of samples at ascending times; None where they tell nothing of that."""
    found = cycle(seconds)
    if found is None:
        return None
    own = tidy(1 / found[0])
    if own < _FASTEST and is_whole(seconds[0] * own):
        return own
    # Several samples in each frame, or one of several frames.
    return next((r for r in USUAL if is_whole(max(own / r, r / own)) and is_whole(seconds[0] * r)), own)


def tidy(rate: float) -> float:
    """A rate without what rounding left of a whole one."""
    return float(round(rate)) if abs(rate - round(rate)) < 1e-4 * rate else rate


def is_between(frames: Sequence[float]) -> bool:
    """True if most frames have no sample, and yet there are as many samples as if they had: the samples are at another
    rate, or shifted. `frames`: where samples lie, ascending. Samples around each frame, as of a shutter, are at its
    rate."""
    whole = {round(frame) for frame in frames if is_whole(frame)}
    missing = math.floor(frames[-1]) - math.ceil(frames[0]) + 1 - len(whole)
    found = cycle(frames)
    if missing <= len(whole) or len(frames) <= len(whole) + missing // 2:
        return False
    if found is None:
        return True
    period, samples = found
    return not is_whole(max(period, 1 / period)) or (samples == 1 and is_whole(period))
