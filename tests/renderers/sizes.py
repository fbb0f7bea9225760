"""Cost of a map's size: the table of docs/rendering/map_size.md.

    sizes.py FOLDER-OF-ASSETS NAME FRAME [CELLS] [TEXTURE]

For the tile 1001 of an asset, over the texels that its faces cover: how far the UV that is read bilinearly from a map is
from the exact redirection, in texels of the texture, and how much the colour that is looked up there differs.
"""

import pathlib
import sys
import tempfile

import numpy as np

import model
import picture
import warp


def covered(mesh, points):
    """Texel centres, of a raster of so many per side, in the faces of the tile's unit square."""
    inside = np.zeros((points, points), bool)
    for a, b, c in mesh.uvs[mesh.uv_triangles] * points - 0.5:
        low = np.maximum(np.ceil(np.minimum(np.minimum(a, b), c)).astype(int), 0)
        high = np.minimum(np.floor(np.maximum(np.maximum(a, b), c)).astype(int), points - 1)
        x, y = np.meshgrid(np.arange(low[0], high[0] + 1), np.arange(low[1], high[1] + 1))
        sides = [(q[0] - p[0]) * (y - p[1]) - (q[1] - p[1]) * (x - p[0]) for p, q in ((a, b), (b, c), (c, a))]
        inside[y, x] |= np.all(np.array(sides) >= 0, 0) | np.all(np.array(sides) <= 0, 0)
    y, x = np.nonzero(inside)
    return (np.stack([x, y], -1) + 0.5) / points


def main(assets, name, frame, cells=512, size=4096):
    source = pathlib.Path(assets) / name
    mesh, size = model.asset(source, int(frame)), int(size)
    rigidity = warp.read(source / "rigidity.1001.png")[..., :1]
    with tempfile.TemporaryDirectory() as folder:
        model.bake_asset(folder, source, mesh, source / "rigidity.<UDIM>.png", "--size", cells)
        exact = warp.Warp(pathlib.Path(folder) / "warp.1001.exr")
    texture = picture.texture(rigidity, size)
    # A million points tell as much as all texels.
    uv = covered(mesh, 1536)
    uv = uv + np.random.default_rng(1).uniform(-0.5, 0.5, uv.shape) / 1536
    uv = np.clip(uv, 0, 1)
    truth = exact.inverse(uv)
    colour = warp.bilinear(texture, truth)

    def figures(at):
        texels = np.hypot(*((at - truth) * size).T)
        shades = np.abs(warp.bilinear(texture, at) - colour).max(-1) * 255
        return [f"{np.percentile(v, 99):.2f} / {v.max():.1f}" if v is texels else
                f"{np.percentile(v, 99):.1f} / {v.max():.0f}" for v in (texels, shades)]

    print(f"{name} frame {frame}, {cells} x {cells} cells, texture {size} x {size}, {len(uv)} points: p99 / max")
    print("| map | f32: texels | of 255 | f16 absolute: texels | of 255 | f16 delta: texels | of 255 |")
    print("|---|---|---|---|---|---|---|")
    none = figures(uv)
    for n in 128, 256, 512, 1024, 2048:
        here, at = exact.map(n), warp.centres(n, n)
        row = figures(warp.bilinear(here.astype(np.float32).astype(np.float64), uv))
        row += figures(warp.bilinear(here.astype(np.float16).astype(np.float64), uv))
        row += figures(uv + warp.bilinear((here - at).astype(np.float16).astype(np.float64), uv))
        print(f"| {n} | " + " | ".join(row) + " |", flush=True)
    print(f"| none: original UVs | {none[0]} | {none[1]} |")


if __name__ == "__main__":
    main(*sys.argv[1:])
