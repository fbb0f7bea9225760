"""Dilation of textures that are looked up, or filtered, over seams: around each chart, copies of the texels that lie
beyond its seams on the surface. `Tile.dilation` names these texels."""

from collections.abc import Callable, Hashable, Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from vrtm.resample import MARGIN, interpolated, turned


@dataclass(frozen=True, eq=False)
class Lookups:
    """The images that a mesh looks up."""

    images: Mapping[int, Hashable]
    """The key of an image by UDIM number; tiles may share one."""
    dilation: Callable[[int, tuple[int, int]], np.ndarray]
    """UDIM number, (width, height) -> `Tile.dilation` with four channels, the first row at the top."""


def dilated(
    images: Mapping[Hashable, np.ndarray], lookups: Sequence[Lookups], normals: str | None = None
) -> dict[Hashable, tuple[np.ndarray, np.ndarray]]:
    """Copies texels from beyond the seams of meshes into the images of one texture. Returns each image, and a mask of
    the texels that changed.

    `images` are (height, width, channels) f32 by their keys, all with as many channels, the first row at the top.
    Texels in a chart of any mesh stay. `normals` is "up" or "down" for a normal map in tangent space, with numbers from
    0 to 1, by the way that green grows: up as v does, or down."""
    found = {key: _copies(key, image, lookups, normals is not None) for key, image in images.items()}
    now = {key: image.astype(np.float32) for key, image in images.items()}
    for final in (False, True):
        before = {key: pixels.copy() for key, pixels in now.items()}
        for key in images:
            for source, (rows, columns, uv, jacobian) in found[key].copies.items():
                height, width, _ = before[source].shape
                x, y = uv[:, 0] * width, (1 - uv[:, 1]) * height
                # First of texels in charts alone; then also of what was copied beside them, as finely as filters do.
                sample = _filtered if final else _in_charts
                values = sample(before[source], found[source].covered, x, y)
                if normals is not None:
                    values[:, :3] = turned(values[:, :3], jacobian, normals == "down")
                now[key][rows, columns] = values
    return {key: (now[key], found[key].taken) for key in images}


def _in_charts(pixels: np.ndarray, covered: np.ndarray, x: np.ndarray, y: np.ndarray) -> np.ndarray:
    """The mean of those of the four texels around each place that lie in charts; of all four where none does."""
    height, width, channels = pixels.shape
    column, row = np.floor(x - 0.5).astype(np.int64), np.floor(y - 0.5).astype(np.int64)
    across, down = x - 0.5 - column, y - 0.5 - row
    total = np.zeros((2, len(x), channels))
    weights = np.zeros((2, len(x), 1))
    for j in range(2):
        for i in range(2):
            at = (np.clip(row + j, 0, height - 1), np.clip(column + i, 0, width - 1))
            weight = (np.abs(1 - i - across) * np.abs(1 - j - down))[:, None]
            for k, of in enumerate((weight * covered[at][:, None], weight)):
                total[k] += np.where(of > 0, of * pixels[at], 0)
                weights[k] += of
    inside = weights[0] > 1e-6
    return np.where(inside, total[0] / np.where(inside, weights[0], 1), total[1] / weights[1])


def _filtered(pixels: np.ndarray, _covered: np.ndarray, x: np.ndarray, y: np.ndarray) -> np.ndarray:
    """Catmull-Rom interpolation, within the range of the image: beside an edge it would overshoot."""
    finite = np.where(np.isfinite(pixels), pixels, np.nan)
    low, high = np.nanmin(finite, axis=(0, 1)), np.nanmax(finite, axis=(0, 1))
    padded = np.pad(pixels, ((MARGIN, MARGIN), (MARGIN, MARGIN), (0, 0)), mode="edge")
    return np.clip(interpolated(padded, x, y), low, high)


