"""Figure 5: a square with fruit, pressed together, with fruit of different rigidity."""

import numpy as np
import paint
import sheet
import solve
from PIL import Image
from scenes import square

TITLES = "original UVs", "all fruit 100 %", "bananas 50 %", "bananas, strawberries 25 %"
SHARES = {}, {}, {"banana": 0.5}, {"banana": 0.25, "strawberry": 0.25}
DENSITY = {"orientation_density": 0.15}


def drawn(colour, width, height, map=None):
    """The square as it looks in the pose: of `width` by `height` pixels, each the mean of 3 by 3 lookups."""
    n = 3
    v, u = np.mgrid[: n * height, : n * width]
    uv = np.stack([0.02 + 0.96 * (u + 0.5) / (n * width), 0.98 - 0.96 * (v + 0.5) / (n * height)], -1)
    if map is not None:
        uv = paint.warp.bilinear(map, uv)
    seen = paint.warp.bilinear(colour, uv).reshape(height, n, width, n, -1).mean((1, 3))
    return Image.fromarray(np.rint(255 * np.clip(seen, 0, 1)).astype(np.uint8).squeeze())


def width(mask, map):
    """Width of a kind of fruit in the pose, as a share of its width at rest: from the area that it covers, which the
    pose and the map change."""
    v, u = (np.mgrid[:512, :512] + 0.5) / 512
    at = np.stack([u, 1 - v], -1)
    return float(paint.warp.bilinear(mask[..., None], paint.warp.bilinear(map, at)).mean() / mask.mean() * square.WIDTH)


def turns(rigidity, map):
    """By how many degrees fruit is turned in the pose, RMS, in the dense rows and in the sparse ones."""
    n = len(map)
    across, down = np.gradient(map, 1 / n, axis=1), np.gradient(map, 1 / n, axis=0)
    # From the texture to the pose: the inverse of the map's Jacobian, then the pressing together.
    a, b, c, d = across[..., 0], -down[..., 0], across[..., 1], -down[..., 1]
    turn = np.degrees(np.arctan2(-c - square.WIDTH * -b, square.WIDTH * d + a))
    rigid = paint.warp.bilinear(rigidity[..., None], map)[..., 0] > 0.2
    dense = map[..., 1] > square.DENSE
    return [float(np.sqrt(np.mean(turn[rigid & part] ** 2))) for part in (dense, ~dense)]


def data(quick=False):
    """For each column the rigidity, and for both rules (with density, without) the solution."""
    size, grid = (512, 128) if quick else (1536, 512)
    colour, masks = square.fruit(size)
    model, out = square.build(), []
    for shares in SHARES[1:]:
        rigidity = sum(masks[kind] * shares.get(kind, 1) for kind in square.KINDS)
        model.rigidity = {1001: np.clip(rigidity, 0, 1)}
        pair = [solve.solved(model, model.frames[0], grid, settings=s) for s in (DENSITY, None)]
        out.append((model.rigidity[1001], pair))
    return model, colour, masks, out


def make(options):
    model, colour, masks, columns = data()
    model.rigidity = {1001: columns[0][0]}
    model.write(options.scenes / model.name)
    high = 380
    narrow = round(high * square.WIDTH)
    rows, figures = [[], [], []], []
    white = columns[0][0][..., None]
    for row, image in zip(rows, (colour, colour, white)):
        row.append((TITLES[0] if row is rows[0] else "", drawn(image, narrow, high)))
    for title, (rigidity, pair) in zip(TITLES[1:], columns):
        images = [drawn(colour, narrow, high, solved.maps[1001]) for solved in reversed(pair)]
        images.append(drawn(rigidity[..., None], narrow, high, pair[1].maps[1001]))
        for row, image in zip(rows, images):
            row.append((title if row is rows[0] else "", image))
        for solved, rule in zip(reversed(pair), ("without", "with")):
            line = {"rigidity": title, "rule": rule, "before": solved.before, "after": solved.after}
            line |= {kind: width(masks[kind], solved.maps[1001]) for kind in square.KINDS}
            figures.append(line | {"turns": turns(rigidity, solved.maps[1001])})
    for row, image in zip(rows, (colour, colour, white)):
        row.append(("at rest" if row is rows[0] else "", drawn(image, high, high)))
    return {"paper_5.jpg": sheet.sheet(rows)}, figures
