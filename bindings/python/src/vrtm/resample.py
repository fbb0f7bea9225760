"""Interpolation of images, and normals on a surface that is turned."""

import numpy as np

MARGIN = 2
"""Texels around an image that `interpolated` reads."""


def interpolated(padded: np.ndarray, x: np.ndarray, y: np.ndarray) -> np.ndarray:
    """(texels, channels) f32: Catmull-Rom interpolation at places in texels of the image inside of the margin."""
    height, width, channels = padded.shape
    # In the margin's texels, from the centre of the first one; what lies outside of the image is at its edge.
    x = np.clip(x, 0, width - 2 * MARGIN) + (MARGIN - 0.5)
    y = np.clip(y, 0, height - 2 * MARGIN) + (MARGIN - 0.5)
    column, row = x.astype(np.int64), y.astype(np.int64)
    across, down = _catmull_rom(x - column), _catmull_rom(y - row)
    texels = padded.reshape(-1, channels)
    corner = (row - 1) * width + (column - 1)
    total = np.zeros((len(x), channels), np.float32)
    found = np.empty_like(total)
    for j in range(4):
        for i in range(4):
            np.take(texels, corner + (j * width + i), axis=0, out=found, mode="clip")
            found *= (across[i] * down[j])[:, None]
            total += found
    return total


def _catmull_rom(t: np.ndarray) -> list[np.ndarray]:
    """The weights of the four texels around a place, which lies the fraction t from the second to the third."""
    t = t.astype(np.float32)
    half = np.float32(0.5)
    return [
        half * t * (t * (2 - t) - 1),
        half * (t * t * (3 * t - 5) + 2),
        half * t * (t * (4 - 3 * t) + 1),
        half * t * t * (t - 1),
    ]


def turned(encoded: np.ndarray, jacobian: np.ndarray, down: bool) -> np.ndarray:
    """Normals, from 0 to 1, turned back by the angle that a map turns a feature by, mirrored if the map mirrors, and of
    length 1. `jacobian` is the map's, row by row."""
    normals = encoded.astype(np.float64) * 2 - 1
    sign = -1.0 if down else 1.0
    a, b, c, d = (jacobian[..., k].astype(np.float64) for k in range(4))
    mirrored = np.where(a * d < b * c, -1.0, 1.0)
    length = np.sqrt(a * a + c * c)
    cosine = np.divide(a, length, out=np.ones_like(a), where=length > 0)
    sine = np.divide(c, length, out=np.zeros_like(c), where=length > 0)
    x, y = normals[..., 0], normals[..., 1] * sign
    turned = np.stack([cosine * x + sine * y, (cosine * y - sine * x) * sign * mirrored, normals[..., 2]], axis=-1)
    size = np.linalg.norm(turned, axis=-1, keepdims=True)
    turned = np.divide(turned, size, out=np.broadcast_to([0.0, 0.0, 1.0], turned.shape).copy(), where=size > 1e-6)
    return turned / 2 + 0.5
