"""A long creature over six UDIM tiles: tail, hind body, middle and neck with plates and scales, head and legs without.

Its axis is z, the head in front. A pose bends, rolls and stretches the axis; the body follows its frames.
"""

from itertools import pairwise

import numpy as np
import paint
from shapes import Builder, bump, closed, rectangle, smooth

# UDIM number, and from where to where along the axis, as z at rest.
PARTS = {1001: (-5.6, -1.5), 1002: (-1.5, 0.0), 1003: (0.0, 1.5), 1004: (1.5, 2.9), 1005: (2.9, 4.3)}
LEGS, RIGID = 1006, (1001, 1002, 1003, 1004)
AROUND, STEP = 72, 0.045
NOTES = ["bends", "rolls", "stretches", "bends and stretches"]
# Bend, roll, stretch.
POSES = [(1.0, 0.0, 0.0), (0.15, 1.0, 0.0), (0.0, 0.0, 1.0), (0.9, 0.3, 0.7)]


def girth(z):
    """Half width and half height of the body."""
    r = 0.05 + 0.62 * smooth(-5.8, -0.4, z) ** 1.15 - 0.27 * smooth(0.9, 2.5, z) + 0.10 * bump(3.15, 0.75, z)
    r = r * np.sqrt(np.clip((4.36 - z) / 0.75, 0, 1) * 0.9 + 0.1 * (z < 3.6))
    snout = smooth(2.9, 4.2, z)
    return r * (1.08 + 0.10 * snout), r * (0.90 - 0.18 * snout)


def middle(z):
    """Height of the body's axis."""
    return 0.95 + 0.30 * smooth(1.2, 3.0, z) - 0.62 * smooth(-1.6, -4.5, z)


def smooth_legs(t):
    return 0.25 - 0.10 * smooth(0.0, 0.55, t) + 0.05 * smooth(0.72, 0.95, t)


def build():
    builder = Builder()
    cuts = sorted({z for part in PARTS.values() for z in part})
    along = np.concatenate([np.linspace(a, b, round((b - a) / STEP) + 1)[:-1] for a, b in pairwise(cuts)])
    along = np.append(along, cuts[-1])
    angle = 2 * np.pi * np.arange(AROUND) / AROUND
    width, height = (a[:, None] for a in girth(along))
    # A flatter belly than back.
    up = -np.cos(angle)
    up = np.where(up < 0, 0.82 * up, up)
    y = middle(along)[:, None] + height * up
    body = builder.vertices(np.stack([width * np.sin(angle), y, np.repeat(along[:, None], AROUND, 1)], -1))
    for udim, (a, b) in PARTS.items():
        rows = np.flatnonzero((along > a - 1e-9) & (along < b + 1e-9))
        tall = 0.94 if udim != 1001 else 0.66
        low = np.array([udim - 1001 + 0.03, 0.03])
        builder.chart(closed(body[rows]), rectangle(low, np.add(low, [0.94, tall]), len(rows), AROUND + 1))
    builder.fan(body[0][::-1], [0, middle(-5.6), -5.64], [0.9, 0.85], 0.03)
    builder.fan(body[-1], [0, middle(4.3), 4.33], [4.5, 0.985], 0.012)
    for k, (side, z) in enumerate([(1, 1.05), (-1, 1.05), (1, -1.0), (-1, -1.0)]):
        leg(builder, k, side, z)
    return builder.model("long_creature", lambda points, k: pose(points, *POSES[k]), NOTES)


