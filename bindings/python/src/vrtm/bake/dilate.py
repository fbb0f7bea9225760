"""`vrtm dilate`: textures with, around each chart, what the surface shows beyond the chart's seams.

A renderer's filter reads beyond the border of a chart. A texture that was dilated so has the content of the other side
of the seam there, in its place, so that both sides show the same on the seam.
"""

from __future__ import annotations

import argparse
import os
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

import vrtm
from vrtm.bake import image_file, overwrite, staging, warped
from vrtm.bake.console import Console
from vrtm.bake.failure import INPUT, Failure, describe
from vrtm.bake.fingerprint import Fingerprint
from vrtm.bake.image_file import Target
from vrtm.bake.scene import Scene, SceneError, SceneOptions, Shape
from vrtm.bake.scene.images import find_maps

VERSION = 2
"""Of the way of copying: a file that was made in another way is not up to date."""


@dataclass(frozen=True, eq=False)
class Mesh:
    """A mesh and the files of one pattern that it looks up, by UDIM number."""

    shape: Shape
    asset: vrtm.Asset
    files: dict[int, str]


def dilate(parsed: argparse.Namespace, console: Console) -> None:
    """Runs the command. Raises Failure, and what vrtm.bake.failure.describe knows."""
    # All meshes: what lies in the charts of any of them stays as it is.
    with Scene(parsed.scene, SceneOptions(uv=parsed.uv, rest=parsed.rest)) as scene, vrtm.Device("cpu") as device:
        for warning in scene.warnings:
            console.warning(warning)
        assets = [_asset(device, shape, parsed.weld) for shape in scene.shapes]
        down = parsed.normal_y == "down"
        given = [(pattern, False) for pattern in parsed.texture] + [(pattern, True) for pattern in parsed.normal_maps]
        copies = [warped.Copy(pattern, "", is_normal, down) for pattern, is_normal in dict.fromkeys(given)]
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
        # What is up to date, and what somebody has painted on, is found before anything is written.
        left = [_left(copy, meshes, parsed) for copy, meshes in groups]
        for (copy, meshes), targets in zip(groups, left):
            if targets:
                _dilate(copy, meshes, targets, parsed.reach, console)
    written = sum(map(len, left))
    console.info(f"{written} files written, {len(outputs) - written} up to date: {parsed.out}")


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


def _left(copy: warped.Copy, meshes: Sequence[Mesh], parsed: argparse.Namespace) -> dict[str, Target]:
    """What is not up to date of the textures of one pattern. Raises Failure."""
    paths = list(dict.fromkeys(path for mesh in meshes for path in mesh.files.values()))
    first = warped.read(paths[0])
    common = Fingerprint().text(VERSION, vrtm.version(), parsed.reach, parsed.weld, copy.is_normal, copy.down)
    for mesh in meshes:
        shape = mesh.shape
        for array in (shape.rest, shape.face_counts, shape.indices, shape.uvs, shape.uv_indices):
            common.array(array)
        common.text(sorted(mesh.files))
    targets = {}
    for path in paths:
        texture = warped.read(path)
        if (texture.pixels.dtype, texture.channels) != (first.pixels.dtype, first.channels):
            raise Failure(INPUT, f"{path}: other channels or numbers than those of {paths[0]}")
        common.text(texture.inputs)
        height, width, _ = texture.pixels.shape
        named = (texture.channels, str(texture.pixels.dtype), texture.attributes, texture.format, texture.alpha)
        if copy.is_normal and len(texture.channels) < 3:
            raise Failure(INPUT, f"{path}: a normal map needs three channels, it has {len(texture.channels)}")
        targets[path] = (_output(parsed.out, path), width, height, *named)
    left = {}
    for path, (output, width, height, channels, dtype, attributes, form, alpha) in targets.items():
        inputs = common.copy().text(os.path.basename(path)).hex()
        facts: dict[str, str | int] = {"vrtm:kind": "dilated", "vrtm:inputs": inputs}
        target = Target(output, width, height, channels, dtype, facts, attributes, form, alpha)
        if image_file.up_to_date(target, parsed.overwrite) is None:
            left[path] = target
    return left


