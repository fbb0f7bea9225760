"""A square with fruit, dense at the top and sparse at the bottom, that is pressed together horizontally."""

import numpy as np
from shapes import Builder, rectangle, smooth

CELLS, WIDTH = 48, 0.5
DENSE = 0.57  # above this v the rows are dense
KINDS = "strawberry", "banana", "orange"


def build(width=WIDTH):
    builder = Builder()
    uv = rectangle([0.02, 0.02], [0.98, 0.98], CELLS + 1, CELLS + 1)
    index = builder.vertices(np.concatenate([uv, 0 * uv[..., :1]], -1))
    builder.chart(index, uv)
    return builder.model("fruit", lambda p, k: (p - [0.5, 0, 0]) * [width, 1, 1] + [0.5, 0, 0], ["pressed together"])


def places():
    """Kind, centre, size and turn of each fruit: rows that become sparser downwards."""
    out, k = [], 0
    random = np.random.default_rng(12)
    for y, count, size in (0.905, 7, 0.052), (0.785, 6, 0.055), (0.655, 6, 0.055), (0.49, 4, 0.060), (0.30, 3, 0.064), (
        0.115, 2, 0.066,
    ):  # fmt: skip
        for i in range(count):
            x = 0.5 + (i - (count - 1) / 2) * 0.88 / count
            out.append(
                (KINDS[k % 3], np.array([x, y + random.uniform(-0.006, 0.006)]), size, random.uniform(-0.5, 0.5))
            )
            k += 1
        k += 1
    return out


def fruit(size):
    """Colour (size, size, 3), and for each kind which share of a texel it covers, first row at v = 1."""
    v, u = (np.mgrid[:size, :size] + 0.5) / size
    v = 1 - v
    weave = 0.5 + 0.25 * np.sin(2 * np.pi * 40 * u) * np.sin(2 * np.pi * 40 * v)
    cloth = ((np.floor(u * 20) + np.floor(v * 20)) % 2)[..., None] * 0.06
    colour = np.array([0.70, 0.83, 0.80]) * (0.93 + 0.05 * weave[..., None]) + cloth
    masks = {kind: np.zeros((size, size)) for kind in KINDS}
    soft = 1.6 / size

    def put(weight, value):
        colour[...] += (np.asarray(value) - colour) * weight[..., None]

    for kind, centre, r, turn in places():
        s, c = np.sin(turn), np.cos(turn)
        x, y = u - centre[0], v - centre[1]
        x, y = (c * x + s * y) / r, (c * y - s * x) / r
        near, pixel = (np.abs(x) < 1.5) & (np.abs(y) < 1.5), soft / r

        def inside(d, pixel=pixel, near=near):
            return np.clip(-d / pixel + 0.5, 0, 1) * near

        light = 0.80 + 0.30 * np.clip(-0.6 * x + 0.6 * y, -1, 1)
        radius = np.hypot(x, y)
        if kind == "orange":
            shape = inside(radius - 0.92)
            put(inside(radius - 0.99), [0.45, 0.16, 0.02])
            put(shape, np.array([0.97, 0.55, 0.08]) * light[..., None])
            put(inside(radius - 0.76), [1.0, 0.86, 0.55])
            wedge = np.abs(np.mod(np.arctan2(y, x) * 9 / (2 * np.pi), 1) - 0.5)
            put(inside(radius - 0.70) * smooth(0.48, 0.40, wedge) * smooth(0.06, 0.14, radius), [0.98, 0.58, 0.10])
            masks[kind] = np.maximum(masks[kind], inside(radius - 1.0))
        elif kind == "strawberry":
            heart = np.hypot(x * (1.02 + 0.55 * np.clip(-y + 0.1, 0, 2)), y + 0.02) - 0.88 - 0.10 * np.abs(x)
            put(inside(heart - 0.06), [0.32, 0.02, 0.03])
            put(inside(heart), np.array([0.86, 0.09, 0.12]) * light[..., None])
            sx, sy = np.mod(x * 3.2 + 0.5 * np.floor(y * 3.2), 1) - 0.5, np.mod(y * 3.2, 1) - 0.5
            put(inside(heart + 0.12) * np.clip((0.15 - np.hypot(sx * 1.5, sy)) * 12, 0, 1), [1.0, 0.84, 0.40])
            leaf = np.hypot(x, y - 0.80) - (0.26 + 0.22 * np.abs(np.cos(2.5 * np.arctan2(y - 0.80, x) + 0.2)))
            put(inside(leaf), [0.16, 0.50, 0.13])
            masks[kind] = np.maximum(masks[kind], np.maximum(inside(heart - 0.07), inside(leaf)))
        else:
            ring, angle = np.hypot(x, y - 0.85) - 1.22, np.arctan2(x, 0.85 - y)
            thick = 0.34 * np.sqrt(np.clip(1 - (angle / 0.92) ** 2, 0, 1)) + 0.05
            shape = np.where(np.abs(angle) < 0.95, np.abs(ring) - thick, 1.0)
            put(inside(shape - 0.07), [0.42, 0.28, 0.03])
            put(inside(shape), np.array([0.99, 0.83, 0.22]) * (0.86 + 0.26 * np.clip(-ring * 3, -1, 1))[..., None])
            put(inside(np.maximum(shape, 0.80 - np.abs(angle))), [0.30, 0.20, 0.05])
            masks[kind] = np.maximum(masks[kind], inside(shape - 0.08))
    return np.clip(colour, 0, 1), masks
