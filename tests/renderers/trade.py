"""Draws docs/images/trade.png: what the skin between studs pays for their shape, and what helps.

    trade.py OUT.png
"""

import sys

import numpy as np
import vrtm
from PIL import Image, ImageDraw, ImageFont

SIZE, CELLS = 1024, 48
STRETCH = 1.6  # of the sheet, from left to right
RADIUS = 0.052
PANEL, STRIP, GAP = (620, 388), 78, 12
# What of the sheet is shown: the middle, away from its borders, which do not move.
LOW, HIGH = 0.2, 0.8
TONES = {"skin": (0.16, 0.34, 0.36), "line": (0.62, 0.78, 0.76), "stud": (0.97, 0.78, 0.38), "rim": (0.05, 0.12, 0.14)}


def studs(apart):
    """The distance of each texel to the nearest stud's centre, in radii; rows are staggered."""
    at = (np.arange(SIZE) + 0.5) / SIZE
    u, v = np.meshgrid(at, at)
    nearest = np.full((SIZE, SIZE), 9.0)
    for row in range(-2, round(1 / apart) + 2):
        for column in range(-2, round(1 / apart) + 2):
            x, y = (column + 0.5 + 0.5 * (row % 2)) * apart, (row + 0.5) * apart * 0.87
            if 0.07 < x < 0.93 and 0.07 < y < 0.93:
                nearest = np.minimum(nearest, np.hypot(u - x, v - y) / RADIUS)
    return nearest


def painted(distance, mottled):
    """Studs on skin with a grid of lines, or with spots, (SIZE, SIZE, 3)."""
    def mixed(one, other, weight):
        return one + (np.array(other) - one) * weight[..., None]
    at = (np.arange(SIZE) + 0.5) / SIZE * CELLS
    near = np.abs(at - np.rint(at)) * SIZE / CELLS
    line = np.clip(1.6 - near, 0, 1)
    lines = np.maximum(line[None], line[:, None])
    if mottled:
        grain = np.fft.rfft2(np.random.default_rng(2).normal(size=(SIZE, SIZE)))
        grain *= np.exp(-((np.hypot(np.fft.fftfreq(SIZE)[:, None], np.fft.rfftfreq(SIZE)[None]) * 11) ** 2))
        grain = np.fft.irfft2(grain)
        lines = 0.8 * np.clip(0.3 + 0.35 * grain / grain.std(), 0, 1)
    colour = mixed(np.broadcast_to(TONES["skin"], (SIZE, SIZE, 3)), TONES["line"], lines)
    colour = mixed(colour, TONES["rim"], np.clip((1.08 - distance) * 40 + 0.5, 0, 1))
    return mixed(colour, TONES["stud"], np.clip((0.95 - distance) * 40 + 0.5, 0, 1))


def solved(distance):
    """The redirection, (SIZE, SIZE, 2), bottom row first."""
    n = 64
    x, y = np.meshgrid(np.linspace(0, 1, n + 1), np.linspace(0, 1, n + 1))
    rest = np.stack([x.ravel(), y.ravel(), 0 * x.ravel()], -1).astype(np.float32)
    first = (np.arange(n)[:, None] * (n + 1) + np.arange(n)).ravel()
    quads = np.stack([first, first + 1, first + n + 2, first + n + 1], -1).astype(np.uint32)
    with vrtm.Device("cpu") as device:
        asset = vrtm.Asset(device, rest, quads.ravel(), face_counts=np.full(n * n, 4), uvs=rest[quads.ravel()][:, :2])
        tile = asset.tile(1001)
        tile.set_settings(grid_width=512, grid_height=512)
        tile.set_rigidity(np.clip((1.1 - distance) * 20 + 0.5, 0, 1).astype(np.float32), origin="bottom")
        asset.solve(rest * np.float32([STRETCH, 1, 1]))
        return tile.fetch("redirection", SIZE, channels=2, origin="bottom")


def sampled(image, uv):
    at = np.clip(uv * SIZE - 0.5, 0, SIZE - 1.001)
    x, y = at[..., 0].astype(int), at[..., 1].astype(int)
    s, t = (at[..., 0] - x)[..., None], (at[..., 1] - y)[..., None]
    low, high = (image[y + k, x] * (1 - s) + image[y + k, x + 1] * s for k in (0, 1))
    return low * (1 - t) + high * t


def shown(colour, map):
    """The stretched sheet's middle, four samples a pixel."""
    width, height = 2 * PANEL[0], 2 * PANEL[1]
    x, y = np.meshgrid((np.arange(width) + 0.5) / width, 1 - (np.arange(height) + 0.5) / height)
    # As high as it is wide, but for the stretch.
    span = (HIGH - LOW) * STRETCH * height / width
    uv = np.stack([LOW + x * (HIGH - LOW), 0.5 + (y - 0.5) * span], -1)
    picture = sampled(colour, sampled(map, uv)).reshape(PANEL[1], 2, PANEL[0], 2, 3).mean((1, 3))
    return Image.fromarray(np.rint(255 * np.clip(picture, 0, 1)).astype(np.uint8))


def longer(map, distance):
    """Lengths from left to right over those at rest: of the studs, and of the tenth of the skin that is longest."""
    middle = slice(SIZE // 4, -SIZE // 4)
    apart = STRETCH / (np.gradient(map[..., 0], axis=1)[middle, middle] * SIZE)
    here = sampled(distance[..., None], map[middle, middle])[..., 0]
    return np.median(apart[here < 0.8]), np.quantile(apart[(here > 1.2) & (here < 8)], 0.9)


def main(out):
    dense, loose = studs(0.135), studs(0.19)
    identity = np.stack(np.meshgrid(*2 * [(np.arange(SIZE) + 0.5) / SIZE]), -1)
    kept = solved(dense)
    panels = []
    for title, distance, map, mottled in (
        ("its own UVs: studs stretch with the skin", dense, identity, False),
        ("vrtm: studs stay round, the skin pays", dense, kept, False),
        ("what helps: more room between studs", loose, solved(loose), False),
        ("what helps: a skin without lines", dense, kept, True),
    ):
        text = "studs {:.2f}, skin up to {:.1f} times as long as at rest".format(*longer(map, distance))
        print(title, text)
        panels.append((title, text, painted(distance, mottled), map))
    width, height = 2 * PANEL[0] + GAP, 2 * (PANEL[1] + STRIP)
    sheet = Image.new("RGB", (width, height), "white")
    draw, large, small = ImageDraw.Draw(sheet), ImageFont.load_default(26), ImageFont.load_default(19)
    for k, (title, text, colour, map) in enumerate(panels):
        left, top = k % 2 * (PANEL[0] + GAP), k // 2 * (PANEL[1] + STRIP)
        draw.text((left + PANEL[0] / 2, top + 24), title, "black", large, anchor="mm")
        draw.text((left + PANEL[0] / 2, top + 56), text, (90, 90, 90), small, anchor="mm")
        sheet.paste(shown(colour, map), (left, top + STRIP))
    sheet.quantize(96, dither=Image.Dither.NONE).save(out, optimize=True)


if __name__ == "__main__":
    main(*sys.argv[1:])