def _dilate(
    copy: warped.Copy, meshes: Sequence[Mesh], targets: dict[str, Target], reach: float, console: Console
) -> None:
    """Writes what is left of the textures of one pattern."""
    textures = dilated(copy, meshes, reach)
    for path, target in targets.items():
        pixels = textures[path].pixels
        image_file.write(target, pixels)
        console.detail(f"{target.path}: {np.mean((pixels != warped.read(path).pixels).any(axis=-1)):.1%} of its texels")


def dilated(copy: warped.Copy, meshes: Sequence[Mesh], reach: float) -> dict[str, warped.Texture]:
    """The textures of one pattern with what lies beyond the seams of the meshes, by their files."""
    paths = dict.fromkeys(path for mesh in meshes for path in mesh.files.values())
    textures = {path: warped.read(path) for path in paths}
    for path, texture in textures.items():
        if copy.is_normal and len(texture.channels) < 3:
            raise Failure(INPUT, f"{path}: a normal map needs three channels, it has {len(texture.channels)}")
    found = {path: _copies(copy, path, texture, meshes, reach) for path, texture in textures.items()}
    now = {path: texture.pixels.astype(np.float32) for path, texture in textures.items()}
    for final in (False, True):
        before = {path: pixels.copy() for path, pixels in now.items()}
        for path in textures:
            for source, (rows, columns, uv, jacobian) in found[path].copies.items():
                height, width, _ = before[source].shape
                x, y = uv[:, 0] * width, (1 - uv[:, 1]) * height
                # First of texels in charts alone; then also of what was copied beside them, as finely as filters do.
                sample = _filtered if final else _in_charts
                values = sample(before[source], found[source].covered, x, y)
                if copy.is_normal:
                    top = _top(textures[source])
                    values[:, :3] = warped.turned(values[:, :3] / top, jacobian, copy.down) * top
                now[path][rows, columns] = values
    done = {}
    for path, texture in textures.items():
        whole = texture.pixels.dtype.kind == "u"
        kept = np.ones(texture.pixels.shape[:2], bool)
        for rows, columns, _, _ in found[path].copies.values():
            kept[rows, columns] = False
        pixels = np.rint(now[path]) if whole else now[path]
        # What is not copied stays as it was, bit by bit.
        pixels = np.where(kept[..., None], texture.pixels, pixels.astype(texture.pixels.dtype))
        done[path] = replace(texture, pixels=pixels)
    return done


def _top(texture: warped.Texture) -> float:
    """The number that stands for 1."""
    return float(np.iinfo(texture.pixels.dtype).max) if texture.pixels.dtype.kind == "u" else 1.0


def _in_charts(pixels: np.ndarray, covered: np.ndarray, x: np.ndarray, y: np.ndarray) -> np.ndarray:
    """The mean of those of the four texels around each place that lie in charts; of all four where none does."""
    height, width, channels = pixels.shape
    column, row = np.floor(x - 0.5).astype(np.int64), np.floor(y - 0.5).astype(np.int64)
    across, down = x - 0.5 - column, y - 0.5 - row
    total = np.zeros((2, len(x), channels))
    weights = np.zeros((2, len(x), 1))
    for j in range(2):
        for i in range(2):
            at = (np.clip(row + j, 0, height - 1), np.clip(column + i, 0, width - 1))
            weight = (np.abs(1 - i - across) * np.abs(1 - j - down))[:, None]
            for k, of in enumerate((weight * covered[at][:, None], weight)):
                total[k] += np.where(of > 0, of * pixels[at], 0)
                weights[k] += of
    inside = weights[0] > 1e-6
    return np.where(inside, total[0] / np.where(inside, weights[0], 1), total[1] / weights[1])


