"""A torus with stones: it swells on one side, shrinks on the other, and bends out of its plane."""

import numpy as np
import paint
from shapes import Builder, closed, rectangle

LARGE, SMALL, FRAMES = 1.0, 0.42, 24
AROUND, ACROSS = 144, 64


def point(theta, phi, amount=0.0):
    """A point of the torus; `amount` is 0 at rest and 1 at the largest deformation."""
    swell = 1 + amount * (0.62 * np.exp(-(((np.mod(theta - 1.2 + np.pi, 2 * np.pi) - np.pi) / 0.75) ** 2)))
    swell = swell - amount * 0.30 * np.exp(-(((np.mod(theta - 4.4 + np.pi, 2 * np.pi) - np.pi) / 0.9) ** 2))
    radius = LARGE + SMALL * swell * np.cos(phi)
    height = SMALL * swell * np.sin(phi) + 0.30 * amount * np.sin(2 * theta - 0.8)
    return np.stack([radius * np.cos(theta), height, radius * np.sin(theta)], -1)


def build():
    theta, phi = (2 * np.pi * np.arange(n) / n for n in (AROUND, ACROSS))
    theta, phi = np.meshgrid(theta, phi, indexing="ij")
    angles = np.stack([theta, phi, 0 * phi], -1)
    builder = Builder()
    index = closed(builder.vertices(angles))
    index = np.concatenate([index, index[:1]])[:, ::-1]
    # The seams are below and at the side of the ring that is not looked at.
    builder.chart(index, rectangle([0.02, 0.28], [0.98, 0.72], AROUND + 1, ACROSS + 1))
    amount = 0.5 - 0.5 * np.cos(2 * np.pi * np.arange(FRAMES) / FRAMES)

    def where(a, k):
        return point(a[:, 0] - 2.2, a[:, 1] - np.pi / 2 - 0.6, amount[k])

    model = builder.model("torus_stones", where, [f"swells by {a:.2f}" for a in amount])
    model.rest = model.frames[0].copy()
    return model


def stones(model, size):
    """Pale stones on clay; returns the paint, and sets the model's rigidity."""
    surface = paint.Surface(model, 1001, size)
    points = surface.points
    inner = points[surface.inner(size // 48)]
    centres, radii = paint.scattered(inner, [0.105, 0.08, 0.06], 1.22, 5, tries=3000)
    rough = paint.noise(points, 0.09, 1, 2)
    distance, number = paint.nearest(points, centres, radii)
    distance = distance * (1 + 0.05 * rough)
    shade = np.random.default_rng(2).uniform(0, 1, (len(radii) + 1, 1))
    stone = paint.mixed([0.46, 0.41, 0.32], [0.66, 0.63, 0.55], shade[number][:, 0]) * (1 + 0.10 * rough[:, None])
    clay = paint.mixed([0.36, 0.085, 0.045], [0.50, 0.16, 0.07], 0.5 + 0.5 * paint.noise(points, 0.35, 3))
    inside = paint.edge(distance, 1.0, 0.10)
    groove = np.exp(-(((distance - 1.08) / 0.10) ** 2))
    colour = paint.mixed(clay * (1 - 0.45 * groove[:, None]), stone, inside)
    dome = np.sqrt(np.clip(1.02 - distance**2, 0, 1)) ** 0.8
    height = np.append(radii, 0)[number] * (0.42 * dome * inside + 0.025 * rough * inside) - 0.008 * groove
    height += 0.004 * paint.noise(points, 0.03, 4, 2) * (1 - inside)
    model.rigidity = {1001: surface.image(paint.edge(distance, 1.10, 0.10))}
    return paint.Paint({1001: surface.image(colour)}, {1001: surface.image(height)}, model.rigidity)