def leg(builder, k, side, z):
    """A bent leg with a flat foot."""
    t = np.linspace(0, 1, 33)
    knots = np.array(
        [[0.30, 0.85, 0], [0.72, 0.80, 0.02], [0.86, 0.42, -0.10], [0.94, 0.14, -0.02], [1.02, 0.055, 0.30]]
    )
    path = np.stack([np.interp(t, np.linspace(0, 1, 5), knots[:, i]) for i in range(3)], -1)
    for _ in range(12):
        path[1:-1] = (path[:-2] + 2 * path[1:-1] + path[2:]) / 4
    ahead = np.gradient(path, axis=0)
    ahead /= np.linalg.norm(ahead, axis=1, keepdims=True)
    one = np.cross(ahead, [0.4, 0, 1.0])
    one /= np.linalg.norm(one, axis=1, keepdims=True)
    two = np.cross(ahead, one)
    angle = 2 * np.pi * np.arange(24) / 24
    foot = smooth(0.78, 0.95, t)
    wide, flat = smooth_legs(t) * (1 + 0.15 * foot), smooth_legs(t) * (1 - 0.62 * foot)
    ring = (
        np.cos(angle)[None, :, None] * (wide[:, None] * one)[:, None]
        + np.sin(angle)[None, :, None] * (flat[:, None] * two)[:, None]
    )
    points = (path[:, None] + ring) * [side, 1, 1] + [0, 0, z]
    index = builder.vertices(points)
    low = np.array([5.02 + 0.24 * k, 0.04])
    turned = closed(index)[:, ::-side]
    builder.chart(turned, rectangle(low, np.add(low, [0.22, 0.80]), 33, 25))
    tip = path[-1] * [side, 1, 1] + [0, 0, z + 0.06]
    builder.fan(index[-1][::side], tip, [5.13 + 0.24 * k, 0.92], 0.05)


def pose(points, bend, roll, stretch):
    """The body's frames along a curve: position, direction, roll, and how much longer and thinner it is there."""
    z = np.linspace(-5.9, 4.6, 2101)
    step = z[1] - z[0]
    longer = 1 + stretch * (1.0 * bump(0.7, 1.6, z) + 0.7 * bump(-2.4, 1.5, z))
    curve = bend * (0.95 * bump(-3.2, 2.0, z) - 0.95 * bump(0.2, 1.8, z) + 1.05 * bump(2.2, 1.1, z))
    turned = roll * (1.9 * smooth(0.4, 3.2, z) - 1.5 * smooth(-1.2, -4.2, z))
    lift = bend * 0.20 * bump(2.0, 1.2, z)
    mid = np.searchsorted(z, 0)
    yaw = np.cumsum(curve * step)
    yaw -= yaw[mid]
    pitch = np.cumsum(lift * step)
    pitch -= pitch[mid]
    ahead = np.stack([np.sin(yaw) * np.cos(pitch), np.sin(pitch), np.cos(yaw) * np.cos(pitch)], -1)
    path = np.cumsum(ahead * (longer * step)[:, None], 0)
    path -= path[mid]
    height = 0.95
    side = np.stack([np.cos(yaw), 0 * yaw, -np.sin(yaw)], -1)
    over = np.cross(ahead, side)

    def at(values):
        return np.stack([np.interp(points[:, 2], z, values[:, i]) for i in range(values.shape[1])], -1)

    thin = 1 / np.sqrt(np.interp(points[:, 2], z, longer))
    x, y = points[:, 0] * thin, (points[:, 1] - height) * (1 + (thin - 1) * 0.6)
    s, c = (f(np.interp(points[:, 2], z, turned)) for f in (np.sin, np.cos))
    x, y = c * x + s * y, c * y - s * x
    return at(path) + x[:, None] * at(side) + y[:, None] * at(over) + [0, height, 0]


