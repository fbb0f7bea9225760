"""The surface around one node in five frames, without what hides it, held still: what of W's change a viewer sees."""

from pathlib import Path

import numpy as np
import OpenEXR
from PIL import Image

ELASTIC, RIGID, LINE, PAPER = (np.array(c, float) for c in ((88, 46, 40), (226, 182, 98), (150, 96, 84), (232, 232, 230)))
SIDE = 300  # of a picture, in pixels
LINES = 8  # a line of the painted grid every so many cells


class Mesh:
    def __init__(self, asset: Path):
        rows = [line.split() for line in (asset / "rest.obj").read_text().splitlines()]
        self.uv = np.array([row[1:3] for row in rows if row[0] == "vt"], float)
        corners = [[tuple(int(i) - 1 for i in c.split("/")) for c in row[1:]] for row in rows if row[0] == "f"]
        fans = np.array([(c[0], c[k], c[k + 1]) for c in corners for k in range(1, len(c) - 1)])
        self.vertices, self.corners = fans[:, :, 0], fans[:, :, 1]
        count = sum(row[0] == "v" for row in rows)
        self.poses = np.fromfile(asset / "frames.f32", "<f4").reshape(-1, count, 3).astype(float)


class Tile:
    """The maps of a tile, with coordinates within it."""

    def __init__(self, asset: Path, udim: int, grid: int):
        self.origin = np.array([(udim - 1001) % 10, (udim - 1001) // 10], float)
        self.grid = grid
        with Image.open(asset / f"rigidity.{udim}.png") as image:
            self.rigidity = np.asarray(image.convert("L"), float)[..., None] / 255

    def colour(self, uv: np.ndarray) -> np.ndarray:
        rigid = np.clip(4 * sample(self.rigidity, uv) - 1.5, 0, 1)
        phase = np.abs((uv * self.grid / LINES + 0.5) % 1 - 0.5).min(axis=-1, keepdims=True)
        ground = np.where(phase < 0.04, LINE, ELASTIC)
        return ground + rigid * (RIGID - ground)


def sample(image: np.ndarray, uv: np.ndarray) -> np.ndarray:
    """Bilinear; the first row is at the top."""
    height, width = image.shape[:2]
    x = np.clip(uv[..., 0] * width - 0.5, 0, width - 1)
    y = np.clip((1 - uv[..., 1]) * height - 0.5, 0, height - 1)
    i, j = np.minimum(x.astype(int), width - 2), np.minimum(y.astype(int), height - 2)
    s, t = (x - i)[..., None], (y - j)[..., None]
    top = image[j, i] * (1 - s) + image[j, i + 1] * s
    return top * (1 - t) + (image[j + 1, i] * (1 - s) + image[j + 1, i + 1] * s) * t


def shifts(path: Path) -> np.ndarray:
    """A redirection as differences from the texels' own UVs, which may be interpolated across a chart's border."""
    channels = OpenEXR.File(str(path), separate_channels=True).channels()
    u, v = (channels[name].pixels.astype(float) for name in "RG")
    height, width = u.shape
    x, y = (np.arange(width) + 0.5) / width, 1 - (np.arange(height) + 0.5) / height
    return np.stack([u - x[None], v - y[:, None]], axis=-1)


class Patch:
    """The surface around a UV of a tile: a camera along its mean normal, with v up, that moves with it."""

    def __init__(self, mesh: Mesh, tile: Tile, uv: np.ndarray, pose: np.ndarray, reach: float):
        at = mesh.uv[mesh.corners] - tile.origin
        distance = np.abs(at - uv).max(axis=2) * tile.grid
        drawn = (distance < 3 * reach).any(axis=1)
        self.uv, self.vertices = at[drawn], mesh.vertices[drawn]
        sides = [np.diff(x[drawn][:, [0, k]], axis=1)[:, 0] for x in (at, pose[mesh.vertices]) for k in (1, 2)]
        area = sides[0][:, 0] * sides[1][:, 1] - sides[0][:, 1] * sides[1][:, 0]
        turned = np.cross(sides[2], sides[3])
        # The triangles that the camera looks at; where the mesh is coarse, the nearest.
        middle = distance[drawn].min(axis=1)
        chosen = middle <= max(reach, middle.min())
        normal = turned[chosen].sum(axis=0)
        normal /= np.linalg.norm(normal)
        by_v = (sides[0][:, :1] * sides[3] - sides[1][:, :1] * sides[2])[chosen]
        up = (by_v * np.sign(area[chosen])[:, None]).sum(axis=0)
        up -= normal * (up @ normal)
        up /= np.linalg.norm(up)
        self.axes = np.stack([np.cross(up, normal), up, normal], axis=-1)
        size = np.linalg.norm(turned[chosen], axis=1).sum() / np.abs(area[chosen]).sum()
        self.scale = SIDE / 2 / (reach / tile.grid * np.sqrt(size))
        self.held = np.unique(self.vertices[chosen])
        self.still = pose[self.held]
        basis = np.stack(sides[:2], axis=-1)
        basis[np.abs(area) < 1e-12] = np.eye(2)
        weights = np.linalg.solve(basis, (uv - self.uv[:, 0])[..., None])[..., 0]
        weights = np.concatenate([1 - weights.sum(axis=1, keepdims=True), weights], axis=1)
        k = np.where(np.abs(area) < 1e-12, np.inf, np.abs(weights).sum(axis=1)).argmin()
        self.centre = np.clip(weights[k], 0, 1) @ pose[self.vertices[k]]

    def render(self, pose: np.ndarray) -> np.ndarray:
        """UVs per pixel, NaN where there is no surface. The pose is turned and moved onto that of the camera."""
        here, there = pose[self.held].mean(axis=0), self.still.mean(axis=0)
        left, _, right = np.linalg.svd((pose[self.held] - here).T @ (self.still - there))
        turn = left @ np.diag([1, 1, np.sign(np.linalg.det(left @ right))]) @ right
        seen = ((pose - here) @ turn + there - self.centre) @ self.axes * self.scale
        seen[:, :2] = seen[:, :2] * [1, -1] + SIDE / 2
        image, depth = np.full((SIDE, SIDE, 2), np.nan), np.full((SIDE, SIDE), -np.inf)
        for p, texture in zip(seen[self.vertices], self.uv):
            low = np.clip(np.floor(p[:, :2].min(axis=0)), 0, SIDE).astype(int)
            high = np.clip(np.ceil(p[:, :2].max(axis=0)) + 1, 0, SIDE).astype(int)
            edges = np.stack([p[1, :2] - p[0, :2], p[2, :2] - p[0, :2]], axis=-1)
            # Pixels run down: what faces the viewer has a negative area.
            if (low >= high).any() or np.linalg.det(edges) > -1e-9:
                continue
            x, y = np.meshgrid(np.arange(low[0], high[0]) + 0.5, np.arange(low[1], high[1]) + 0.5)
            b = (np.stack([x, y], axis=-1) - p[0, :2]) @ np.linalg.inv(edges).T
            b = np.concatenate([1 - b.sum(axis=-1, keepdims=True), b], axis=-1)
            z = b @ p[:, 2]
            window = (slice(low[1], high[1]), slice(low[0], high[0]))
            front = (b >= -1e-6).all(axis=-1) & (z > depth[window])
            depth[window][front] = z[front]
            image[window][front] = (b @ texture)[front]
        return image


def strip(asset: Path, maps: Path, out: Path, grid: int, node: tuple[int, int, float, float], reach: float):
    """Five frames: above with the original UVs, below with the redirected ones."""
    frame, udim, *uv = node
    mesh, tile = Mesh(asset), Tile(asset, udim, grid)
    patch = Patch(mesh, tile, np.array(uv), mesh.poses[frame - 1], reach)
    columns = []
    for number in range(frame - 2, frame + 3):
        seen = patch.render(mesh.poses[number - 1])
        shift = shifts(maps / f"redirect.{number:04}.{udim}.exr")
        known = np.nan_to_num(seen, nan=0.5)
        pictures = [tile.colour(known), tile.colour(known + sample(shift, known))]
        empty = np.isnan(seen[..., :1])
        columns.append(np.concatenate([np.where(empty, PAPER, picture) for picture in pictures]))
    gap = np.full((2 * SIDE, 4, 3), 255.0)
    parts = [part for column in columns for part in (column, gap)][:-1]
    Image.fromarray(np.concatenate(parts, axis=1).round().astype(np.uint8)).save(out)
