"""The maps of a mesh that basis maps are fitted to, the mesh under their texels, and measures of their sums: errors,
folds and strain."""

import dataclasses
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from vrtm.bake.frames import Frame
from vrtm.bake.mesh_work import MeshWork
from vrtm.bake.part import TileWork
from vrtm.bake.scene.images import read_map, texels_of, white
from vrtm.bake.scene.topology import fans
from vrtm.bake.scene.types import Shape
from vrtm.bake.work import Work
from vrtm.basis.controls import Driver
from vrtm.basis.fit import summed
from vrtm.basis.folds import folds
from vrtm.basis.strain import Ruler, Strain

_RANDOM = 32
"""Poses of random controls that are looked at for folds."""


@dataclass(frozen=True, eq=False)
class TileMaps:
    """A tile's place among the texels of all tiles of a mesh, which have one weight per basis map together."""

    tile: TileWork
    size: tuple[int, int]
    """Width, height."""
    texels: slice
    ruler: Ruler | None
    """None where there is no rigidity to measure strain of."""

    def image(self, deltas: np.ndarray) -> np.ndarray:
        """(height, width, 2) of (texels, 2) of all tiles."""
        width, height = self.size
        return deltas[self.texels].reshape(height, width, 2)


def read_delta(path: str, form: str) -> np.ndarray:
    """(height, width, 2) f32: what a redirection map adds to a texel's own UV. `form`: tile, udim or delta. Raises
    SceneError."""
    texels = texels_of(path)[1][..., :2].astype(np.float64)
    if form != "delta":
        height, width = texels.shape[:2]
        texels[..., 0] -= (np.arange(width) + 0.5) / width
        texels[..., 1] -= 1 - (np.arange(height)[:, None] + 0.5) / height
    if form == "udim":
        # No delta is as long as half of a tile, and all of a map are of one tile.
        texels -= np.round(np.median(texels, axis=(0, 1)))
    # The rounding of a UV of 1 is none of the map's doing.
    texels[np.abs(texels) < 2.0**-23] = 0
    return texels.astype(np.float32)


def tile_maps(mesh: MeshWork, sizes: list[tuple[int, int]]) -> list[TileMaps]:
    """The tiles of a mesh, with these sizes of maps."""
    layers, found, start = mesh.face_layers(), [], 0
    for tile, (width, height) in zip(mesh.tiles, sizes):
        texels = slice(start, start + width * height)
        start = texels.stop
        found.append(TileMaps(tile, (width, height), texels, _ruler(mesh, tile, (width, height), layers)))
    return found


def fold_counts(tiles: list[TileMaps], deltas: np.ndarray) -> list[int]:
    """The quads that fold in each tile, for the deltas (texels, 2) of all tiles."""
    return [folds(tile.image(deltas))[0] for tile in tiles]


def folds_of(tiles: list[TileMaps], deltas: np.ndarray) -> int:
    return sum(fold_counts(tiles, deltas))


def strain(tiles: list[TileMaps], shape: Shape, pose: np.ndarray, deltas: np.ndarray) -> Strain | None:
    """The strain of all rigid features together, with maps of these deltas."""
    rulers = [tile for tile in tiles if tile.ruler is not None]
    if not rulers:
        return None
    found = [tile.ruler.strains(tile.image(deltas), shape.rest, pose) for tile in rulers if tile.ruler is not None]
    return Strain.of(np.concatenate([values for values, _ in found]), sum(lost for _, lost in found))


def _ruler(mesh: MeshWork, tile: TileWork, size: tuple[int, int], layers: np.ndarray) -> Ruler | None:
    shape, part = mesh.shape, tile.part
    own = shape.textured & (layers == tile.layer)
    if part.faces is not None:
        own &= np.isin(np.arange(len(own)), part.faces)
    corners = fans(shape.face_counts)[np.repeat(own, np.maximum(shape.face_counts - 2, 0))]
    uvs = shape.uvs[shape.uv_indices[corners]].astype(np.float64)
    place = np.array([(tile.udim - 1001) % 10, (tile.udim - 1001) // 10])
    inside = (np.floor(uvs.mean(axis=1)) == place).all(axis=1)
    corners, uvs = corners[inside], uvs[inside] - place
    rigidity = _rigidity(mesh, tile, size)
    if rigidity is None or not len(corners):
        return None
    # A UV that several vertices share belongs to several charts.
    pairs = np.stack([shape.indices[corners], shape.uv_indices[corners]], -1).reshape(-1, 2)
    numbers = np.unique(pairs, axis=0, return_inverse=True)[1].reshape(-1, 3)
    return Ruler(uvs, numbers, shape.indices[corners], rigidity)


def _rigidity(mesh: MeshWork, tile: TileWork, size: tuple[int, int]) -> np.ndarray | None:
    """(height, width): the tile's rigidity map at the centres of other texels; None without one."""
    path = tile.part.maps["rigidity"].get(tile.udim)
    if path is None:
        return None
    painted = read_map(path)
    rows, columns = (
        ((np.arange(n) + 0.5) / n * painted.shape[axis]).astype(int) for axis, n in ((0, size[1]), (1, size[0]))
    )
    return painted[np.ix_(rows, columns)].astype(np.float64) / white(painted.dtype)


@dataclass
class Measure:
    """The basis maps of a mesh, as stored."""

    work: Work
    shape: Shape
    tiles: list[TileMaps]
    maps: np.ndarray
    stop: Callable[[], None]

    def row(self, weights: np.ndarray, delta: np.ndarray, frame: Frame) -> dict:
        """Measures of a frame. Errors are in texels of the texture."""
        self.stop()
        total = summed(self.maps, weights[None])[0]
        off = np.linalg.norm(total - delta, axis=1)[delta.any(axis=1) | total.any(axis=1)]
        off = off * self.work.settings.texture_size if len(off) else np.zeros(1)
        pose = self.work.scene.positions(self.shape, frame)
        strains = {
            name: strain(self.tiles, self.shape, pose, maps)
            for name, maps in (("own_uvs", np.zeros_like(delta)), ("map", delta), ("basis", total))
        }
        return {
            "frame": frame,
            "weights": [float(weight) for weight in weights],
            "error": float(off.max()),
            "error_p99": float(np.quantile(off, 0.99)),
            "error_mean": float(off.mean()),
            "folds": {"map": folds_of(self.tiles, delta), "basis": folds_of(self.tiles, total)},
            "strain": {name: None if found is None else dataclasses.asdict(found) for name, found in strains.items()},
        }

    def random(self, driver: Driver, known: np.ndarray, most: int) -> dict:
        """Folds of the sum where controls are anywhere between the least and the largest of the poses, `known`: poses
        with more than `most` places, the count of the poses' own maps."""
        low, high = np.minimum(known.min(axis=0), 0), np.maximum(known.max(axis=0), 0)
        # The same in each bake.
        tried = np.random.default_rng(1).uniform(low, high, (_RANDOM, len(low)))
        worst, count, folding = None, 0, 0
        for values, weights in zip(tried, driver(tried)):
            self.stop()
            found = folds_of(self.tiles, summed(self.maps, weights[None].astype(np.float32))[0])
            folding += found > most
            if found > count:
                worst, count = dict(zip(driver.names, map(float, values.round(4)))), found
        return {"poses": _RANDOM, "folding": folding, "folds": count, "folds_of_maps": most, "worst": worst}