def _filtered(pixels: np.ndarray, _covered: np.ndarray, x: np.ndarray, y: np.ndarray) -> np.ndarray:
    """Catmull-Rom interpolation, within the range of the image: beside an edge it would overshoot."""
    finite = np.where(np.isfinite(pixels), pixels, np.nan)
    low, high = np.nanmin(finite, axis=(0, 1)), np.nanmax(finite, axis=(0, 1))
    return np.clip(warped.interpolated(np.pad(pixels, ((2, 2), (2, 2), (0, 0)), mode="edge"), x, y), low, high)


@dataclass(frozen=True, eq=False)
class _Found:
    """What is known of a texture's texels."""

    covered: np.ndarray
    """(height, width): whether a chart covers it."""
    copies: dict[str, tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]]
    """By the file that texels are copied from: their rows and columns, the UVs, within the tile, of what they show, and
    how these change from texel to texel (`_jacobian`)."""


def _copies(copy: warped.Copy, path: str, texture: warped.Texture, meshes: Sequence[Mesh], reach: float) -> _Found:
    """What is copied in a texture, by the dilations of all meshes that look it up. No chart of theirs is changed."""
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
            # More than the rounding of UVs among all tiles.
            away = known & (np.abs(dilation[..., :2] - own) > 4e-7 * (1 + own)).any(axis=-1)
            covered |= known & ~away
            pieces.append((mesh, dilation, away))
    for mesh, dilation, away in pieces:
        rows, columns = np.nonzero(away & ~covered & ~taken)
        uv = dilation[rows, columns, :2].astype(np.float64)
        # Only normals are turned.
        jacobian = _jacobian(dilation, away, rows, columns) if copy.is_normal else np.empty((len(rows), 0))
        tiles = np.floor(uv).astype(np.int64)
        udims = 1001 + tiles[:, 0] + 10 * tiles[:, 1]
        for udim in np.unique(udims):
            source = mesh.files.get(int(udim))
            if source is not None:
                chosen = udims == udim
                part = [rows[chosen], columns[chosen], (uv - tiles)[chosen], jacobian[chosen]]
                taken[part[0], part[1]] = True
                old = found.get(source)
                found[source] = part if old is None else [np.concatenate(pair) for pair in zip(old, part)]
    return _Found(covered, {source: (part[0], part[1], part[2], part[3]) for source, part in found.items()})


def _jacobian(dilation: np.ndarray, away: np.ndarray, rows: np.ndarray, columns: np.ndarray) -> np.ndarray:
    """(texels, 4): the Jacobian, row by row, of the map from where some texels lie to what they show.

    It comes from their differences to the texels beside them; of the two on either side the nearer one, since the other
    may lie beyond another seam. Where a texel has no such neighbour, the map does not turn."""
    height, width = away.shape
    uv = dilation[rows, columns, :2].astype(np.float64)
    sides = []
    for down, right, count in ((0, 1, width), (1, 0, -height)):
        # v grows against the rows.
        differences = []
        for step in (1, -1):
            r, c = rows + step * down, columns + step * right
            inside = (r >= 0) & (r < height) & (c >= 0) & (c < width)
            r, c = np.clip(r, 0, height - 1), np.clip(c, 0, width - 1)
            difference = (dilation[r, c, :2].astype(np.float64) - uv) * (step * count)
            differences.append(np.where((inside & away[r, c])[:, None], difference, np.inf))
        length = [np.abs(difference).max(axis=-1) for difference in differences]
        sides.append(np.where((length[0] <= length[1])[:, None], *differences))
    along, up = sides
    known = [np.isfinite(side).all(axis=-1, keepdims=True) for side in (along, up)]
    quarter = np.stack([up[:, 1], -up[:, 0]], axis=-1)
    along = np.where(known[0], along, np.where(known[1], quarter, [1.0, 0.0]))
    up = np.where(known[1], up, np.stack([-along[:, 1], along[:, 0]], axis=-1))
    return np.stack([along[:, 0], up[:, 0], along[:, 1], up[:, 1]], axis=-1)