def scales(model, size):
    """Bone plates along the back, pebbles on the flanks, bands of colour; the belly is pale."""
    colours, heights, rigidity = {}, {}, {}
    for udim in [*PARTS, LEGS]:
        surface = paint.Surface(model, udim, size)
        points = surface.points
        y, z = points[:, 1], points[:, 2]
        tall = girth(z)[1]
        up = (y - middle(z)) / np.maximum(tall, 0.03)
        if udim == LEGS:
            up = np.full(len(z), 0.2)
        fine = paint.noise(points, 0.5, 1, 3)
        back = smooth(-0.75, 0.1, up + 0.15 * fine)
        colour = paint.mixed([0.60, 0.50, 0.26], [0.055, 0.17, 0.13], back)
        band = smooth(0.15, 0.75, np.sin(2 * np.pi * z / 1.05 + 1.2 * fine)) * smooth(-0.3, 0.4, up)
        colour = paint.mixed(colour, [0.015, 0.055, 0.065], 0.75 * band)
        height = 0.010 * paint.noise(points, 0.07, 3, 2)
        if udim in RIGID:
            plates, sizes = features(surface, udim)
            distance, number = paint.nearest(points, plates, sizes, 1.5)
            distance = distance * (1 + 0.04 * paint.noise(points, 0.12, 4, 2))
            inside, shade = paint.edge(distance, 1.0, 0.14), np.random.default_rng(udim).uniform(-1, 1, len(sizes) + 1)
            large = (np.append(sizes, 0)[number] > 0.13).astype(float)
            bone = paint.mixed([0.24, 0.40, 0.22], [0.66, 0.52, 0.29], large) * (1 + 0.16 * shade[number])[:, None]
            bone = bone * (0.85 + 0.25 * paint.noise(points, 0.10, 5, 2)[:, None] * large[:, None])
            groove = np.exp(-(((distance - 1.10) / 0.12) ** 2))
            colour = paint.mixed(colour * (1 - 0.6 * groove[:, None]), bone, inside)
            dome = np.sqrt(np.clip(1.02 - distance**2, 0, 1))
            height = height * (1 - inside) + np.append(sizes, 0)[number] * (0.48 * dome * inside) - 0.008 * groove
            rigidity[udim] = surface.image(paint.edge(distance, 1.12, 0.12))
        if udim == 1005:
            for side in (1, -1):
                eye = np.linalg.norm(points - [0.315 * side, middle(3.45) + 0.16, 3.45], axis=1) / 0.105
                for at, value in (1.25, [0.02, 0.03, 0.02]), (0.95, [0.85, 0.45, 0.03]), (0.42, [0.01, 0.01, 0.01]):
                    colour = paint.mixed(colour, value, paint.edge(eye, at, 0.08))
                height = np.where(eye < 1.3, 0.085 * np.sqrt(np.clip(1 - (eye / 1.31) ** 2, 0, 1)), height)
            mouth = np.exp(-(((up + 0.10) / 0.05) ** 2)) * smooth(3.35, 3.6, z)
            colour, height = paint.mixed(colour, [0.02, 0.02, 0.02], mouth), height - 0.025 * mouth
        colours[udim], heights[udim] = surface.image(colour), surface.image(height)
    model.rigidity = rigidity
    blank = {u: rigidity.get(u, np.zeros((16, 16), np.float32)) for u in colours}
    return paint.Paint(colours, heights, blank)


def features(surface, udim):
    """A row of plates along the back's middle, and pebbles that fill the flanks."""
    a, b = PARTS[udim]
    rows, at = [], a + 0.16
    while at < b - 0.13:
        radius = 0.055 + 0.15 * smooth(-5.4, -0.6, at) - 0.035 * smooth(1.0, 2.6, at)
        if at + radius < b - 0.03 and at - radius > a + 0.02:
            rows.append((at, radius))
        at += 2.35 * radius
    plates = [(np.array([0, middle(z) + girth(z)[1], z]), r) for z, r in rows]
    inner = surface.inner(max(surface.size // 100, 2))
    up = (surface.points[:, 1] - middle(surface.points[:, 2])) / np.maximum(girth(surface.points[:, 2])[1], 0.03)
    free = surface.points[inner & (up > -0.45)]
    found = list(plates)
    for radius in [0.115, 0.085, 0.060, 0.042] if udim != 1001 else [0.085, 0.060, 0.042]:
        # Whole within the tile: borders of charts do not move.
        room = free[(free[:, 2] > a + 1.3 * radius) & (free[:, 2] < b - 1.3 * radius)]
        found += list(zip(*paint.scattered(room, [radius], 1.16, udim + round(1e4 * radius), found, tries=2500)))
    return np.stack([centre for centre, _ in found]), np.array([radius for _, radius in found])
