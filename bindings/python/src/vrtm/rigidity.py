"""Rigidity maps from pictures: from brightness, from a colour, from the relief of a height map, or from detail.

Pictures are arrays, (height, width) or (height, width, channels) of float32, any row first. Those of a texture's tiles
come together, by any keys: one threshold holds for all of them, so that a tile without features gets none.
"""

from collections.abc import Mapping
from typing import TypeVar

import numpy as np

from vrtm.borders import connected

Key = TypeVar("Key")

# Weights of red, green and blue in brightness (ITU-R BT.709).
_BRIGHTNESS = np.array([0.2126, 0.7152, 0.0722], np.float32)
# Contrasts of lightness, from 0 to 1: up to the first a ground counts as plain, from the second on as drawn on.
_PLAIN, _DRAWN = 0.02, 0.1


def brightness(pixels: np.ndarray) -> np.ndarray:
    """Brightness of a picture with at least three channels; the first channel of others."""
    if pixels.ndim == 2 or pixels.shape[2] < 3:
        return pixels if pixels.ndim == 2 else pixels[..., 0]
    return pixels[..., :3] @ _BRIGHTNESS


def light(coded: np.ndarray) -> np.ndarray:
    """Linear light of values in the curve of sRGB."""
    return np.where(coded <= 0.04045, coded / 12.92, ((np.maximum(coded, 0) + 0.055) / 1.055) ** 2.4)


def smaller(pixels: np.ndarray, size: int) -> np.ndarray:
    """A picture with at most `size` texels on its longer side: means of whole blocks."""
    block = -(-max(pixels.shape[:2]) // size)
    (height, rows), (width, columns) = ((n // min(block, n), min(block, n)) for n in pixels.shape[:2])
    # Along whole rows first: that is several times as fast.
    lines = pixels[: height * rows, : width * columns].reshape(height, rows, -1).mean(1, dtype=np.float32)
    return lines.reshape(height, width, columns, -1).mean(2).reshape(height, width, *pixels.shape[2:])


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


def of_detail(
    pictures: Mapping[Key, np.ndarray],
    features: Mapping[Key, np.ndarray] | None = None,
    normals: Mapping[Key, np.ndarray] | None = None,
    *,
    linear: bool = False,
    cells: int = 256,
    ceiling: float = 0.3,
    margin: float = 4.0,
) -> dict[Key, np.ndarray]:
    """Maps of what is drawn outside of features: from 0 on plain ground to `ceiling` where the contrast is that of an
    edge between greys a tenth of the way from black to white apart. Each tile is looked at alone.

    A value is the root of the trace of the structure tensor of lightness (CIE 1976), which is a mean over about one of
    `cells` per side, so that the size of a picture hardly matters. `linear`: the pictures are linear light, not sRGB.
    `features`: rigidity maps. 0 is written up to `margin` cells around their rigid parts, and in tiles where these have
    nothing over a half: there, grey alone would count as a feature. The maps have their sizes. `normals`: normal maps
    from 0 to 1; a normal that turns by an angle, in radians, counts as half as much contrast. Alpha does not count.
    """
    found = {}
    for key, pixels in pictures.items():
        rigid = None if features is None else features.get(key)
        shape = pixels.shape[:2] if rigid is None else rigid.shape
        if features is not None and (rigid is None or rigid.max() <= 0.5):
            found[key] = np.zeros(shape, np.float32)
            continue
        # Four texels per cell resolve the tensor.
        shown = brightness(smaller(pixels if linear else light(pixels), 4 * cells))
        layers = [1.16 * np.cbrt(np.maximum(shown, 0))]
        if normals and key in normals:
            layers += [fitted(smaller(normals[key][..., axis], 4 * cells), shown.shape) for axis in (0, 1)]
        per_cell = max(max(shown.shape) / cells, 1)
        free = np.ones_like(shown)
        if rigid is not None:
            near = fitted(smaller(rigid, max(shown.shape)), shown.shape) > 0
            free -= grown(near.astype(np.float32), round(margin * per_cell))
        trace = np.zeros_like(shown)
        for layer in layers:
            for axis in (0, 1):
                trace += np.diff(layer, axis=axis, append=np.take(layer, [-1], axis)) ** 2
        contrast = np.sqrt(per_cell * np.maximum(blurred(trace * free, max(round(per_cell / 2), 1)), 0))
        found[key] = fitted(ceiling * np.clip((contrast - _PLAIN) / (_DRAWN - _PLAIN), 0, 1) * free, shape)
    return found


def fitted(values: np.ndarray, shape: tuple[int, ...]) -> np.ndarray:
    """A map in another size, by bilinear interpolation."""
    for axis, size in enumerate(shape):
        last = values.shape[axis] - 1
        at = np.clip((np.arange(size) + 0.5) * (last + 1) / size - 0.5, 0, last)
        low = at.astype(int)
        part = np.expand_dims(at - low, 1 - axis)
        upper, lower = (np.take(values, np.minimum(low + more, last), axis) for more in (1, 0))
        values = (upper * part + lower * (1 - part)).astype(np.float32)
    return values


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
    number = np.arange(values.size).reshape(values.shape)
    across, down = inside[:, 1:] & inside[:, :-1], inside[1:] & inside[:-1]
    one, other = (np.append(number[:, at][across], number[at][down]) for at in (np.s_[1:], np.s_[:-1]))
    of = connected(values.size, one, other).reshape(values.shape)
    areas = np.bincount(of[inside], minlength=values.size)
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
