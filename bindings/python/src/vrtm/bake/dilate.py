"""`vrtm dilate`: textures with, around each chart, what the surface shows beyond the chart's seams.

A renderer's filter reads beyond the border of a chart. A texture that was dilated so has the content of the other side
of the seam there, in its place, so that both sides show the same on the seam, in mipmaps, too.
"""

from __future__ import annotations

import argparse
import os
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

import vrtm
from vrtm.bake import image_file, overwrite, staging, warped
from vrtm.bake.console import Console
from vrtm.bake.failure import INPUT, Failure, describe
from vrtm.bake.fingerprint import Fingerprint
from vrtm.bake.image_file import Target
from vrtm.bake.scene import Scene, SceneOptions, Shape
from vrtm.bake.scene.images import find_maps

VERSION = 1
"""Of the way of copying: a file that was made in another way is not up to date."""

PASSES = 2
"""What is copied lies beside a seam: the first pass interpolates it with texels that the second one finds dilated."""


@dataclass(frozen=True, eq=False)
class _Mesh:
    """A mesh and the files of one pattern that it looks up, by UDIM number."""

    shape: Shape
    asset: vrtm.Asset
    files: dict[int, str]


def dilate(parsed: argparse.Namespace, console: Console) -> None:
    """Runs the command. Raises Failure, and what vrtm.bake.failure.describe knows."""
    options = SceneOptions(meshes=tuple(parsed.meshes), uv=parsed.uv, rest=parsed.rest)
    with Scene(parsed.scene, options) as scene, vrtm.Device("cpu") as device:
        for warning in scene.warnings:
            console.warning(warning)
        assets = [_asset(device, shape, parsed.weld) for shape in scene.shapes]
        groups = []
        for pattern in dict.fromkeys(parsed.texture):
            meshes = []
            for shape, asset in zip(scene.shapes, assets):
                udims = [tile.udim for tile in asset.tiles]
                if udims:
                    meshes.append(_Mesh(shape, asset, find_maps(pattern, shape.name, udims)))
            if not any(mesh.files for mesh in meshes):
                raise Failure(INPUT, f"--texture {pattern}: no mesh has such a file")
            groups.append(meshes)
        inputs = [(parsed.scene, "the scene"), *((path, "a file of the scene") for path in scene.files)]
        outputs = []
        for meshes in groups:
            paths = dict.fromkeys(path for mesh in meshes for path in mesh.files.values())
            inputs += [(path, "a texture") for path in paths]
            outputs += [(_output(parsed.out, path), f"--out, for {path}") for path in paths]
        overwrite.check(outputs, inputs, parsed.overwrite)
        staging.sweep(parsed.out)
        written = sum(_dilate(meshes, parsed, console) for meshes in groups)
    console.info(f"{written} files written, {len(outputs) - written} up to date: {parsed.out}")


def _output(folder: str, path: str) -> str:
    return os.path.join(folder, os.path.splitext(os.path.basename(path))[0] + warped.extension(path))


def _asset(device: vrtm.Device, shape: Shape, weld: str) -> vrtm.Asset:
    try:
        return vrtm.Asset(
            device,
            shape.rest,
            shape.indices,
            face_counts=shape.face_counts,
            uvs=shape.uvs,
            uv_indices=shape.uv_indices,
            weld=weld,
        )
    except vrtm.Error as error:
        raise describe(error, shape.path) from error


