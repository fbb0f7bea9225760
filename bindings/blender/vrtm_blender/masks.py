"""Rigidity out of pictures that are there: brightness, a colour, or what stands out of a height map. All of it on
arrays, (height, width) float32 or (height, width, channels)."""

from __future__ import annotations

import numpy as np

# Weights of red, green and blue in brightness (ITU-R BT.709).
_BRIGHTNESS = np.array([0.2126, 0.7152, 0.0722], np.float32)


def brightness(pixels: np.ndarray) -> np.ndarray:
    return pixels[..., :3] @ _BRIGHTNESS


def smaller(pixels: np.ndarray, size: int) -> np.ndarray:
    """A picture with at most `size` texels on its longer side: means of whole blocks."""
    height, width = pixels.shape[:2]
    block = -(-max(height, width) // size)
    height, width = height // block * block, width // block * block
    blocks = pixels[:height, :width].reshape(height // block, block, width // block, block, -1)
    return blocks.mean((1, 3), dtype=np.float32).reshape(height // block, width // block, *pixels.shape[2:])


def otsu(values: np.ndarray) -> float:
    """The threshold that parts values into two groups with the least variance within them (Otsu 1979)."""
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


def brighter(values: np.ndarray, threshold: float) -> np.ndarray:
    return soft(values > threshold)


def coloured(pixels: np.ndarray, colour: tuple[float, float, float], tolerance: float) -> np.ndarray:
    """What is at most `tolerance` from a colour; black and white are the root of 3 apart."""
    distance = np.linalg.norm(pixels[..., :3] - np.array(colour, np.float32), axis=-1)
    return soft(distance <= tolerance)


def raised(heights: np.ndarray, radius: int, threshold: float) -> np.ndarray:
    """What stands out of its surroundings: higher than the mean of all that is at most about `radius` texels away, by
    `threshold` times the largest such difference; 0: by what parts them best. Specks and pinholes are left out."""
    above = heights - blurred(heights, radius)
    top = float(above.max())
    if top <= 0:
        return np.zeros_like(heights)
    found = above > (threshold * top if threshold > 0 else max(otsu(above), 0.02 * top))
    steps = max(radius // 12, 1)
    closed = ~grown(~grown(found, steps), steps)
    return soft(grown(~grown(~closed, steps), steps))


def blurred(values: np.ndarray, radius: int) -> np.ndarray:
    """Three means over squares, nearly a Gaussian; what lies beyond the picture is its border."""
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
    """The largest of all values at most about so many texels away: crosses and squares in turn, which is an octagon."""
    for step in range(steps):
        padded = np.pad(values, 1, "edge")
        centre = padded[1:-1, 1:-1]
        rows = np.maximum(np.maximum(padded[:-2], padded[1:-1]), padded[2:])
        columns = np.maximum(np.maximum(padded[:, :-2], padded[:, 1:-1]), padded[:, 2:])
        if step % 2:
            square = np.maximum(np.maximum(rows[:, :-2], rows[:, 1:-1]), rows[:, 2:])
            values = square
        else:
            values = np.maximum(np.maximum(rows[:, 1:-1], columns[1:-1]), centre)
    return values


def shrunk(values: np.ndarray, steps: int) -> np.ndarray:
    return 1 - grown(1 - values, steps)


def soft(inside: np.ndarray) -> np.ndarray:
    """A yes or no as 1 and 0, with borders of about a texel."""
    return blurred_once(inside.astype(np.float32))


def blurred_once(values: np.ndarray) -> np.ndarray:
    padded = np.pad(values, 1, "edge")
    columns = padded[:, :-2] + 2 * padded[:, 1:-1] + padded[:, 2:]
    return (columns[:-2] + 2 * columns[1:-1] + columns[2:]) / 16
