"""The painted features of a result that are worse than without vrtm: how many, and where the worst ones are."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import TYPE_CHECKING

import bpy
import numpy as np

from . import geometry, strain

if TYPE_CHECKING:
    import vrtm

    from .prepared import Prepared


@dataclass(frozen=True)
class Feature:
    """A feature in the triangle of the mesh that shows its centre."""

    of: vrtm.WorstFeature
    vertices: np.ndarray  # (3,) of the triangle
    weights: np.ndarray  # (3,) of the centre
    share: float  # its area by the triangle's, in the UV map


@dataclass(frozen=True)
class Features:
    """Numbers over all tiles and layers, 0 without Measure Strain, and the worst features first."""

    painted: int = 0
    worse: int = 0
    before: int = 0  # strained by more than 0.05
    after: int = 0
    worst: tuple[Feature, ...] = ()

    @property
    def are_many_worse(self) -> bool:
        """True if more than one in twenty is worse. A few are so at borders and in crowds, where nothing can be mended;
        more have a cause in the settings."""
        return 20 * self.worse > self.painted


def fetch(prepared: Prepared) -> Features:
    """The features of the asset's last solve. On any thread."""
    tiles = prepared.asset.tiles
    reports = [tile.report() for tile in tiles]
    names = ("features", "features_worse", "features_strained_before", "features_strained_after")
    worst = [feature for tile in tiles for feature in _placed(prepared, tile)]
    worst.sort(key=lambda feature: feature.of.before - feature.of.after)
    return Features(*(sum(getattr(report, name) for report in reports) for name in names), tuple(worst))


def _placed(prepared: Prepared, tile: vrtm.Tile) -> Iterator[Feature]:
    """The worst features of a tile, at the points of the surface to which the warp takes their centres."""
    if found := tile.worst_features():
        topology = prepared.mesh.topology
        corners = topology.triangles[prepared.triangle_layers() == tile.layer]
        area = strain.areas(topology.uvs[corners])
        corners, area = corners[area > 1e-14], area[area > 1e-14]
        uvs = topology.uvs[corners]
        low, high = uvs.min(1), uvs.max(1)
        warp = tile.fetch("warp", channels=2, origin="bottom")
        cells, origin = np.array(warp.shape[1::-1]) - 1, np.array(divmod(tile.udim - 1001, 10)[::-1])
    for feature in found:
        centre = np.array((feature.u, feature.v))
        x, y = node = np.rint((centre - origin) * cells).astype(int)
        at = centre + warp[y, x] - node / cells
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
