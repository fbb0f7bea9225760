"""An object's asset, and its inputs. None of this touches Blender's data: it takes arrays, on any thread."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

import numpy as np

from . import on_seams, session, strain
from .carriers import CarriedInput, Carriers
from .geometry import Topology
from .layers import number_of
from .maps import ORIGIN, Map, nearest
from .on_seams import Doubles

if TYPE_CHECKING:
    import vrtm


# Cells per side for the choice between two ways: a finer grid hardly ever changes it.
MEASURED = 512


# Codes of warnings that the library gives once, when it makes something, and the inputs with which they end. All others
# are of a pose.
LASTING = {
    "faces_clipped": ("mesh",),
    "faces_outside": ("mesh",),
    "triangles_degenerate": ("mesh",),
    "edges_apart": ("mesh",),
    "seams_unused": ("mesh",),
    "rest_is_point": ("mesh",),
    "rigidity_range": ("mesh", "rigidity"),
    "mask_range": ("mesh", "mask"),
    "grid_too_coarse": ("mesh", "settings"),
    "nodes_at_gaps": ("mesh", "settings"),
    "nothing_moves": ("mesh", "rigidity", "mask", "settings"),
}


@dataclass(frozen=True)
class MeshInput:
    """The mesh at rest as it was read, and the device to prepare it for."""

    topology: Topology
    rest: np.ndarray  # (vertices, 3) float32
    device: str
    max_layers: int
    weld: str  # "auto", "weld" or "cut"
    stamp: Any


@dataclass(frozen=True)
class MapsInput:
    """The maps as they were read, and the tiles' settings."""

    rigidity: Map
    mask: Map
    settings: dict[str, Any]
    stamps: dict[str, Any]  # "rigidity", "mask" and "settings"


@dataclass
class Inputs:
    """The inputs that were read of an object and are not in its asset yet; None for unchanged ones."""

    mesh: MeshInput | None = None
    maps: MapsInput | None = None
    carried: CarriedInput | None = None

    def take(self) -> Inputs:
        """The inputs; nothing is left here."""
        taken = Inputs(self.mesh, self.maps, self.carried)
        self.mesh = self.maps = self.carried = None
        return taken

    def give_back(self, older: Inputs) -> None:
        """Puts back unused inputs, unless they were read again meanwhile."""
        self.mesh, self.maps = self.mesh or older.mesh, self.maps or older.maps
        self.carried = self.carried or older.carried


