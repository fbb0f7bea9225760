"""Rigidity maps from pictures: from brightness, from a colour, or from the relief of a height map.

Pictures are arrays, (height, width) or (height, width, channels) of float32, any row first. Those of a texture's tiles
come together, by any keys: one threshold holds for all of them, so that a tile without features gets none.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import TypeVar

import numpy as np

Key = TypeVar("Key")

# Weights of red, green and blue in brightness (ITU-R BT.709).
_BRIGHTNESS = np.array([0.2126, 0.7152, 0.0722], np.float32)


def brightness(pixels: np.ndarray) -> np.ndarray:
    """Brightness of a picture with at least three channels; the first channel of others."""
    if pixels.ndim == 2 or pixels.shape[2] < 3:
        return pixels if pixels.ndim == 2 else pixels[..., 0]
    return pixels[..., :3] @ _BRIGHTNESS


def smaller(pixels: np.ndarray, size: int) -> np.ndarray:
    """A picture with at most `size` texels on its longer side: means of whole blocks."""
    block = -(-max(pixels.shape[:2]) // size)
    (height, rows), (width, columns) = ((n // min(block, n), min(block, n)) for n in pixels.shape[:2])
    blocks = pixels[: height * rows, : width * columns].reshape(height, rows, width, columns, -1)
    return blocks.mean((1, 3), dtype=np.float32).reshape(height, width, *pixels.shape[2:])


def otsu(*pictures: np.ndarray) -> float:
    """The threshold that parts all values into two groups with the least variance within them (Otsu 1979)."""
    values = np.concatenate([picture.ravel() for picture in pictures])
    low, high = float(values.min()), float(values.max())
    if high <= low:
        return low
    counts, edges = np.histogram(values, 256, (low, high))
    centres = (edges[:-1] + edges[1:]) / 2
    below = np.cumsum(counts)[:-1]
    above = values.size - below
    sums = np.cumsum(counts * centres)
    below_sum, above_sum = sums[:-1], sums[-1] - sums[:-1]
    between = np.zeros(255)
    both = (below > 0) & (above > 0)
    between[both] = below[both] * above[both] * (below_sum[both] / below[both] - above_sum[both] / above[both]) ** 2.0
    # Where nothing lies between the groups, in the middle of the gap.
    best = np.flatnonzero(between == between.max())
    return float(edges[1 + (best[0] + best[-1]) // 2])


def of_brightness(pictures: Mapping[Key, np.ndarray], threshold: float = 0.0) -> dict[Key, np.ndarray]:
    """Maps that are rigid where a picture is brighter than a threshold; 0 = Otsu's threshold."""
    values = {key: brightness(pixels) for key, pixels in pictures.items()}
    threshold = threshold or otsu(*values.values())
    return {key: soft(bright > threshold) for key, bright in values.items()}


def of_colour(
    pictures: Mapping[Key, np.ndarray], colour: tuple[float, float, float], tolerance: float = 0.2
) -> dict[Key, np.ndarray]:
    """Maps that are rigid where a picture is at most `tolerance` from a colour; black and white are sqrt(3) apart."""

    def near(pixels: np.ndarray) -> np.ndarray:
        return np.linalg.norm(pixels[..., :3] - np.array(colour, np.float32), axis=-1) <= tolerance

    return {key: soft(near(pixels)) for key, pixels in pictures.items()}


