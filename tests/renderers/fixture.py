"""Bakes the model, and draws its textures and what they have to look like: run once, before all checks.

    fixture.py BAKE FOLDER
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


def turned_normals(exact, uv, tile):
    """What a normal map under the original UVs has to hold for the studs to look as if they had moved as a whole.

    The normals of the map belong to a frame along the redirected u. Its direction on the surface X is the first column of
    dX/d(u, v) times the inverse of the redirection's Jacobian, all of it known in closed form or in f64. Also returns the
    angle, in degrees, between that direction and dX/du, where there is a stud.
    """
    flat = uv.reshape(-1, 2)
    at, jacobian = exact.inverse(flat, jacobian=True)
    along_u, along_v = difference(lambda g: model.surface(g[:, 0], g[:, 1], tile), flat + [tile - 1001, 0])
    normal = unit(np.cross(along_u, along_v))
    redirected = along_u * jacobian[:, 3:] - along_v * jacobian[:, 2:3]
    tangent, turned = unit(along_u), unit(redirected)
    across = np.cross(normal, tangent)
    n = normals(at, tile)
    world = n[:, :1] * turned + n[:, 1:2] * np.cross(normal, turned) + n[:, 2:] * normal
    out = np.stack([(world * axis).sum(1) for axis in (tangent, across, normal)], -1)
    angle = np.degrees(np.arctan2((turned * across).sum(1), (turned * tangent).sum(1)))
    stud = warp.bilinear(model.rigidity(tile), at)[:, 0] > 0.5
    return out.reshape(*uv.shape[:-1], 3), np.abs(angle[stud])


def forms(program, folder):
    """The redirection in all forms of files, as bake writes them; and, from these, in forms that it does not write."""
    model_files = ["--rest", folder / "rest.obj", "--pose", folder / "pose.obj", "--rigidity",
                   folder / "rigidity.<UDIM>.png", "--size", MAP, "--no-sheet"]
    model.bake(program, folder, *model_files, "--jacobian", "--name", "<kind>.<UDIM>.exr")
    for name, *options in (["udim"], ["delta"], ["udim", "--alpha"], ["udim", "--half"], ["delta", "--half"]):
        pattern = "_".join([name] + [option[2:] for option in options]) + ".<UDIM>.exr"
        model.bake(program, folder, *model_files, "--form", name, *options, "--no-warp", "--name", pattern)
    for tile in model.STUDS:
        udim = warp.read(folder / f"udim.{tile}.exr")
        warp.write(folder / f"untagged.{tile}.exr", udim)
        warp.write(folder / f"two_channels.{tile}.exr", udim[..., :2])
        udim[..., :2] -= warp.read(folder / f"delta.{tile}.exr")[..., :2]
        warp.write(folder / f"identity.{tile}.exr", udim, attributes={"colorInteropID": "data"})


def main(program, folder):
    folder = pathlib.Path(folder)
    model.make(folder)
    forms(program, folder)
    uv, fine = warp.centres(TEXTURE, TEXTURE), warp.centres(2 * TEXTURE, 2 * TEXTURE)
    for tile in model.STUDS:
        exact = warp.Warp(folder / f"warp.{tile}.exr")
        warp.write(folder / f"texture.{tile}.png", picture.texture(model.rigidity(tile), TEXTURE, tile))
        texture = warp.read(folder / f"texture.{tile}.png")
        warp.write(folder / f"truth.{tile}.exr", exact.texture(texture))
        # The same texture at the truth's resolution: how far two pictures are apart by that alone.
        warp.write(folder / f"again.{tile}.exr", warp.bilinear(texture, fine))
        warp.write(folder / f"normals.{tile}.exr", normals(uv, tile) * 0.5 + 0.5)
        turned, angle = turned_normals(exact, fine, tile)
        warp.write(folder / f"normals_truth.{tile}.exr", turned * 0.5 + 0.5)
        np.save(folder / f"angle.{tile}.npy", angle)
        warp.write(folder / f"height.{tile}.exr", np.repeat(height(uv, tile)[..., None], 3, -1))


if __name__ == "__main__":
    main(*sys.argv[1:])
