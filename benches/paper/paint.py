"""Textures painted on a model's surface at rest: what lies under each texel, noise, and round features."""

from dataclasses import dataclass

import numpy as np
import studs
import warp


@dataclass
class Paint:
    """Painted tiles: colour (linear), height (in units of the model), rigidity, and roughness."""

    colour: dict
    height: dict
    rigidity: dict

    def write(self, folder):
        """colour.<UDIM>.exr, height.<UDIM>.exr and rigid.<UDIM>.exr."""
        for udim in self.colour:
            warp.write(folder / f"colour.{udim}.exr", self.colour[udim], half=True)
            for name, map in ("height", self.height[udim]), ("rigid", self.rigidity[udim]):
                warp.write(folder / f"{name}.{udim}.exr", map[..., None], names=["Y"])


class Surface:
    """The texels of a tile that charts cover, and where they lie on the surface at rest."""

    def __init__(self, model, udim, size):
        triangles, uv_triangles = model.triangles()
        middle = np.floor(model.uvs[uv_triangles].mean(1))
        inside = 1001 + middle[:, 0] + 10 * middle[:, 1] == udim
        mesh = type("Mesh", (), dict(uvs=model.uvs, triangles=triangles[inside], uv_triangles=uv_triangles[inside]))
        place = studs.positions(mesh, model.rest, size, udim)
        self.size, self.udim, self.here = size, udim, ~np.isnan(place[..., 0])
        self.points = place[self.here]
        rows, columns = np.nonzero(self.here)
        self.uv = np.stack([(columns + 0.5) / size, 1 - (rows + 0.5) / size], -1)

    def image(self, values, around=0.0, grow=8):
        """Values per covered texel as an image, grown over the borders of the charts: lookups read a little beyond."""
        out = np.full((self.size, self.size, *values.shape[1:]), around, np.float32)
        out[self.here] = values
        known = self.here.copy()
        for _ in range(grow):
            for axis, step in (0, 1), (0, -1), (1, 1), (1, -1):
                new = np.roll(known, step, axis) & ~known
                out[new] = np.roll(out, step, axis)[new]
                known |= new
        return out

    def inner(self, texels):
        """Mask of the covered texels that are that far, give or take one, from all borders of charts."""
        sums = np.cumsum(np.cumsum(np.pad(self.here, texels + 1), 0, dtype=np.int64), 1)
        n = 2 * texels + 1
        box = sums[n:, n:] - sums[:-n, n:] - sums[n:, :-n] + sums[:-n, :-n]
        return (box[1:, 1:] == n * n)[self.here]


def noise(points, scale, seed=0, octaves=3):
    """Value noise of points in space, about -1 to 1; `scale` is the size of the largest spots."""
    table = np.random.default_rng(seed).uniform(-1, 1, 4096).astype(np.float32)
    out, weight = np.zeros(len(points), np.float32), np.float32(1)
    for octave in range(octaves):
        x = (points / scale * 2**octave + 7.3 * octave).astype(np.float32)
        cell = np.floor(x)
        f = x - cell
        f = f * f * (3 - 2 * f)
        cell = cell.astype(np.int32)
        low = [cell[:, k] * prime for k, prime in enumerate((7393, 19349, 83493))]
        pairs = [((low[k], 1 - f[:, k]), (low[k] + prime, f[:, k])) for k, prime in enumerate((7393, 19349, 83493))]
        for a, wa in pairs[0]:
            for b, wb in pairs[1]:
                ab, wab = a ^ b, wa * wb
                for c, wc in pairs[2]:
                    mixed_bits = ab ^ c
                    out += weight * wab * wc * table[(mixed_bits ^ (mixed_bits >> 11)) & 4095]
        weight /= 2
    return out / 1.2


def scattered(points, radii, gap, seed=0, taken=(), tries=4000):
    """Centres of features on the surface that overlap nowhere: for each radius, the largest first, as many of random
    points as fit. Returns centres and their radii."""
    order = np.random.default_rng(seed)
    centres, sizes = [np.zeros((0, 3))], [np.zeros(0)]
    for centre, size in taken:
        centres.append(centre[None]), sizes.append(np.array([size]))
    centres, sizes = np.concatenate(centres), np.concatenate(sizes)
    for radius in radii:
        for point in points[order.integers(0, len(points), tries)]:
            if (np.linalg.norm(centres - point, axis=1) > gap * (sizes + radius)).all():
                centres, sizes = np.concatenate([centres, point[None]]), np.append(sizes, radius)
    return centres[len(taken) :], sizes[len(taken) :]


def nearest(points, centres, radii, reach=1.5, stretch=None):
    """For each point the distance to the nearest centre in its radii (infinite beyond `reach`), and that centre's
    number (-1 for none). `stretch` changes offsets (points, centre's number) to what their length is taken of."""
    distance, number = np.full(len(points), np.inf, np.float32), np.full(len(points), -1)
    side = float(np.max(radii)) * reach
    cell = np.floor(points / side).astype(np.int64)
    low = cell.min(0) - 1
    shape = cell.max(0) - low + 2
    keys = ((cell - low) @ [shape[1] * shape[2], shape[2], 1]).astype(np.int64)
    order = np.argsort(keys, kind="stable")
    ranked = keys[order]
    for k, (centre, radius) in enumerate(zip(centres, radii)):
        at = np.floor(centre / side).astype(np.int64) - low
        for dx in (-1, 0, 1):
            for dy in (-1, 0, 1):
                row = (at[0] + dx) * shape[1] * shape[2] + (at[1] + dy) * shape[2] + at[2]
                a, b = np.searchsorted(ranked, [row - 1, row + 2])
                near = order[a:b]
                offset = points[near] - centre
                if stretch is not None:
                    offset = stretch(offset, k)
                d = np.sqrt((offset * offset).sum(1)) / radius
                better = (d < distance[near]) & (d < reach)
                distance[near[better]], number[near[better]] = d[better], k
    return distance, number


def edge(distance, at, width):
    """1 inside of a distance, 0 outside, with a soft edge."""
    return np.clip((at - distance) / width + 0.5, 0, 1)


def mixed(a, b, weight):
    return np.asarray(a) + (np.asarray(b) - a) * weight[..., None]
