"""Bakes the model, and draws its textures and what they have to look like: run once, before all checks.

    fixture.py FOLDER
"""

import pathlib
import sys

import numpy as np

import model
import picture
import warp

TEXTURE = 512
MAP = 256


def height(uv, tile):
    """Studs that bulge, with stripes across, whose direction tells how far a stud's normals are turned."""
    total = np.zeros(uv.shape[:-1])
    for x, y, radius in model.STUDS[tile]:
        d = uv - [x, y]
        edge = np.clip(1.25 - 1.25 * np.hypot(d[..., 0], d[..., 1]) / radius, 0, 1)
        stripes = np.sin(2 * np.pi * 4 * (0.8 * d[..., 0] + 0.6 * d[..., 1]) / radius)
        total += edge ** 2 * (3 - 2 * edge) * radius * (0.35 + 0.05 * stripes)
    return total


def difference(function, uv, step=1e-5):
    """Derivatives by u and by v."""
    return [(function(uv + d) - function(uv - d)) / (2 * step) for d in ([step, 0], [0, step])]


def unit(vectors):
    return vectors / np.linalg.norm(vectors, axis=-1, keepdims=True)


def normals(uv, tile):
    """The normal map that belongs to `height`, as vectors."""
    du, dv = difference(lambda at: height(at, tile), uv)
    return unit(np.stack([-du, -dv, np.ones_like(du)], -1))


def displacement(uv, tile):
    """Studs that lean to one side, as vectors: along u, along v, along the normal."""
    total = np.zeros(uv.shape[:-1])
    for x, y, radius in model.STUDS[tile]:
        edge = np.clip(1.25 - 1.25 * np.hypot(*np.moveaxis(uv - [x, y], -1, 0)) / radius, 0, 1)
        total += edge ** 2 * (3 - 2 * edge) * radius * 0.5
    return total[..., None] * [0.8, 0.6, 1]


def turned(exact, uv, tile, vectors):
    """Vectors of a map in tangent space under the original UVs that make the studs look as if they had moved as a whole.

    `vectors(uv, tile)`, those of the map, belong to a frame along the redirected u. Its direction on the surface X is the
    first column of dX/d(u, v) times the inverse of the redirection's Jacobian, all of it known in closed form or in f64.
    Also returns the angle, in degrees, between that direction and dX/du, where there is a stud.

    `normal` is that of the UV plane's upper side: on a mirrored chart it points inside. Seen from there nothing is
    mirrored, and the third of the three numbers, which is along the normal that points outside, does not turn.
    """
    flat = uv.reshape(-1, 2)
    at, jacobian = exact.inverse(flat, jacobian=True)
    along_u, along_v = difference(lambda g: model.surface(g[:, 0], g[:, 1], tile), flat + [tile - 1001, 0])
    normal = unit(np.cross(along_u, along_v))
    redirected = along_u * jacobian[:, 3:] - along_v * jacobian[:, 2:3]
    tangent, ahead = unit(along_u), unit(redirected)
    across = np.cross(normal, tangent)
    n = vectors(at, tile)
    world = n[:, :1] * ahead + n[:, 1:2] * np.cross(normal, ahead) + n[:, 2:] * normal
    out = np.stack([(world * axis).sum(1) for axis in (tangent, across, normal)], -1)
    angle = np.degrees(np.arctan2((ahead * across).sum(1), (ahead * tangent).sum(1)))
    stud = warp.bilinear(model.rigidity(tile), at)[:, 0] > 0.5
    return out.reshape(*uv.shape[:-1], 3), np.abs(angle[stud])


def forms(folder):
    """The redirection in all forms of files, as `vrtm bake` writes them; and, from these, in forms that it does not write."""
    model_files = [folder / "rest.obj", "--poses", folder / "pose.obj", "--rigidity", folder / "rigidity.<UDIM>.png",
                   "--size", MAP]
    outputs = ["--warp", "--jacobian", "--filter-scale", "--name", "<kind>.<UDIM>.exr"]
    model.bake(folder, *model_files, *outputs)
    for name, *options in (["udim"], ["delta"], ["udim", "--alpha"], ["udim", "--half"], ["delta", "--half"]):
        pattern = "_".join([name] + [option[2:] for option in options]) + ".<UDIM>.exr"
        model.bake(folder, *model_files, "--form", name, *options, "--name", pattern)
    for tile in model.STUDS:
        udim = warp.read(folder / f"udim.{tile}.exr")
        warp.write(folder / f"untagged.{tile}.exr", udim)
        warp.write(folder / f"two_channels.{tile}.exr", udim[..., :2])
        udim[..., :2] -= warp.read(folder / f"delta.{tile}.exr")[..., :2]
        warp.write(folder / f"identity.{tile}.exr", udim, attributes={"colorInteropID": "data"})


def main(folder):
    folder = pathlib.Path(folder)
    model.make(folder)
    forms(folder)
    uv, fine = warp.centres(TEXTURE, TEXTURE), warp.centres(2 * TEXTURE, 2 * TEXTURE)
    for tile in model.STUDS:
        exact = warp.Warp(folder / f"warp.{tile}.exr")
        warp.write(folder / f"texture.{tile}.png", picture.texture(model.rigidity(tile), TEXTURE, tile))
        texture = warp.read(folder / f"texture.{tile}.png")
        warp.write(folder / f"truth.{tile}.exr", exact.texture(texture))
        # The same texture at the truth's resolution: how far two pictures are apart by that alone.
        warp.write(folder / f"again.{tile}.exr", warp.bilinear(texture, fine))
        warp.write(folder / f"normals.{tile}.exr", normals(uv, tile) * 0.5 + 0.5)
        truth, angle = turned(exact, fine, tile, normals)
        warp.write(folder / f"normals_truth.{tile}.exr", truth * 0.5 + 0.5)
        np.save(folder / f"angle.{tile}.npy", angle)
        for name, vectors in ("displacement", displacement(uv, tile)), ("displacement_truth",
                                                                        turned(exact, uv, tile, displacement)[0]):
            # Blender's order: along u, along the normal, along v.
            warp.write(folder / f"{name}.{tile}.exr", vectors[..., [0, 2, 1]])
        # Detail of a texel, which has to be filtered away where a pixel sees many.
        noise = np.random.default_rng(tile).integers(0, 2, (2 * TEXTURE, 2 * TEXTURE, 1)).astype(float)
        warp.write(folder / f"noise.{tile}.png", np.repeat(noise, 3, -1))
        warp.write(folder / f"height.{tile}.exr", np.repeat(height(uv, tile)[..., None], 3, -1))


if __name__ == "__main__":
    main(*sys.argv[1:])
