"""The rendered meshes: a small model of two UDIM tiles, made here, and the meshes that lie beside the checkout.

The chart of tile 1002 is mirrored: seen from outside, its u runs to the left, as on the second half of a symmetric
model.
"""

import pathlib
import subprocess
import sys

import numpy as np

import obj
import warp

# The model's discs, which are rigid: centre and radius within their tile.
STUDS = {
    1001: [(0.14, 0.22, 0.10), (0.42, 0.30, 0.13), (0.78, 0.24, 0.12), (0.22, 0.68, 0.14), (0.58, 0.72, 0.12),
           (0.88, 0.66, 0.085)],
    1002: [(0.25, 0.28, 0.14), (0.70, 0.32, 0.15), (0.30, 0.74, 0.12), (0.72, 0.76, 0.13)],
}


class Mesh:
    """Triangles; a UV per vertex; poses as arrays of positions."""

    def __init__(self, triangles, uvs, pose, uv_triangles=None):
        self.triangles, self.uvs, self.pose = triangles, uvs, pose
        self.uv_triangles = triangles if uv_triangles is None else uv_triangles


def surface(u, v, tile):
    """The model's pose, on which features stretch, shear and turn; it differs between the tiles."""
    sign = 1 if tile == 1001 else -1
    u = u if tile == 1001 else 2 - u
    x = u + 0.09 * np.sin(2 * np.pi * u) + sign * 0.16 * np.sin(np.pi * v) + (tile - 1001) * 1.25
    y = v + 0.10 * np.sin(2 * np.pi * v + 0.4) * (0.6 + 0.4 * u) + 0.07 * np.sin(np.pi * u)
    z = 0.22 * np.sin(np.pi * u) * np.sin(np.pi * v)
    return np.stack([x, y, z], -1)


def grid(tile, n=48):
    """A chart that touches both sides of its tile in u, where a wrong wrap mode shows."""
    margin = 0.04
    u, v = np.meshgrid(np.linspace(0, 1, n + 1), np.linspace(margin, 1 - margin, n + 1))
    u = u + tile - 1001
    first = (np.arange(n)[:, None] * (n + 1) + np.arange(n)).ravel()
    a, b, c, d = first, first + 1, first + n + 2, first + n + 1
    # Lower left to upper right, in whichever order: what counts is that all programs see the same triangles.
    triangles = np.concatenate([np.stack([a, b, c], -1), np.stack([a, c, d], -1)])
    if tile != 1001:
        # Mirrored: against the clock in space, so that the normals point outside, is with the clock in the UV plane.
        triangles = triangles[:, ::-1]
    return np.stack([u.ravel(), v.ravel()], -1), triangles


def rigidity(tile, size=256):
    uv = warp.centres(size, size)
    value = np.zeros((size, size))
    for x, y, radius in STUDS[tile]:
        distance = np.hypot(uv[..., 0] - x, uv[..., 1] - y)
        value = np.maximum(value, np.clip((radius - distance) * size + 0.5, 0, 1))
    return value[..., None]


def make(folder):
    """Writes rest.obj, pose.obj and rigidity.<UDIM>.png; returns the posed mesh."""
    folder = pathlib.Path(folder)
    folder.mkdir(parents=True, exist_ok=True)
    uvs, rest, pose, triangles = [], [], [], []
    for tile in STUDS:
        uv, faces = grid(tile)
        triangles.append(faces + sum(map(len, uvs)))
        uvs.append(uv)
        flat = uv if tile == 1001 else [3, 0] + uv * [-1, 1]
        rest.append(np.concatenate([flat + [0.25 * (tile - 1001), 0], np.zeros((len(uv), 1))], 1))
        pose.append(surface(uv[:, 0], uv[:, 1], tile))
        warp.write(folder / f"rigidity.{tile}.png", rigidity(tile))
    uvs, rest, pose, triangles = map(np.concatenate, (uvs, rest, pose, triangles))
    for name, points in ("rest", rest), ("pose", pose):
        corners = np.stack([triangles.ravel()] * 2, -1)
        obj.write(folder / f"{name}.obj", points, uvs, np.full(len(triangles), 3), corners)
    return Mesh(triangles, uvs, pose)


def asset(folder, frame):
    """A mesh of the assets beside the checkout, in the pose of a frame, counted from 1."""
    folder = pathlib.Path(folder)
    rest, uvs, counts, corners = obj.read(folder / "rest.obj")
    triangles = corners[obj.fans(counts)]
    frames = np.fromfile(folder / "frames.f32", "<f4").reshape(-1, len(rest), 3)
    return Mesh(triangles[..., 0], uvs, frames[frame - 1].astype(np.float64), triangles[..., 1])


def run(*arguments):
    """Runs the program `vrtm`; its own messages become the exception's."""
    vrtm = pathlib.Path(sys.executable).with_name("vrtm")
    command = [str(vrtm), *map(str, arguments)]
    done = subprocess.run(command, capture_output=True, text=True, timeout=120)
    if done.returncode:
        raise RuntimeError(f"{' '.join(command)}: {done.stderr.strip()}")


def bake(out, *arguments):
    run("bake", "--device", "cpu", "--out", out, *arguments)


def bake_asset(out, folder, mesh, rigidity, *arguments):
    """Bakes the pose of an asset's mesh: redirect.<UDIM>.exr and warp.<UDIM>.exr."""
    pose = pathlib.Path(out) / "pose.obj"
    pose.write_text("".join(f"v {x:.9g} {y:.9g} {z:.9g}\n" for x, y, z in mesh.pose))
    names = ["--warp", "--name", "<kind>.<UDIM>.exr"]
    bake(out, folder / "rest.obj", "--poses", pose, "--rigidity", rigidity, *names, *arguments)
