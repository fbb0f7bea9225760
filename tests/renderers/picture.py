"""Textures in which an error of a texel shows, and how pictures are compared."""

import numpy as np
import OpenImageIO as oiio

import warp


def texture(rigidity, size, seed=1):
    """Studs with rings drawn from the rigidity map, on a fine checker of random colours.

    No two places look alike, so that a lookup in the wrong place shows, also one that is wrong by a texel: edges of the
    checker are two texels of a blend wide, and its fields eight.
    """
    uv = warp.centres(size, size)
    r = warp.bilinear(soft(rigidity, 6 * rigidity.shape[0] / 256), uv)[..., 0]
    colours = np.random.default_rng(seed).uniform(0.2, 0.75, (size // 8, size // 8, 3))
    checker = np.repeat(np.repeat(colours, 8, 0), 8, 1)
    skin = checker * 0.55 + np.array([0.62, 0.42, 0.30]) * 0.45
    rings = 0.5 + 0.5 * np.sin(2 * np.pi * 5 * r)
    stud = np.array([0.15, 0.35, 0.65]) * rings[..., None] + np.array([0.95, 0.93, 0.85]) * (1 - rings[..., None])
    stud = stud * 0.8 + checker * 0.2
    mix = np.clip((r - 0.5) * size / 64 + 0.5, 0, 1)[..., None]
    picture = stud * mix + skin * (1 - mix)
    return soft(picture, 1.0)


def soft(pixels, texels):
    """Blurred by a Gaussian that is so many texels wide."""
    kernel = oiio.ImageBufAlgo.make_kernel("gaussian", 3 * texels, 3 * texels)
    image = oiio.ImageBuf(np.ascontiguousarray(pixels.astype(np.float32)))
    return oiio.ImageBufAlgo.convolve(image, kernel).get_pixels(oiio.FLOAT).astype(np.float64)


class Difference:
    """Of two pictures in 255ths, over the pixels that the mesh covers fully in both."""

    def __init__(self, a, b):
        inside = (a[..., 3] > 0.999) & (b[..., 3] > 0.999)
        if inside.mean() < 0.05:
            raise ValueError("nearly nothing is to be seen")
        worst = np.abs(a[..., :3] - b[..., :3]).max(-1)[inside] * 255
        self.mean, self.p99, self.max = worst.mean(), np.percentile(worst, 99), worst.max()

    def __str__(self):
        return f"{self.mean:.2f} / {self.p99:.1f} / {self.max:.0f}"
