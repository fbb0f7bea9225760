"""The built-in scene mug_to_jug, glazed: its rigidity map says where studs and emblems are."""

import numpy as np
import paint
from PIL import Image
from scipy.ndimage import label


def glaze(model, size):
    """Cobalt glaze, studs of gold, emblems of cream; the rigidity stays the scene's own."""
    surface = paint.Surface(model, 1001, size)
    map = model.rigidity[1001]
    part, count = label(map > 0.02)
    part -= 1
    rows, columns = np.nonzero(part >= 0)
    which, weight = part[rows, columns], map[rows, columns]
    total = np.bincount(which, weight, count)
    peak = np.zeros(count)
    np.maximum.at(peak, which, weight)
    middle = np.stack([np.bincount(which, weight * a, count) for a in (columns + 0.5, rows + 0.5)], -1) / total[:, None]
    off = np.stack([columns + 0.5, rows + 0.5], -1) - middle[which]
    moments = np.einsum("ni,nj->nij", off, off) * weight[:, None, None]
    spread = np.stack([np.bincount(which, moments[:, i, j], count) for i in (0, 1) for j in (0, 1)], -1)
    inverse = np.linalg.inv((spread / total[:, None]).reshape(-1, 2, 2))

    grown = part.copy()
    for _ in range(3):
        for axis in (0, 1):
            for step in (1, -1):
                grown = np.where(grown < 0, np.roll(grown, step, axis), grown)
    ratio = np.where(part >= 0, map / np.append(peak, 1)[part], 0).astype(np.float32)
    fine = np.asarray(Image.fromarray(ratio).resize((size, size), Image.BICUBIC))[surface.here]
    place = surface.uv * map.shape[::-1]
    place[:, 1] = map.shape[0] - place[:, 1]
    number = grown[np.clip(place[:, 1].astype(int), 0, None), np.clip(place[:, 0].astype(int), 0, None)]
    off = place - np.concatenate([middle, [[1e6, 1e6]]])[number]
    distance = np.sqrt(np.einsum("ni,nij,nj->n", off, np.concatenate([inverse, inverse[:1]])[number], off)) / 2

    points = surface.points
    inside = np.clip((fine - 0.5) * 3.0 + 0.5, 0, 1)
    emblem = np.append(total > 350, False)[number]
    soft = np.append(peak < 0.9, False)[number]
    cloud = paint.noise(points, 0.8, 3)
    base = paint.mixed([0.012, 0.055, 0.21], [0.02, 0.11, 0.33], 0.5 + 0.5 * cloud)
    rim = paint.edge(np.abs(surface.uv[:, 1] - 0.938), 0.010, 0.003) * (surface.uv[:, 1] > 0.54)
    base = paint.mixed(base, [0.75, 0.68, 0.52], rim)
    metal = paint.mixed([0.80, 0.50, 0.13], [0.86, 0.80, 0.66], emblem.astype(float))
    metal = paint.mixed(metal, [0.55, 0.13, 0.06], soft.astype(float))
    ring = np.exp(-(((distance - 0.62) / 0.07) ** 2)) * emblem
    metal = paint.mixed(metal, [0.16, 0.08, 0.05], 0.8 * ring)
    groove = np.clip(fine / 0.35, 0, 1) * (1 - inside)
    colour = paint.mixed(base * (1 - 0.5 * groove[:, None]), metal, inside)
    radius = np.sqrt(np.append(total, 0)[number] / np.pi) / map.shape[0] * 6.4
    dome = np.sqrt(np.clip(1.05 - np.minimum(distance, 1.0) ** 2, 0, 1))
    height = inside * np.where(emblem, 0.035 + 0.028 * dome - 0.020 * ring, 0.02 + 0.40 * radius * dome)
    zero = {1001: surface.image(height)}
    return paint.Paint({1001: surface.image(colour)}, zero, {1001: surface.image(inside)})