def _dilate(meshes: Sequence[_Mesh], parsed: argparse.Namespace, console: Console) -> int:
    """Dilates the textures of one pattern. Returns how many files were written."""
    textures = {path: warped.read(path) for mesh in meshes for path in mesh.files.values()}
    common = Fingerprint().text(VERSION, vrtm.version(), parsed.reach, parsed.weld)
    for mesh in meshes:
        shape = mesh.shape
        for array in (shape.rest, shape.face_counts, shape.indices, shape.uvs, shape.uv_indices):
            common.array(array)
        common.text(sorted(mesh.files))
    for path in textures:
        common.text(textures[path].inputs)
    targets = {}
    for path, texture in textures.items():
        height, width, _ = texture.pixels.shape
        facts: dict[str, str | int] = {"vrtm:kind": "dilated", "vrtm:inputs": common.copy().text(path).hex()}
        targets[path] = Target(
            _output(parsed.out, path),
            width,
            height,
            texture.channels,
            str(texture.pixels.dtype),
            facts,
            texture.attributes,
            texture.format,
            texture.alpha,
        )
    left = [path for path in textures if image_file.up_to_date(targets[path], parsed.overwrite) is None]
    if not left:
        return 0
    copies = {path: _copies(path, texture, meshes, parsed.reach) for path, texture in textures.items()}
    now = {path: texture.pixels.astype(np.float32) for path, texture in textures.items()}
    ranges = {path: (t.pixels.min(axis=(0, 1)), t.pixels.max(axis=(0, 1))) for path, t in textures.items()}
    for _ in range(PASSES):
        before = {path: np.pad(pixels, ((2, 2), (2, 2), (0, 0)), mode="edge") for path, pixels in now.items()}
        for path in textures:
            for source, (rows, columns, uv) in copies[path].items():
                height, width, _ = textures[source].pixels.shape
                # What overshoots beside an edge must not leave the range that the texture has.
                low, high = ranges[source]
                values = warped.interpolated(before[source], uv[:, 0] * width, (1 - uv[:, 1]) * height)
                now[path][rows, columns] = np.clip(values, low, high)
    for path in left:
        texture = textures[path]
        whole = texture.pixels.dtype.kind == "u"
        pixels = (np.rint(now[path]) if whole else now[path]).astype(texture.pixels.dtype)
        # What is not copied stays as it was, bit by bit.
        kept = np.ones(pixels.shape[:2], bool)
        for rows, columns, _ in copies[path].values():
            kept[rows, columns] = False
        pixels[kept] = texture.pixels[kept]
        image_file.write(targets[path], pixels)
        console.detail(f"{targets[path].path}: {1 - kept.mean():.1%} of its texels")
    return len(left)


def _copies(
    path: str, texture: warped.Texture, meshes: Sequence[_Mesh], reach: float
) -> dict[str, tuple[np.ndarray, np.ndarray, np.ndarray]]:
    """The texels of a texture that are copied, by the file that they are copied from: their rows and columns, and the
    UVs, within the tile, of what they show."""
    height, width, _ = texture.pixels.shape
    covered = np.zeros((height, width), bool)
    found: dict[str, list[np.ndarray]] = {}
    taken = np.zeros((height, width), bool)
    across, down = (np.arange(width) + 0.5) / width, 1 - (np.arange(height) + 0.5) / height
    pieces = []
    for mesh in meshes:
        for udim in (udim for udim, file in mesh.files.items() if file == path):
            try:
                dilation = mesh.asset.tile(udim).dilation((width, height), reach=reach, channels=4)
            except vrtm.Error as error:
                raise describe(error, f"{mesh.shape.path}, tile {udim}") from error
            origin = np.array([(udim - 1001) % 10, (udim - 1001) // 10])
            own = np.stack(np.broadcast_arrays(across[None, :], down[:, None]), axis=-1) + origin
            known = dilation[..., 3] > 0
            away = known & (np.abs(dilation[..., :2] - own) > 1e-6).any(axis=-1)
            covered |= known & ~away
            pieces.append((mesh, dilation, away))
    for mesh, dilation, away in pieces:
        rows, columns = np.nonzero(away & ~covered & ~taken)
        uv = dilation[rows, columns, :2].astype(np.float64)
        tiles = np.floor(uv).astype(np.int64)
        udims = 1001 + tiles[:, 0] + 10 * tiles[:, 1]
        for udim in np.unique(udims):
            source = mesh.files.get(int(udim))
            if source is not None:
                chosen = udims == udim
                part = [rows[chosen], columns[chosen], (uv - tiles)[chosen]]
                taken[part[0], part[1]] = True
                old = found.get(source)
                found[source] = part if old is None else [np.concatenate(pair) for pair in zip(old, part)]
    return {source: (rows, columns, uv) for source, (rows, columns, uv) in found.items()}