def of_heights(
    pictures: Mapping[Key, np.ndarray], feature: float = 0.06, threshold: float = 0.0, sunken: bool = False
) -> dict[Key, np.ndarray]:
    """Maps that are rigid where a height map stands out of its surroundings: above the mean of the heights that are at
    most about half of `feature` away, by `threshold` times the largest such difference; 0 = by Otsu's threshold.
    `feature`: the width of the largest feature, in UV. `sunken`: below that mean instead. Specks and pinholes are left
    out."""
    radius, above, size = {}, {}, 0.0
    for key, pixels in pictures.items():
        heights = brightness(pixels)
        radius[key] = max(round(feature * max(heights.shape) / 2), 2)
        above[key] = (blurred(heights, radius[key]) - heights) * (1 if sunken else -1)
        size = max(size, float(np.abs(heights).max()))
    top = max(float(values.max()) for values in above.values())
    # Less is the rounding of means.
    if top <= 1e-5 * size:
        return {key: np.zeros_like(values) for key, values in above.items()}
    least = threshold * top if threshold > 0 else max(otsu(*above.values()), 0.02 * top)
    return {key: _cleaned(values > least, max(radius[key] // 12, 1)) for key, values in above.items()}


def _cleaned(found: np.ndarray, steps: int) -> np.ndarray:
    closed = ~grown(~grown(found, steps), steps)
    return soft(grown(~grown(~closed, steps), steps))


def changed(values: np.ndarray, invert: bool = False, grow: int = 0) -> np.ndarray:
    """Inverts a rigidity map, or makes its rigid parts larger by `grow` texels; smaller, if that is negative."""
    values = 1 - values if invert else values
    return grown(values, grow) if grow >= 0 else shrunk(values, -grow)


def without_specks(values: np.ndarray, width: float) -> tuple[np.ndarray, int, int]:
    """A rigidity map without the islands that have less area than a disc of `width` texels; also the numbers of islands
    that are left, and that were left out."""
    inside = values > 0.5
    # Each texel begins with its own number, and takes the least one that a neighbour's island has.
    of = np.where(inside, np.arange(values.size).reshape(values.shape), values.size)
    while True:
        least = of.copy()
        for one, other in ((np.s_[1:], np.s_[:-1]), (np.s_[:, 1:], np.s_[:, :-1])):
            least[one] = np.minimum(least[one], np.where(inside[one], of[other], values.size))
            least[other] = np.minimum(least[other], np.where(inside[other], of[one], values.size))
        island = np.arange(values.size + 1)
        np.minimum.at(island, of[inside], least[inside])
        while not np.array_equal(island, further := island[island]):
            island = further
        if np.array_equal(of, further := island[of]):
            break
        of = further
    areas = np.bincount(of[inside], minlength=values.size + 1)
    large = (areas > 0) & (areas >= np.pi / 4 * width**2)
    # With the soft borders around them.
    kept = np.where(grown((inside & large[of]).astype(np.float32), 2) > 0, values, 0)
    return kept if width else values, int(large.sum()), int((areas > 0).sum() - large.sum())


def blurred(values: np.ndarray, radius: int) -> np.ndarray:
    """Blurs a picture by three means over squares, nearly a Gaussian. Its border goes on beyond the picture."""
    for _ in range(3):
        for axis in (0, 1):
            width = [(0, 0), (0, 0)]
            width[axis] = (radius + 1, radius)
            sums = np.cumsum(np.pad(values, width, "edge"), axis, dtype=np.float64)
            n = values.shape[axis]
            upper, lower = (np.take(sums, np.arange(first, first + n), axis) for first in (2 * radius + 1, 0))
            values = ((upper - lower) / (2 * radius + 1)).astype(np.float32)
    return values


def grown(values: np.ndarray, steps: int) -> np.ndarray:
    """Maximum over an octagon of about so many texels: over crosses and squares in turn."""
    for step in range(steps):
        padded = np.pad(values, 1, "edge")
        centre = padded[1:-1, 1:-1]
        rows = np.maximum(np.maximum(padded[:-2], padded[1:-1]), padded[2:])
        columns = np.maximum(np.maximum(padded[:, :-2], padded[:, 1:-1]), padded[:, 2:])
        if step % 2:
            values = np.maximum(np.maximum(rows[:, :-2], rows[:, 1:-1]), rows[:, 2:])
        else:
            values = np.maximum(np.maximum(rows[:, 1:-1], columns[1:-1]), centre)
    return values


def shrunk(values: np.ndarray, steps: int) -> np.ndarray:
    return 1 - grown(1 - values, steps)


def soft(inside: np.ndarray) -> np.ndarray:
    """A mask as 1 and 0, with borders about a texel wide."""
    padded = np.pad(inside.astype(np.float32), 1, "edge")
    columns = padded[:, :-2] + 2 * padded[:, 1:-1] + padded[:, 2:]
    return (columns[:-2] + 2 * columns[1:-1] + columns[2:]) / 16
