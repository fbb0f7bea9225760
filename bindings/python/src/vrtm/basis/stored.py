"""The numbers that basis maps are stored in: 16-bit floats, or 16 or 8 bits of a range per map and channel."""

from dataclasses import dataclass

import numpy as np

HALF = "half"
FORMATS = {HALF: "float16", "unorm16": "uint16", "unorm8": "uint8"}
"""The type of the numbers of each, as numpy names it."""


def ending(form: str) -> str:
    """Ending of a file with such numbers: no EXR has integers of 16 or 8 bits."""
    return ".exr" if form == HALF else ".png"


@dataclass(frozen=True, eq=False)
class Range:
    """Meaning of stored numbers: `offset + scale * number`, where an unsigned type's largest counts as 1."""

    offset: np.ndarray
    """(2,) f32, of u and v."""
    scale: np.ndarray
    """(2,) f32."""


def stored(maps: np.ndarray, form: str) -> tuple[np.ndarray, list[Range]]:
    """Rounds maps (K, texels, 2) to a format. Returns the rounded values, in f32 (f16 as they are), and the range of
    each map. A value of 0 stays 0."""
    if form == HALF:
        return maps.astype(np.float16), [Range(np.zeros(2, np.float32), np.ones(2, np.float32)) for _ in maps]
    most = np.iinfo(FORMATS[form]).max
    ranges = [_range(one.min(axis=0, initial=0), one.max(axis=0, initial=0), most) for one in maps]
    return np.stack([values(numbers(one, of, form), of) for one, of in zip(maps, ranges)]), ranges


def numbers(values: np.ndarray, of: Range, form: str) -> np.ndarray:
    """The stored numbers of (..., 2) values."""
    if form == HALF:
        return values.astype(np.float16)
    most = np.iinfo(FORMATS[form]).max
    share = (values.astype(np.float64) - of.offset) / np.where(of.scale, of.scale, 1)
    return np.rint(share * most).clip(0, most).astype(FORMATS[form])


def values(numbers: np.ndarray, of: Range) -> np.ndarray:
    """Values of stored numbers, (..., 2) f32, as a shader reads them."""
    if numbers.dtype.kind == "f":
        return numbers.astype(np.float32)
    most = np.iinfo(numbers.dtype).max
    found = of.offset + of.scale * (numbers / np.float64(most))
    # What is 0 but for the rounding of the range to f32.
    return np.where(np.abs(found) < of.scale / most / 4, 0, found).astype(np.float32)


def _range(low: np.ndarray, high: np.ndarray, most: int) -> Range:
    """A range about `low` to `high`, of which one number stands for 0: what does not move then stays."""
    ideal = most * -low / np.where(high > low, high - low, 1)
    tried = []
    for zero in (np.floor(ideal), np.ceil(ideal)):
        zero = zero.clip(np.where(low < 0, 1, 0), np.where(high > 0, most - 1, most))
        step = np.maximum(-low / np.maximum(zero, 1), high / np.maximum(most - zero, 1))
        tried.append((zero, step))
    (zero, step), (other, of_other) = tried
    zero, step = np.where(of_other < step, other, zero), np.minimum(step, of_other)
    return Range((-zero * step).astype(np.float32), (most * step).astype(np.float32))
