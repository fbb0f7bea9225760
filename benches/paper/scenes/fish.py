"""A fish with spikes: slim at rest; it blows itself up, and bends to its side."""

import numpy as np
import paint
from shapes import Builder, bump, closed, rectangle, smooth

ALONG, AROUND = 112, 112
NOSE, TAIL = 0.065, 0.93
NOTES = ["blown up", "bent to its side", "blown up half-way, bent"]
POSES = [(1.0, 0.0), (0.0, 1.0), (0.55, 0.6)]
SIDE = [0.02, 0.03], [0.66, 0.97]


def profile(t):
    """Place along the body's axis (x, the nose in front) and its thickness there, t from 0 at the nose to 1."""
    return 1.5 * np.cos(np.pi * t), 0.72 * np.sin(np.pi * t) ** 0.85


def body():
    """Points (ALONG, AROUND, 3), in equal steps along the profile; around from the belly's middle."""
    t = np.linspace(NOSE, TAIL, 4000)
    x, r = profile(t)
    length = np.append(0, np.cumsum(np.hypot(np.diff(x), np.diff(r))))
    t = np.interp(np.linspace(0, length[-1], ALONG), length, t)
    x, r = profile(t)
    angle = 2 * np.pi * np.arange(AROUND) / AROUND
    y, z = -np.cos(angle) * r[:, None], np.sin(angle) * r[:, None] * 0.92
    return np.stack([np.repeat(x[:, None], AROUND, 1), y, z], -1)


def fin(root, tip, sweep, n, m, rays):
    """A sheet between two curves (n points along the root to the rim, m across), with folds along its rays."""
    s, t = np.linspace(0, 1, n)[:, None, None], np.linspace(0, 1, m)[None, :, None]
    start, end = (np.array(a)[0] * (1 - t) + np.array(a)[1] * t for a in (root, tip))
    out = start + (end - start) * s * (1 - 0.10 * np.abs(np.sin(rays * np.pi * t)) * s)
    return out + np.array(sweep) * (0.035 * s * np.sin(2 * rays * np.pi * t) + 0.30 * s * s * (1 - s))


def build():
    builder = Builder()
    index = builder.vertices(body())
    builder.chart(closed(index)[:, ::-1], rectangle(*SIDE, ALONG, AROUND + 1))
    builder.fan(index[0], [1.5, 0, 0], [0.76, 0.12], 0.05)
    builder.fan(index[-1][::-1], [-1.5, 0, 0], [0.90, 0.12], 0.04)
    sheets = [
        fin([[-1.38, 0.20, 0], [-1.38, -0.20, 0]], [[-2.25, 0.66, 0], [-2.25, -0.66, 0]], [0, 0, 1], 24, 40, 7),
        fin([[-0.75, 0.60, 0], [-1.22, 0.38, 0]], [[-1.15, 1.02, 0], [-1.62, 0.66, 0]], [0, 0, 1], 16, 24, 5),
    ]
    for side in (1, -1):
        root = [[0.50, 0.05, 0.63 * side], [0.50, -0.28, 0.58 * side]]
        tip = [[-0.02, 0.10, 1.10 * side], [0.02, -0.62, 0.98 * side]]
        sheets.append(fin(root, tip, [0, 0, side], 16, 28, 5))
    for k, sheet in enumerate(sheets):
        low = np.array([0.71, 0.22 + 0.19 * k])
        builder.chart(builder.vertices(sheet), rectangle(low, np.add(low, [0.25, 0.16]), *sheet.shape[:2]))
    return builder.model("spiky_fish", lambda points, k: pose(points, *POSES[k]), NOTES)


def pose(points, blown, bent):
    """Blown up: thicker, most at the belly. Bent: an arc to its side. Fins move with the skin at their roots."""
    x, y, z = points.T
    radius = np.maximum(np.hypot(y, z), 1e-9)
    skin = np.interp(x, *(a[::-1] for a in profile(np.linspace(NOSE, TAIL, 400))))
    below = 0.5 - 0.5 * y / radius
    grown = blown * 0.80 * bump(0.10, 1.55, x) * (0.82 + 0.36 * below)
    factor = 1 + grown / np.maximum(np.maximum(skin, radius), 0.15) * np.minimum(radius / np.maximum(skin, 1e-9), 1)
    y, z = y * factor, z * factor
    x = x * (1 - 0.10 * blown)
    if bent:
        # The head keeps its direction; the tail swings round.
        curve = bent * 0.58
        turn = curve * (np.clip(0.9 - x, 0, None))
        s = np.linspace(0, 4, 2001)
        px = np.append(0, np.cumsum(np.cos(curve * (s[1:] + s[:-1]) / 2) * np.diff(s)))
        pz = np.append(0, np.cumsum(np.sin(curve * (s[1:] + s[:-1]) / 2) * np.diff(s)))
        along = np.clip(0.9 - x, 0, None)
        ax, az = np.interp(along, s, px), np.interp(along, s, pz)
        ahead = np.clip(x - 0.9, 0, None)
        x, z = 0.9 + ahead - ax + z * np.sin(turn), z * np.cos(turn) + az
    return np.stack([x, y, z], -1)


