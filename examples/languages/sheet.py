"""A sheet of two charts with eight painted discs, in 48 poses: a preview in which the newest pose wins, then each pose
exactly, with its map and a stud. README.md says what is printed."""

import sys

import numpy as np
import vrtm

POSES, CELLS, TEXELS = 48, 20, 128
RADIUS = 0.15


def distance(a, b):
    return np.sqrt(((a - b) ** 2).sum(-1))


def at_rest(uv):
    """The place on the sheet at rest, of 2 x 1, that has a UV: each half is a chart."""
    u, v = uv[..., 0].astype(float), uv[..., 1].astype(float)
    chart = np.where(u < 0.5, 0, 1)
    return np.stack([chart + (u - 0.04 - 0.48 * chart) / 0.44, (v - 0.28) / 0.44, 0 * u], -1)


def posed(points, pose):
    x, y, s = points[..., 0], points[..., 1], pose / (POSES - 1)
    return np.stack([x + 0.15 * s * x * (x - 1), y - 0.2 * s * x * y * (1 - y), 0.3 * s * x * (2 - x)], -1)


def in_disc(uv, within):
    """True within so many units from the centre of the nearest of the four discs of a chart."""
    rest = at_rest(uv)
    x = np.abs(rest[..., 0] - (uv[..., 0] >= 0.5) - 0.5) - 0.25
    y = np.abs(rest[..., 1] - 0.5) - 0.25
    return x * x + y * y < within * within


def centres(width):
    """The UVs of the centres of texels, the first row at v = 1."""
    middle = (np.arange(width) + 0.5) / width
    return np.stack(np.meshgrid(middle, 1 - middle), -1)


def strain(image, pose):
    """The RMS strain of the discs: lengths between neighbouring texels in the pose, over those of what they show."""
    inside, shown, now = in_disc(image, 0.13), at_rest(image), posed(at_rest(centres(TEXELS)), pose)
    squares = []
    for a, b in (np.s_[:-1, :-1], np.s_[:-1, 1:]), (np.s_[:-1, :-1], np.s_[1:, :-1]):
        both = inside[a] & inside[b]
        squares.append((distance(now[a], now[b])[both] / distance(shown[a], shown[b])[both] - 1) ** 2)
    return np.sqrt(np.concatenate(squares).mean())


chart, y, x = np.mgrid[:2, : CELLS + 1, : CELLS + 1]
vertices = np.stack([chart + x / CELLS, y / CELLS], -1).reshape(-1, 2)
uvs = np.stack([0.04 + 0.48 * chart + 0.44 * x / CELLS, 0.28 + 0.44 * y / CELLS], -1).reshape(-1, 2)
poses = [posed(vertices, pose).astype(np.float32) for pose in range(POSES)]
first = np.arange(len(uvs)).reshape(chart.shape)[:, :-1, :-1].reshape(-1, 1)
faces = first + np.array([0, 1, CELLS + 2, CELLS + 1])
painted = np.where(in_disc(centres(TEXELS), RADIUS), 255, 0).astype(np.uint8)

with vrtm.Device("cpu", log=lambda entry: print(entry.message, file=sys.stderr)) as device:
    asset = vrtm.Asset(device, poses[0], faces, uvs=uvs.astype(np.float32), uv_indices=faces)
    tile = asset.tile(1001)
    tile.set_rigidity(painted)
    tile.set_settings(grid_width=96, grid_height=96)

    # A stud: its tip over the middle of the first disc, and two places on its rim.
    at = np.array([[0.15, 0.39], [0.2, 0.39], [0.15, 0.44]], np.float32)
    stud = asset.carrier(at, heights=np.array([0.1, 0, 0], np.float32))

    # As fast as the mouse moves: each pose takes the place of the one before.
    for pose in poses:
        job = asset.submit(pose, quality="draft", replace=True)
    job.result()
    print(f"preview {tile.report().min_jacobian:.4f}")

    images = [vrtm.Fetch(tile, "redirection", TEXELS), vrtm.CarrierFetch(stud, "positions")]
    for pose, positions in enumerate(poses):
        image, carried = asset.redirect(positions, images)
        tip, rim, _ = carried.positions.astype(float)
        if pose % 8 == 0 or pose == POSES - 1:
            strains = strain(centres(TEXELS), pose), strain(image, pose)
            groups = strains, image[78, 19], tip, [distance(tip, rim)]
            print(f"{pose:2d}", *("  " + " ".join(f"{number:.4f}" for number in group) for group in groups), sep="")
