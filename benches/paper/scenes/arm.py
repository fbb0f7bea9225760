"""An arm along x that bends at its elbow, where its muscle swells; the seam is behind."""

import numpy as np
from shapes import Builder, bump, closed, rectangle

ALONG, AROUND, REACH, ARC = 121, 64, 2.6, 0.9
NOTES = ["bent"]


def girth(x):
    return 0.50 - 0.05 * x + 0.06 * bump(-1.3, 1.3, x) + 0.06 * bump(1.0, 1.1, x)


def build():
    builder = Builder()
    x = np.linspace(-REACH, REACH, ALONG)[:, None]
    angle = 2 * np.pi * np.arange(AROUND) / AROUND
    rows = np.broadcast_arrays(x, girth(x) * np.sin(angle), -girth(x) * np.cos(angle))
    index = closed(builder.vertices(np.stack(rows, -1)))
    builder.chart(index[:, ::-1], rectangle([0.03, 0.03], [0.97, 0.62], ALONG, AROUND + 1))
    return builder.model("sleeve", lambda points, k: pose(points, 1.0), NOTES)


def pose(points, share):
    """Bends by 1.9 about z, along an arc around the elbow, which is at x = 0."""
    turn = 1.9 * share + 1e-6
    x, y, z = points.T
    swell = 1 + 0.42 * share * bump(-1.35, 1.15, x)
    y, z = y * swell, z * swell
    turned, radius = turn * np.clip((x + ARC) / (2 * ARC), 0, 1), 2 * ARC / turn
    before, beyond = np.minimum(x + ARC, 0), np.maximum(x - ARC, 0)
    sin, cos = np.sin(turned), np.cos(turned)
    return np.stack([before + radius * sin + beyond * cos - sin * y,
                     radius * (1 - cos) + beyond * sin + cos * y, z], -1)  # fmt: skip
