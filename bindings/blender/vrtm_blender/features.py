"""The painted features of a result that are worse than without vrtm: how many, and where the worst ones are."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import TYPE_CHECKING

import bpy
import numpy as np

from . import geometry, session, strain

if TYPE_CHECKING:
    import vrtm

    from .prepared import Prepared

# Texels per side at which skin is looked at, and the least distance of two places of it, in UV.
TEXELS, APART = 256, 1 / 16


@dataclass(frozen=True)
class Feature:
    """A feature in the triangle of the mesh that shows its centre."""

    of: vrtm.WorstFeature
    vertices: np.ndarray  # (3,) of the triangle
    weights: np.ndarray  # (3,) of the centre
    share: float  # its area by the triangle's, in the UV map


Found = list[tuple["vrtm.WorstFeature", np.ndarray]]


@dataclass(frozen=True)
class Features:
    """Numbers over all tiles and layers, 0 without Measure Strain, and the worst features first."""

    painted: int = 0
    worse: int = 0
    before: int = 0  # strained by more than 0.05
    after: int = 0
    worst: tuple[Feature, ...] = ()
    # Places where the skin beside features is squeezed or stretched most, from over twice on.
    squeezed: tuple[Feature, ...] = ()

    def places(self, skin: bool) -> tuple[Feature, ...]:
        return self.squeezed if skin else self.worst

    @property
    def are_many_worse(self) -> bool:
        """True if more than one in twenty is worse. A few are so at borders and in crowds, where nothing can be mended;
        more have a cause in the settings."""
        return 20 * self.worse > self.painted


def fetch(prepared: Prepared, skin: bool = False) -> Features:
    """The features of the asset's last solve, and what they do to the skin. On any thread."""
    tiles = prepared.asset.tiles
    reports = [tile.report() for tile in tiles]
    names = ("features", "features_worse", "features_strained_before", "features_strained_after")
    worst = [one for tile in tiles for one in _placed(prepared, tile, _worst(tile))]
    worst.sort(key=lambda feature: feature.of.before - feature.of.after)
    squeezed = [one for tile in tiles if skin for one in _placed(prepared, tile, _squeezed(prepared, tile))]
    squeezed.sort(key=lambda place: -abs(np.log(place.of.after)))
    numbers = (sum(getattr(report, name) for report in reports) for name in names)
    return Features(*numbers, tuple(worst), tuple(squeezed))


def _worst(tile: vrtm.Tile) -> Found:
    """The worst features of a tile, and the points of the surface to which the warp takes their centres."""
    if found := tile.worst_features():
        warp = tile.fetch("warp", channels=2, origin="bottom")
        cells, origin = np.array(warp.shape[1::-1]) - 1, _origin(tile)
        nodes = [np.rint(((one.u, one.v) - origin) * cells).astype(int) for one in found]
        return [(one, (one.u, one.v) + warp[y, x] - (x, y) / cells) for one, (x, y) in zip(found, nodes)]
    return []


def _squeezed(prepared: Prepared, tile: vrtm.Tile) -> Found:
    """The places of a tile, apart from one another, where skin is squeezed or stretched most, with what its length is
    multiplied by."""
    if not prepared.painted:
        return []
    delta = tile.fetch("redirection_delta", TEXELS, channels=4, origin="bottom")
    # Differences over two texels: what is narrower is not seen. Charts end where a neighbour is in none.
    derivative = np.stack(np.gradient(delta.astype(np.float64) * TEXELS, axis=(1, 0)), -1)
    largest, smallest = strain.logarithms(derivative[..., :2, :] + np.eye(2))
    length = np.where(largest > -smallest, -largest, -smallest)
    whole = (derivative[..., 3, :] == 0).all(-1) & (delta[..., 3] > 0.5)
    rows, columns = np.nonzero(whole & (np.abs(length) > strain.FULL_SKIN))
    at = (np.stack([columns, rows], -1) + 0.5) / TEXELS + _origin(tile)
    skin = prepared.painted_at(at + delta[rows, columns, :2]) < 0.5
    at, length, found = at[skin], length[rows[skin], columns[skin]], []
    while len(at):
        most = np.abs(length).argmax()
        (u, v), factor = at[most], float(np.exp(length[most]))
        of = session.library().WorstFeature(u=u, v=v, area=APART**2, before=1.0, after=factor, at_border=False)
        found.append((of, at[most]))
        beyond = (np.abs(at - at[most]) > APART).any(-1)
        at, length = at[beyond], length[beyond]
    return found


def _origin(tile: vrtm.Tile) -> np.ndarray:
    return np.array(divmod(tile.udim - 1001, 10)[::-1])


def _placed(prepared: Prepared, tile: vrtm.Tile, found: Found) -> Iterator[Feature]:
    """Features of a tile at points of its charts in the UV map, (2,) each."""
    if found:
        topology = prepared.mesh.topology
        corners = topology.triangles[prepared.triangle_layers() == tile.layer]
        area = strain.areas(topology.uvs[corners])
        corners, area = corners[area > 1e-14], area[area > 1e-14]
        uvs = topology.uvs[corners]
        low, high = uvs.min(1), uvs.max(1)
    for feature, at in found:
        # Of a large mesh few triangles are near.
        near = np.flatnonzero(((low <= at) & (at <= high)).all(-1))
        near = near if len(near) else np.arange(len(uvs))
        triangle, weights = strain.located(uvs[near], at)
        triangle = near[triangle]
        yield Feature(feature, topology.corner_vertices[corners[triangle]], weights, feature.area / area[triangle])


def in_world(
    obj: bpy.types.Object, feature: Feature, depsgraph: bpy.types.Depsgraph
) -> tuple[np.ndarray, np.ndarray, float]:
    """The centre of a feature in the evaluated pose, (3,) in the world; the surface's normal there, of any length; and
    the radius of a disc of the feature's area."""
    matrix = np.array(obj.evaluated_get(depsgraph).matrix_world)
    corners = geometry.pose(obj, depsgraph)[feature.vertices] @ matrix[:3, :3].T + matrix[:3, 3]
    normal = np.cross(*(corners[1:] - corners[0])) * np.sign(np.linalg.det(matrix[:3, :3]))
    return feature.weights @ corners, normal, (feature.share * np.linalg.norm(normal) / 2 / np.pi) ** 0.5
