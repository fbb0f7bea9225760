"""The MakeHuman face of the assets beside the checkout, painted with stones that lie in its skin."""

import numpy as np
import paint
import shapes


def load(folder):
    return shapes.read(folder)


def stones(model, size, seed=3):
    """Grey stones in brown skin; eyes' sockets and the mouth have none. Sets the model's rigidity."""
    surface = paint.Surface(model, 1001, size)
    points, uv = surface.points, surface.uv
    head = (uv[:, 0] > 0.63) & (uv[:, 1] > 0.148)
    inner = points[surface.inner(size // 170) & head]
    x, y, z = inner.T
    eyes = np.hypot((np.abs(x) - 0.28) / 0.24, (y - 6.80) / 0.13) < 1
    lips = np.hypot(x / 0.36, (y - 6.22) / 0.10) < 1
    front = inner[(z > -0.1) & ~(z > 0.6) | ((z > 0.6) & ~eyes & ~lips)]
    centres, radii = paint.scattered(front, [0.066, 0.051, 0.038, 0.027], 1.17, seed, tries=5000)
    # Stones are longer than wide, each in a direction of its own, and rough.
    random = np.random.default_rng(seed)
    ways = random.normal(size=(len(radii), 3))
    ways /= np.linalg.norm(ways, axis=1, keepdims=True)
    long = 1 - random.uniform(0.02, 0.22, len(radii))

    def stretch(offset, k):
        return offset - (1 - long[k]) * (offset @ ways[k])[:, None] * ways[k]

    distance, number = paint.nearest(points, centres, radii, 1.45, stretch)
    rough, grain = paint.noise(points, 0.07, 1, 3), paint.noise(points, 0.025, 2, 2)
    distance = distance * (1 + 0.07 * rough)
    distance[~head] = np.inf
    inside = paint.edge(distance, 1.0, 0.14)
    shade = np.append(random.uniform(0, 1, len(radii)), 0)[number]
    stone = paint.mixed([0.25, 0.25, 0.235], [0.62, 0.58, 0.50], shade) * (1 + 0.20 * grain + 0.10 * rough)[:, None]
    skin = paint.mixed([0.30, 0.135, 0.085], [0.44, 0.215, 0.135], 0.5 + 0.5 * paint.noise(points, 0.5, 3))
    skin *= (1 + 0.06 * grain)[:, None]
    skin[~head] = [0.10, 0.030, 0.025]
    groove = np.exp(-(((distance - 1.10) / 0.13) ** 2))
    colour = paint.mixed(skin * (1 - 0.60 * groove[:, None]), stone, inside)
    dome = np.sqrt(np.clip(1.03 - distance**2, 0, 1)) ** 0.7
    radius = np.append(radii, 0)[number]
    height = radius * inside * (0.40 * dome + 0.05 * rough + 0.03 * grain) - 0.005 * groove
    height += 0.0016 * grain * (1 - inside) * head
    model.rigidity = {1001: surface.image(paint.edge(distance, 1.12, 0.12))}
    return paint.Paint({1001: surface.image(colour)}, {1001: surface.image(height)}, model.rigidity)