def centres():
    """Spikes in staggered rings, equally far apart on the skin; none at the belly's seam, nor on fins and eyes."""
    t = np.linspace(NOSE, TAIL, 4000)
    x, r = profile(t)
    length = np.append(0, np.cumsum(np.hypot(np.diff(x), np.diff(r))))
    step, out = 0.265, []
    for ring, at in enumerate(np.arange(0.30, length[-1] - 0.22, step * 0.88)):
        cx, cr = np.interp(at, length, x), np.interp(at, length, r)
        count = max(round(2 * np.pi * cr * 0.96 / step), 4)
        for k in range(count):
            angle = 2 * np.pi * (k + 0.5 * (ring % 2) + 0.25) / count
            out.append([cx, -np.cos(angle) * cr, np.sin(angle) * cr * 0.92])
    out = np.array(out)
    keep = (out[:, 1] > -0.985 * np.hypot(out[:, 1], out[:, 2] / 0.92)) | (np.abs(out[:, 2]) > 0.11)
    for eye in EYES:
        keep &= np.linalg.norm(out - eye, axis=1) > 0.30
    return out[keep & (out[:, 0] < 1.28)]


EYES = [np.array([1.0, 0.22, 0.42]), np.array([1.0, 0.22, -0.42])]


def spikes(model, size):
    """Ivory spikes on a spotted back and a white belly, eyes, fins with rays."""
    surface = paint.Surface(model, 1001, size)
    points, uv = surface.points, surface.uv
    skin = (uv[:, 0] < 0.685) | ((uv[:, 1] < 0.19) & (uv[:, 0] > 0.685))
    x, y, z = points.T
    up = y / np.maximum(np.hypot(y, z), 0.05)
    back = smooth(-0.45, 0.35, up + 0.18 * paint.noise(points, 0.4, 6))
    spots = smooth(0.05, 0.35, paint.noise(points, 0.30, 2, 2)) * back
    colour = paint.mixed([0.86, 0.80, 0.66], [0.62, 0.36, 0.10], back)
    colour = paint.mixed(colour, [0.13, 0.060, 0.022], 0.85 * spots)
    fins = paint.mixed([0.75, 0.42, 0.10], [0.40, 0.14, 0.03], 0.5 + 0.5 * np.sin(90 * uv[:, 1] * 2 * np.pi * 0.6))
    colour[~skin] = fins[~skin]
    height = 0.006 * paint.noise(points, 0.05, 8, 2) * skin
    where = centres()
    radii = np.full(len(where), 0.074)
    distance, _ = paint.nearest(points, where, radii, 1.6)
    distance[~skin] = np.inf
    inside = paint.edge(distance, 1.0, 0.12)
    cone = np.clip(1 - distance, 0, 1)
    colour = paint.mixed(colour, [0.50, 0.40, 0.26], inside)
    colour = paint.mixed(colour, [0.93, 0.88, 0.74], smooth(0.10, 0.55, cone))
    # Wide at the foot, and thin above it.
    height = height * (1 - inside) + 0.30 * cone**1.25
    eye, _ = paint.nearest(points, np.array(EYES), np.array([0.17, 0.17]), 1.5)
    eye[~skin] = np.inf
    for at, width, value in (
        (1.08, 0.06, [0.10, 0.05, 0.02]), (0.92, 0.05, [0.85, 0.82, 0.70]), (0.66, 0.05, [0.75, 0.36, 0.02]),
        (0.36, 0.05, [0.01, 0.01, 0.012]),
    ):  # fmt: skip
        colour = paint.mixed(colour, value, paint.edge(eye, at, width))
    shine = np.linalg.norm(points - EYES[0] - [0.055, 0.06, 0.02], axis=1)
    colour = paint.mixed(colour, [1, 1, 1], paint.edge(shine, 0.035, 0.012) * skin)
    height = np.where(eye < 1.08, 0.11 * np.sqrt(np.clip(1 - (eye / 1.1) ** 2, 0, 1)), height)
    mouth = np.exp(-(((np.hypot(y, z) - 0.13) / 0.035) ** 2)) * (x > 1.2) * skin
    colour = paint.mixed(colour, [0.55, 0.20, 0.14], mouth)
    colour = paint.mixed(colour, [0.05, 0.01, 0.01], smooth(0.10, 0.05, np.hypot(y, z)) * (x > 1.2) * skin)
    height = height + 0.05 * mouth
    rigid = np.maximum(paint.edge(distance, 1.12, 0.12), paint.edge(eye, 1.15, 0.08))
    model.rigidity = {1001: surface.image(rigid)}
    return paint.Paint({1001: surface.image(colour)}, {1001: surface.image(height)}, model.rigidity)
