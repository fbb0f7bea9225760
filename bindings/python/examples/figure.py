"""Draws a bent arm with round studs before and after: python figure.py [--out figure.png] [--angle 110]

The arm is a tube of skin; bending stretches the outside of the elbow. The picture shows it at rest, bent with its own
UVs, and bent with the texture looked up through the redirection map, and says what became of the studs' strain.
Needs matplotlib: pip install './bindings/python[figure]'.
"""

from __future__ import annotations

import argparse

import numpy as np

import vrtm


def arm(angle: float, rings: int = 97, sides: int = 97) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """A half tube along x, bent by `angle` (radians) about its middle: positions (rings * sides, 3), quadrilaterals
    (faces, 4) and UVs (rings * sides, 2). The seen side is the outside of the bend."""
    u, v = np.meshgrid(np.linspace(0, 1, sides), np.linspace(0, 1, rings), indexing="ij")
    along, around = 6 * (u - 0.5), np.pi * (v - 0.5)
    y, z = np.sin(around), np.cos(around)
    # The bone is straight, then an arc over which the bend is spread, then straight again.
    half = 0.6
    turned = np.clip(along, -half, half) / half * angle / 2
    radius = 2 * half / angle if angle else np.inf
    straight = along - np.clip(along, -half, half)
    x0 = radius * np.sin(turned) if angle else np.clip(along, -half, half)
    z0 = radius * (np.cos(turned) - 1) if angle else 0 * along
    x = x0 + straight * np.cos(turned) + z * np.sin(turned)
    z = z0 - straight * np.sin(turned) + z * np.cos(turned)
    number = np.arange(u.size).reshape(u.shape)
    quads = np.stack([number[:-1, :-1], number[1:, :-1], number[1:, 1:], number[:-1, 1:]], -1)
    return np.stack([x, y, z], -1).reshape(-1, 3), quads.reshape(-1, 4), np.stack([u, v], -1).reshape(-1, 2)


def painted(size: int = 1024) -> tuple[np.ndarray, np.ndarray]:
    """A skin with studs: its colour (size, size, 3) and its rigidity (size, size), rows from v = 1 down."""
    v, u = (np.mgrid[:size, :size] + 0.5) / size
    # The tube is 6 long and pi around: studs that are round on it.
    x, y = 6 * u, np.pi * v
    step = 0.75
    row = np.round(y / (step * 0.866))
    shift = (row % 2) * step / 2
    radius = np.hypot((x - shift + step / 2) % step - step / 2, y - row * step * 0.866)
    stud = np.clip((0.24 - radius) / 0.01, 0, 1)
    grain = 0.04 * np.sin(40 * x + 3 * np.sin(17 * y)) * np.sin(37 * y + 2 * np.sin(23 * x))
    skin = np.array([0.62, 0.42, 0.30]) + grain[..., None]
    metal = np.array([0.86, 0.84, 0.78]) * (0.75 + 0.25 * np.cos(radius / 0.24 * 1.4))[..., None]
    return skin + stud[..., None] * (metal - skin), np.clip((0.26 - radius) / 0.02, 0, 1).astype(np.float32)


def sample(image: np.ndarray, uvs: np.ndarray) -> np.ndarray:
    """An image, rows from v = 1 down, at UVs (..., 2), bilinearly."""
    height, width = image.shape[:2]
    x = np.clip(uvs[..., 0] * width - 0.5, 0, width - 1)
    y = np.clip((1 - uvs[..., 1]) * height - 0.5, 0, height - 1)
    left, top = np.minimum(x.astype(int), width - 2), np.minimum(y.astype(int), height - 2)
    s, t = (x - left)[..., None], (y - top)[..., None]
    upper = image[top, left] * (1 - s) + image[top, left + 1] * s
    return upper * (1 - t) + (image[top + 1, left] * (1 - s) + image[top + 1, left + 1] * s) * t


def picture(positions: np.ndarray, colours: np.ndarray, width: int = 560, height: int = 330) -> np.ndarray:
    """Points of a surface (n, m, 3), close enough to each other to leave no holes, with colours (n, m, 3), lit and seen
    from above: an image (height, width, 3). The nearest point wins, and four pixels are averaged to one."""
    normal = np.cross(np.gradient(positions, axis=0), np.gradient(positions, axis=1))
    normal /= np.linalg.norm(normal, axis=-1, keepdims=True)
    lit = np.clip(colours * (0.35 + 0.7 * np.abs(normal @ (0.35, -0.35, 0.87)))[..., None], 0, 1).reshape(-1, 3)
    turn = np.radians(32)
    x, y, z = np.moveaxis(positions, -1, 0).reshape(3, -1)
    up, depth = y * np.cos(turn) + z * np.sin(turn), z * np.cos(turn) - y * np.sin(turn)
    scale = 2 * width / 6.3
    column = (width + x * scale).astype(int)
    row = (0.8 * height - (up - 0.1) * scale).astype(int)
    order = np.argsort(depth)
    order = order[(0 <= column[order]) & (column[order] < 2 * width) & (0 <= row[order]) & (row[order] < 2 * height)]
    image = np.ones((2 * height, 2 * width, 3))
    image[row[order], column[order]] = lit[order]
    return image.reshape(height, 2, width, 2, 3).mean((1, 3))


def main() -> None:
    parser = argparse.ArgumentParser(description="draws a bent arm with studs, before and after")
    parser.add_argument("--out", default="figure.png", help="where to write the picture (figure.png)")
    parser.add_argument("--angle", type=float, default=110, help="how far the arm bends, in degrees (110)")
    options = parser.parse_args()
    import matplotlib

    matplotlib.use("agg")
    from matplotlib import pyplot

    rest, faces, uvs = arm(0)
    pose, _, _ = arm(np.radians(options.angle))
    colour, rigidity = painted()
    with vrtm.Device() as device, vrtm.Asset(device, rest, faces, uvs=uvs, uv_indices=faces) as asset:
        tile = asset.tile(1001)
        tile.set_rigidity(rigidity)
        [redirection] = asset.redirect(pose, [vrtm.Fetch(tile, size=512)], measure=True)
        report = tile.report()
    before, after = report.before.rms, report.after.rms
    print(f"strain of the studs, RMS: {before:.3f} before, {after:.3f} after, in {report.ms_total:.0f} ms")

    # Drawn from many more points than the mesh has vertices, so that the texture is seen and not the mesh.
    grid = (2800, 640)
    straight, _, at = arm(0, grid[1], grid[0])
    bent, _, _ = arm(np.radians(options.angle), grid[1], grid[0])
    straight, bent, own = straight.reshape(*grid, 3), bent.reshape(*grid, 3), at.reshape(*grid, 2)
    panels = {
        "at rest": picture(straight, sample(colour, own)),
        f"bent, own UVs: strain {before:.3f}": picture(bent, sample(colour, own)),
        f"bent, redirected: strain {after:.3f}": picture(bent, sample(colour, sample(redirection, own))),
    }
    figure, axes = pyplot.subplots(1, 3, figsize=(16.8, 3.7), layout="constrained")
    for axis, (title, image) in zip(axes, panels.items()):
        axis.imshow(image, interpolation="nearest")
        axis.set_title(title)
        axis.set_axis_off()
    figure.savefig(options.out, dpi=100)
    print(options.out)


if __name__ == "__main__":
    main()