@dataclass(frozen=True, eq=False)
class _Found:
    """Sources of an image's texels."""

    covered: np.ndarray
    """(height, width) of bool: covered by a chart."""
    taken: np.ndarray
    """(height, width) of bool: copied from elsewhere."""
    copies: dict[Hashable, list[np.ndarray]]
    """By the image that texels are copied from: rows and columns of the copies, the UVs of their sources, within the
    tile, and the Jacobians of these (`_jacobian`)."""


def _copies(key: Hashable, image: np.ndarray, lookups: Sequence[Lookups], turns: bool) -> _Found:
    """Texels to copy into an image, by the dilations of the meshes that look it up. No texel of a chart changes."""
    height, width, _ = image.shape
    covered = np.zeros((height, width), bool)
    found: dict[Hashable, list[np.ndarray]] = {}
    taken = np.zeros((height, width), bool)
    across, down = (np.arange(width) + 0.5) / width, 1 - (np.arange(height) + 0.5) / height
    pieces = []
    for mesh in lookups:
        for udim in (udim for udim, of in mesh.images.items() if of == key):
            dilation = mesh.dilation(udim, (width, height))
            origin = np.array([(udim - 1001) % 10, (udim - 1001) // 10])
            own = np.stack(np.broadcast_arrays(across[None, :], down[:, None]), axis=-1) + origin
            known = dilation[..., 3] > 0
            # More than the rounding of UVs among all tiles.
            away = known & (np.abs(dilation[..., :2] - own) > 4e-7 * (1 + own)).any(axis=-1)
            covered |= known & ~away
            pieces.append((mesh, dilation, away))
    for mesh, dilation, away in pieces:
        rows, columns = np.nonzero(away & ~covered & ~taken)
        uv = dilation[rows, columns, :2].astype(np.float64)
        # Only normals are turned.
        jacobian = _jacobian(dilation, away, rows, columns) if turns else np.empty((len(rows), 0))
        tiles = np.floor(uv).astype(np.int64)
        udims = 1001 + tiles[:, 0] + 10 * tiles[:, 1]
        for udim in np.unique(udims):
            source = mesh.images.get(int(udim))
            if source is not None:
                chosen = udims == udim
                part = [rows[chosen], columns[chosen], (uv - tiles)[chosen], jacobian[chosen]]
                taken[part[0], part[1]] = True
                old = found.get(source)
                found[source] = part if old is None else [np.concatenate(pair) for pair in zip(old, part)]
    return _Found(covered, taken, found)


def _jacobian(dilation: np.ndarray, away: np.ndarray, rows: np.ndarray, columns: np.ndarray) -> np.ndarray:
    """(texels, 4): the Jacobian, row by row, of the map from where some texels lie to what they show.

    It comes from their differences to the texels beside them; of the two on either side the nearer one, since the other
    may lie beyond another seam. Where a texel has no such neighbour, the map does not turn."""
    height, width = away.shape
    uv = dilation[rows, columns, :2].astype(np.float64)
    sides = []
    for down, right, count in ((0, 1, width), (1, 0, -height)):
        # v grows against the rows.
        differences = []
        for step in (1, -1):
            r, c = rows + step * down, columns + step * right
            inside = (r >= 0) & (r < height) & (c >= 0) & (c < width)
            r, c = np.clip(r, 0, height - 1), np.clip(c, 0, width - 1)
            difference = (dilation[r, c, :2].astype(np.float64) - uv) * (step * count)
            differences.append(np.where((inside & away[r, c])[:, None], difference, np.inf))
        length = [np.abs(difference).max(axis=-1) for difference in differences]
        sides.append(np.where((length[0] <= length[1])[:, None], differences[0], differences[1]))
    along, up = sides
    known = [np.isfinite(side).all(axis=-1, keepdims=True) for side in (along, up)]
    quarter = np.stack([up[:, 1], -up[:, 0]], axis=-1)
    along = np.where(known[0], along, np.where(known[1], quarter, [1.0, 0.0]))
    up = np.where(known[1], up, np.stack([-along[:, 1], along[:, 0]], axis=-1))
    return np.stack([along[:, 0], up[:, 0], along[:, 1], up[:, 1]], axis=-1)