@dataclass
class Prepared:
    """While a job is under way this is the job's."""

    asset: vrtm.Asset | None = None
    stamps: dict[str, Any] = field(default_factory=dict)
    # The rigidity images that were set, by UDIM number.
    painted: dict[int, np.ndarray] = field(default_factory=dict)
    mesh: MeshInput | None = None
    doubles: Doubles | None = None
    welded: bool = False  # by their places
    # The rigidity by vertices, if it is.
    vertices: np.ndarray | None = None
    # Kept results of rigid_share, whole_share and features_on_seams, until maps or settings change.
    kept: dict[str, Any] = field(default_factory=dict)
    # Lasting warnings of the library, and the stamps of the inputs with which they end.
    told: dict[vrtm.LogEntry, dict[str, Any]] = field(default_factory=dict)
    # The layer of each face, (faces,) uint32; None where there is one layer alone.
    layers: np.ndarray | None = None
    carriers: Carriers | None = None

    def apply(self, inputs: Inputs) -> None:
        """Makes or mends the asset, as far as its inputs have changed. Raises vrtm.Error or a Problem."""
        mesh = inputs.mesh
        if mesh is not None and (self.asset is None or self.stamps.get("mesh") != mesh.stamp):
            self.close()
            topology = mesh.topology
            doubles = on_seams.doubles(topology, mesh.rest)
            welded = mesh.weld == "weld" or (mesh.weld == "auto" and doubles.are_of_seams)
            self.asset = session.library().Asset(
                session.device(mesh.device),
                mesh.rest,
                topology.corner_vertices,
                face_counts=topology.face_counts,
                uvs=topology.uvs,
                max_layers=mesh.max_layers,
                weld="position" if welded else "index",
            )
            self.mesh, self.doubles, self.welded = mesh, doubles, welded
            self.layers = self.asset.face_layers() if number_of(self.asset) > 1 else None
            self.stamps["mesh"] = mesh.stamp
        if inputs.maps is not None:
            self._apply_maps(inputs.maps)
        carried = inputs.carried
        if carried is not None and self.stamps.get("carried") != carried.stamp:
            self._end_carriers()
            self.carriers = Carriers(self.asset, carried, self.mesh.topology, self.mesh.rest)
            self.stamps["carried"] = carried.stamp

    def _apply_maps(self, maps: MapsInput) -> None:
        setters = {"rigidity": self._set_rigidity, "mask": self._set_mask, "settings": self._set_settings}
        for which, setter in setters.items():
            if self.stamps.get(which) == maps.stamps[which]:
                continue
            # The stamp must not stay if the setter fails.
            self.stamps.pop(which, None)
            self.kept.clear()
            setter(getattr(maps, which))
            self.stamps[which] = maps.stamps[which]

    def _tiles(self) -> list[vrtm.Tile]:
        """One tile for each UDIM number: its settings hold for all of its layers."""
        return [tile for tile in self.asset.tiles if tile.layer == 0]

    def _set_settings(self, settings: dict[str, Any]) -> None:
        for tile in self._tiles():
            tile.set_settings(**settings)

    def measured(self, seams: str, positions: np.ndarray, options: dict[str, object]) -> list[vrtm.TileReport]:
        """The reports of a pose with these seams, on at most 512 cells per side. The settings are to be set again."""
        self.stamps.pop("settings", None)
        for tile in self._tiles():
            width, height = (min(cells, MEASURED) for cells in tile.grid)
            ways = {"seams": seams, "open_borders": "fixed"}
            tile.set_settings(tile.settings, grid_width=width, grid_height=height, **ways)
        self.asset.solve(positions, **options)
        return [tile.report() for tile in self.asset.tiles]

    def _set_mask(self, new: Map) -> None:
        self.asset.set_vertex_mask(new.vertices)
        for tile in self._tiles():
            tile.set_mask(new.of(tile.udim), origin=ORIGIN)

    def _set_rigidity(self, new: Map) -> None:
        # Kept again at the end: after a failure all of it is set again.
        before, self.painted = self.painted, {}
        self.vertices = new.vertices
        self.asset.set_vertex_rigidity(new.vertices)
        for tile in self._tiles():
            image, old = new.of(tile.udim), before.get(tile.udim)
            if image is None or old is None or image.shape != old.shape:
                tile.set_rigidity(image, origin=ORIGIN)
                continue
            # A stroke of a brush: only what has changed is prepared again.
            changed = image != old
            rows, columns = np.flatnonzero(changed.any(1)), np.flatnonzero(changed.any(0))
            if len(rows):
                x, y, width, height = columns[0], rows[0], np.ptp(columns) + 1, np.ptp(rows) + 1
                tile.update_rigidity(image, int(x), int(y), int(width), int(height), origin=ORIGIN)
        self.painted = {tile.udim: image for tile in self._tiles() if (image := new.of(tile.udim)) is not None}

    def notes(self, said: list[vrtm.LogEntry]) -> list[str]:
        """The library's warnings of a solve, and its earlier ones of the same inputs."""
        # outcome.py tells of overlaps, and of doubled vertices.
        known = not self.welded and (self.mesh.weld == "cut" or self.doubles.edges)
        left_out = ("overlap", "welds_torn", *["edges_apart"] * bool(known))
        said = [entry for entry in said if entry.code not in left_out]
        for entry in said:
            if entry.code in LASTING:
                self.told[entry] = {which: self.stamps.get(which) for which in LASTING[entry.code]}
        self.told = {entry: of for entry, of in self.told.items() if of.items() <= self.stamps.items()}
        return list(dict.fromkeys(map(_in_artists_words, [*self.told, *said])))

    def rigid_share(self) -> tuple[float, float, float]:
        """The share of the textured surface, by its area in the UV map, whose rigidity is over 0.5; of values by
        vertex, of the face corners. And the least and the largest rigidity there. The asset must have been solved."""
        if "rigid" not in self.kept:
            if self.vertices is not None:
                values = self.vertices[self.mesh.topology.corner_vertices]
            else:
                values = np.concatenate([self._texels(tile) for tile in self.asset.tiles] or [np.zeros(1, np.float32)])
            self.kept["rigid"] = float((values > 0.5).mean()), float(values.min()), float(values.max())
        return self.kept["rigid"]

    @property
    def corner_vertices(self) -> np.ndarray:
        """The vertex of each corner, (corners,), as the solve connects faces: the first one at its place, if doubled
        vertices are welded."""
        return self.doubles.corner_vertices if self.welded else self.mesh.topology.corner_vertices

    def rigidity_of_vertices(self, uvs: np.ndarray) -> np.ndarray:
        """The rigidity at each vertex with UVs of the face corners, (vertices,): a mean over its corners."""
        of = self.mesh.topology
        found = self._rigidity(uvs, np.arange(len(uvs))[:, None], np.ones((len(uvs), 1)))
        total, number = (np.bincount(of.corner_vertices, values, of.vertices) for values in (found, None))
        return total / np.maximum(number, 1)

    def triangle_layers(self) -> np.ndarray:
        """The layer of each triangle that the package makes of the faces, (triangles,)."""
        fans = np.maximum(self.mesh.topology.face_counts.astype(np.int64) - 2, 0)
        return np.repeat(np.zeros(len(fans), np.uint32) if self.layers is None else self.layers, fans)

    def whole_share(self) -> float:
        """The share of rigid texels in triangles that are rigid as a whole."""
        if "whole" not in self.kept:
            self.kept["whole"] = strain.whole_share(self.mesh.topology, self._rigidity)
        return self.kept["whole"]

    def rigid_faces(self) -> np.ndarray:
        """True for faces with something rigid, (faces,)."""
        if "faces" not in self.kept:
            counts = self.mesh.topology.face_counts.astype(np.int64)
            faces = np.repeat(np.arange(len(counts)), np.maximum(counts - 2, 0))
            rigid = strain.rigid_samples(self.mesh.topology.triangles, self.mesh.topology.uvs, self._rigidity).any(1)
            self.kept["faces"] = np.bincount(faces, rigid, len(counts)) > 0
        return self.kept["faces"]

    def features_on_seams(self) -> int:
        """The number of features of a painted image on seams that do not continue."""
        if not self.painted or self.asset.tiles[0].settings.seams == "continue":
            return 0
        if "on_seams" not in self.kept:
            self.kept["on_seams"] = on_seams.features(self.mesh.topology, self.corner_vertices, self.painted_at)
        return self.kept["on_seams"]

    def strain_of(self, pose: np.ndarray, uvs: np.ndarray) -> float:
        """The strain (RMS) of rigid parts if the texture is looked up at UVs of the face corners, (corners, 2)."""
        return strain.of_features(self.mesh.topology, self.mesh.rest, pose, uvs, self._rigidity)

    def _rigidity(self, uvs: np.ndarray, corners: np.ndarray, weights: np.ndarray) -> np.ndarray:
        if self.vertices is not None:
            return (self.vertices[self.mesh.topology.corner_vertices[corners]] * weights).sum(-1)
        return self.painted_at(uvs)

    def painted_at(self, uvs: np.ndarray) -> np.ndarray:
        """The rigidity that is painted at UVs, (n,)."""
        tiles, found = np.floor(uvs).astype(int), np.zeros(len(uvs), np.float32)
        for udim, image in self.painted.items():
            chosen = np.flatnonzero((tiles == ((udim - 1001) % 10, (udim - 1001) // 10)).all(-1))
            x, y = ((uvs[chosen] - tiles[chosen]) * image.shape[::-1]).astype(int).T
            found[chosen] = image[y.clip(0, image.shape[0] - 1), x.clip(0, image.shape[1] - 1)]
        return found

    def _texels(self, tile: vrtm.Tile) -> np.ndarray:
        """The rigidity of about a million points at most, on a lattice, that lie in charts of a tile."""
        image = self.painted.get(tile.udim, np.zeros((1, 1), np.float32))
        charts = tile.fetch("redirection_delta", 512, channels=4, origin=ORIGIN)[..., 3] > 0.5
        size = tuple(min(max(n, 512), 1024) for n in image.shape)
        found = nearest(image, size)[nearest(charts, size)]
        return found if len(found) else np.zeros(1, np.float32)

    def _end_carriers(self) -> None:
        self.stamps.pop("carried", None)
        carriers, self.carriers = self.carriers, None
        if carriers is not None:
            carriers.close()

    def close(self) -> None:
        self._end_carriers()
        asset, self.asset = self.asset, None
        self.stamps.clear()
        self.told.clear()
        self.painted.clear()
        self.kept.clear()
        self.mesh = self.doubles = self.vertices = self.layers = None
        if asset is not None:
            asset.close()


# Warnings of the library in an artist's words, with what mends them: the values of an entry fill them in.
WORDS = {
    "nodes_at_gaps": "{where}: {0:.0f} points do not move, where UV edges nearly touch. Where they belong together, "
    "merge them in the UV editor (UV > Merge > By Distance)",
    "edges_apart": "Features end at {0:.0f} edges whose sides nearly touch in the UV map: merge them in the UV editor "
    "(UV > Merge > By Distance)",
    "grid_too_coarse": "Features are too small for a grid of {0:.0f} cells, and take {2:.0f}: press Final",
    "faces_clipped": "{0:.0f} faces reach out of their tile, where they stay as they are: move them in the UV editor",
    "faces_outside": "{0:.0f} faces lie in no UV tile, where they stay as they are: move them in the UV editor",
    "triangles_degenerate": "{0:.0f} triangles have no area in the UV map, and stay as they are: unwrap them",
    "nothing_moves": "{where}: what is rigid cannot move, since Mask, Seams, Overlaps or a coarse Grid hold all of it",
    "pose_scale": "Edges are {0:.3g} times as long as at rest: choose another Rest, or press Capture Rest",
    "pose_order": "{0:.0%} of edges are over 3 times as long as at rest: choose another Rest, or press Capture Rest",
}


def _in_artists_words(entry: vrtm.LogEntry) -> str:
    if entry.code not in WORDS:
        return entry.message
    where = f"Tile {entry.udim}" + (f", layer {entry.layer}" if entry.layer else "")
    return WORDS[entry.code].format(*entry.values, where=where)
