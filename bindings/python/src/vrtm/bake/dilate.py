"""`vrtm dilate`: textures with, around each chart, what the surface shows beyond the chart's seams.

A renderer's filter reads beyond the border of a chart. A texture that was dilated so has the content of the other side
of the seam there, in its place, so that both sides show the same on the seam.
"""

import argparse
import contextlib
import os
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

import vrtm
from vrtm import dilation
from vrtm.bake import image_file, left_out, overwrite, staging, warped
from vrtm.bake.console import Console
from vrtm.bake.failure import INPUT, Failure, describe
from vrtm.bake.fingerprint import Fingerprint
from vrtm.bake.image_file import Target
from vrtm.bake.scene import Scene, SceneError, SceneOptions, Shape
from vrtm.bake.scene.images import find_maps, white
from vrtm.bake.stopping import Stop
from vrtm.bake.words import counted

VERSION = 3
"""Of the way of copying: a file that was made in another way is not up to date."""


@dataclass(frozen=True, eq=False)
class Mesh:
    """A mesh and the files of one pattern that it looks up, by UDIM number."""

    shape: Shape
    asset: vrtm.Asset
    files: dict[int, str]
    layer: int = 0
    """The layer of tiles whose charts count, where a tile has it."""


def dilate(parsed: argparse.Namespace, console: Console, stop: Stop) -> None:
    """Runs the command, until it is to stop. Raises Failure, and what vrtm.bake.failure.describe knows."""
    # All meshes: texels in the charts of any of them stay as they are.
    options = SceneOptions(uv=tuple(parsed.uv), rest=parsed.rest)
    with contextlib.ExitStack() as opened:
        with stop.at_once(console.error):
            scene = opened.enter_context(Scene(parsed.scene, options))
            device = opened.enter_context(vrtm.Device("cpu"))
            for warning in [*scene.warnings, *left_out.lines(left_out.unmeant(scene.left_out))]:
                console.warning(warning)
            assets = [_asset(device, shape, parsed.weld) for shape in scene.shapes]
            down = parsed.normal_y == "down"
            given = dict.fromkeys([*((p, False) for p in parsed.texture), *((p, True) for p in parsed.normal_maps)])
            copies = [warped.Copy(pattern, "", is_normal, down) for pattern, is_normal in given]
            if not copies:
                raise Failure(INPUT, "one of --texture and --normal-map is needed: it says what is copied")
            groups = [(copy, _meshes(copy, scene.shapes, assets, console)) for copy in copies]
            inputs = [(parsed.scene, "the scene"), *((path, "a file of the scene") for path in scene.files)]
            outputs = []
            for _, meshes in groups:
                paths = dict.fromkeys(path for mesh in meshes for path in mesh.files.values())
                inputs += [(path, "a texture") for path in paths]
                outputs += [(_output(parsed.out, path), f"--out, for {path}") for path in paths]
            overwrite.check(outputs, inputs, parsed.overwrite)
        staging.sweep(parsed.out)
        # Files that are up to date, or painted on, are found before anything is written.
        left = [_left(copy, meshes, parsed, stop) for copy, meshes in groups]
        for (copy, meshes), targets in zip(groups, left):
            if targets:
                _dilate(copy, meshes, targets, parsed.reach, console, stop)
    written = sum(map(len, left))
    console.info(f"{counted(written, 'file')} written, {len(outputs) - written} up to date: {parsed.out}")


def _meshes(copy: warped.Copy, shapes: Sequence[Shape], assets: Sequence[vrtm.Asset], console: Console) -> list[Mesh]:
    """The meshes that look files of a pattern up; a warning names the others. Raises SceneError if there is none."""
    meshes: list[Mesh] = []
    missing: list[tuple[Shape, SceneError]] = []
    for shape, asset in zip(shapes, assets):
        try:
            udims = [tile.udim for tile in asset.tiles]
            meshes.append(Mesh(shape, asset, find_maps(copy.pattern, shape.name, udims)))
        except SceneError as error:
            missing.append((shape, error))
    if not any(mesh.files for mesh in meshes):
        raise missing[0][1] if missing else Failure(INPUT, f"{copy.pattern}: no mesh has such a file")
    for shape, error in missing:
        console.warning(f"{shape.path}: left out, with its charts: {error}")
    return meshes


