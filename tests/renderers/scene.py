"""The model's renders that several checks compare."""

import pathlib
import sys

import numpy as np

import blender
import model
import warp

FOLDER = pathlib.Path(sys.argv[1])
SIZE = 640, 280


def mesh(quads=48):
    """The posed model; with 48 quads per side as it lies in the files that bake got."""
    parts = [model.grid(tile, quads) for tile in model.STUDS]
    uvs = np.concatenate([uv for uv, _ in parts])
    triangles = np.concatenate([faces + i * len(parts[0][0]) for i, (_, faces) in enumerate(parts)])
    pose = np.concatenate([model.surface(uv[:, 0], uv[:, 1], tile) for (uv, _), tile in zip(parts, model.STUDS)])
    return model.Mesh(triangles, uvs, pose)


def show(build, **options):
    """A render of the model with what `build(tree)` returns, a socket with a colour, as light."""
    tree = blender.start(mesh(), SIZE, samples=options.pop("samples", 8), **options)
    socket = blender.emission(tree)
    tree.links.new(build(tree), socket)
    return blender.render()


def plain(name, **options):
    """The texture under the original UVs."""
    return lambda tree: texture(tree, name, **options).outputs["Color"]


def texture(tree, name, **options):
    name += "" if "<UDIM>" in name else ".<UDIM>.exr"
    return blender.image_texture(tree, FOLDER / name, tiled=True, **options)


def corner_uvs(data):
    """A second UV layer of a Blender mesh: the redirected UV of each corner."""
    shape = mesh()
    out = np.zeros_like(shape.uvs)
    count = len(shape.uvs) // len(model.STUDS)
    for i, tile in enumerate(model.STUDS):
        part, offset = slice(i * count, (i + 1) * count), [tile - 1001, 0]
        exact = warp.Warp(FOLDER / f"warp.{tile}.exr")
        out[part] = exact.inverse(shape.uvs[part] - offset) + offset
    data.uv_layers.new(name="redirected").data.foreach_set("uv", out[shape.triangles].astype(np.float32).ravel())