def _output(folder: str, path: str) -> str:
    return os.path.join(folder, os.path.splitext(os.path.basename(path))[0] + warped.extension(path))


def _asset(device: vrtm.Device, shape: Shape, weld: str) -> vrtm.Asset:
    try:
        return shape.asset(device, weld)
    except vrtm.Error as error:
        raise describe(error, shape.path) from error


def _left(copy: warped.Copy, meshes: Sequence[Mesh], parsed: argparse.Namespace, stop: Stop) -> dict[str, Target]:
    """Targets of one pattern that are not up to date, by the files of the textures. Raises Failure."""
    paths = list(dict.fromkeys(path for mesh in meshes for path in mesh.files.values()))
    first = copy.read(paths[0])
    common = Fingerprint().text(VERSION, vrtm.version(), parsed.reach, parsed.weld, copy.is_normal, copy.down)
    for mesh in meshes:
        shape = mesh.shape
        for array in shape.arrays:
            common.array(array)
        common.text(sorted(mesh.files))
    textures = {}
    for path in paths:
        stop.check()
        texture = copy.read(path)
        if (texture.pixels.dtype, texture.channels) != (first.pixels.dtype, first.channels):
            raise Failure(INPUT, f"{path}: other channels or numbers than those of {paths[0]}")
        common.text(texture.inputs)
        textures[path] = texture
    left = {}
    for path, texture in textures.items():
        inputs = common.copy().text(os.path.basename(path)).hex()
        facts = {"vrtm:kind": "dilated", "vrtm:reach": str(parsed.reach), "vrtm:inputs": inputs}
        target = texture.target(_output(parsed.out, path), facts)
        if image_file.up_to_date(target, parsed.overwrite) is None:
            left[path] = target
    return left


def _dilate(
    copy: warped.Copy, meshes: Sequence[Mesh], targets: dict[str, Target], reach: float, console: Console, stop: Stop
) -> None:
    """Writes what is left of the textures of one pattern."""
    textures = dilated(copy, meshes, reach)
    for path, target in targets.items():
        stop.check()
        pixels = textures[path].pixels
        image_file.write(target, pixels)
        changed = np.mean((pixels != warped.read(path).pixels).any(axis=-1))
        console.verbose(f"{target.path}: {changed:.1%} of its texels")


def dilated(copy: warped.Copy, meshes: Sequence[Mesh], reach: float) -> dict[str, warped.Texture]:
    """The textures of one pattern with what lies beyond the seams of the meshes, by their files."""
    paths = dict.fromkeys(path for mesh in meshes for path in mesh.files.values())
    textures = {path: copy.read(path) for path in paths}
    normals = None if not copy.is_normal else "down" if copy.down else "up"
    lookups = [
        dilation.Lookups(mesh.files, lambda udim, size, m=mesh: _dilation(m, udim, size, reach)) for mesh in meshes
    ]
    images = {
        path: texture.pixels.astype(np.float32) / white(texture.pixels.dtype) for path, texture in textures.items()
    }
    done = {}
    for path, (found, changed) in dilation.dilated(images, lookups, normals).items():
        texture = textures[path]
        pixels = found * np.float32(white(texture.pixels.dtype))
        pixels = np.rint(pixels) if texture.pixels.dtype.kind == "u" else pixels
        # Texels that are not copied stay as they were, bit by bit.
        pixels = np.where(changed[..., None], pixels.astype(texture.pixels.dtype), texture.pixels)
        done[path] = replace(texture, pixels=pixels)
    return done


def _dilation(mesh: Mesh, udim: int, size: tuple[int, int], reach: float) -> np.ndarray:
    try:
        layer = min(mesh.layer, mesh.asset.tile(udim).layers - 1)
        return mesh.asset.tile(udim, layer=layer).dilation(size, reach=reach, channels=4)
    except vrtm.Error as error:
        raise describe(error, f"{mesh.shape.path}, tile {udim}") from error
