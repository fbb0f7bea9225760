"""The parts of a mesh that are baked by themselves: all of it, or the faces of one of its subsets; each with its asset,
maps and tiles."""

from __future__ import annotations

import dataclasses
from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

import vrtm
from vrtm.bake import warped
from vrtm.bake.failure import describe, one_line
from vrtm.bake.fingerprint import Fingerprint
from vrtm.bake.frames import Frame
from vrtm.bake.left_out import LeftOut
from vrtm.bake.scene import SceneError, Shape
from vrtm.bake.scene.images import find_maps, read_map, white
from vrtm.bake.settings import AUTO, Settings

LARGEST_GRID = 16384
SIZE_WITHOUT_MAP = 512
SIZE_OF_PRIMVAR = 1024
LEAST_MAP = 16
"""Texels per side; a rigidity map of fewer is no measure for a redirection."""
_DIM, _BEYOND = 0.1, 2.0
"""The largest value of a map that makes next to nothing white, and one beyond white that no filter leaves."""
_FINEST = 512
"""Texels per side of what is looked up of a rigidity map."""
REST = "rest"
"""The name of the part that has the faces in no subset."""


@dataclass(frozen=True, eq=False)
class Given:
    """A mesh that is to be baked, with all that it is baked from."""

    settings: Settings
    shape: Shape
    device: vrtm.Device
    copies: Sequence[warped.Copy]


@dataclass(eq=False)
class TileWork:
    """A tile with its maps."""

    part: Part
    tile: vrtm.Tile
    udim: int
    layer: int
    """Number of the layer of charts in the UDIM tile; 0 if there is one."""
    cells: tuple[int, int]
    size: tuple[int, int]
    """Of the redirection, in texels; (0, 0) if it follows from what the map holds."""
    inputs: Fingerprint
    """Of all that the tile's files depend on, poses excepted."""


class Part:
    """A mesh, or a subset of its faces, with an asset of its own. Raises SceneError and vrtm.Error."""

    def __init__(self, given: Given, subset: tuple[str, np.ndarray] | None, common: Fingerprint) -> None:
        """`subset`: a name and the faces; None: all of them. `common`: a hash of the inputs of all tiles of the
        mesh."""
        settings, shape = self.settings, self.shape = given.settings, given.shape
        self.subset, self.faces = subset or ("", None)
        self.where = f"{shape.path} subset {self.subset}" if subset else shape.path
        """The part, as messages name it."""
        self.asset = shape.asset(given.device, settings.weld, settings.layers, self.faces)
        self.all_tiles = [tile for tile in self.asset.tiles if tile.uv_set == 0]
        """The tiles that are solved, of which `tiles` are to be baked."""
        common = common.copy()
        if self.faces is not None:
            common.text("subset").array(self.faces)
        if any(tile.layer for tile in self.all_tiles):
            common.array(self.asset.face_layers())
        if shape.vertex_rigidity is not None:
            self.asset.set_vertex_rigidity(shape.vertex_rigidity)
        if shape.vertex_mask is not None:
            self.asset.set_vertex_mask(shape.vertex_mask)
        self.all_udims = tuple(dict.fromkeys(tile.udim for tile in self.all_tiles))
        self.maps = {option: self._found(getattr(settings, option)) for option in ("rigidity", "mask")}
        """The files of the maps by UDIM number."""
        self.rigid_sums: dict[int, np.ndarray] = {}
        """Of the rigidity maps by UDIM number, for `gain`."""
        self.notes: list[str] = []
        """Sentences about odd maps and primvars."""
        self._look_at_primvars()
        self.tiles = self._tiles(common)
        self.textures = [(copy, self._found(copy.pattern)) for copy in given.copies]

    def _found(self, pattern: str | None) -> dict[int, str]:
        if pattern is None or not self.all_udims:
            return {}
        return find_maps(pattern, self.shape.name, self.all_udims, self.subset, required=self.faces is None)

    def _look_at_primvars(self) -> None:
        shape = self.shape
        textured = shape.uv_indices >= 0
        if self.faces is not None:
            textured &= np.repeat(np.isin(np.arange(len(shape.face_counts)), self.faces), shape.face_counts)
        for option in ("rigidity", "mask"):
            values = getattr(shape, f"vertex_{option}")
            if values is not None and textured.any():
                name = getattr(self.settings.options, f"{option}_primvar")
                self._look_at(option, f"--{option}-primvar {name}", values[shape.indices[textured]])

    def _look_at(self, option: str, name: str, values: np.ndarray) -> None:
        """Notes values that are hardly meant as they count."""
        largest = float(values.max(initial=0))
        whole = white(values.dtype)
        of = f" of {whole:g}" if whole != 1 else ""
        then = "keeps its shape there" if option == "rigidity" else "moves there"
        if largest <= 0 and option == "rigidity":
            self.notes.append(f"{name} is black all over: nothing {then}")
        elif 0 < largest < _DIM * whole:
            least = f"no value above {largest:.4g}{of}"
            self.notes.append(f"{name} has {least}: next to nothing {then}, white is {whole:g}")
        elif largest >= _BEYOND * whole:
            self.notes.append(f"{name} has values up to {largest:.4g}: those above 1 count as 1, which is white")

    def _tiles(self, common: Fingerprint) -> list[TileWork]:
        settings = self.settings
        rigid, masks = ({udim: read_map(path) for udim, path in found.items()} for found in self.maps.values())
        if settings.seams == "continue":
            # The surface beyond a tile's seams may be in any other tile.
            for maps in (rigid, masks):
                for udim, pixels in sorted(maps.items()):
                    common = common.copy().text(udim).array(pixels)
        # A tile without a map is the identity, and gets the size of the others.
        alone = SIZE_OF_PRIMVAR if self.shape.vertex_rigidity is not None else SIZE_WITHOUT_MAP
        sizes = ((m.shape[1], m.shape[0]) for m in rigid.values())
        other = max((size for size in sizes if min(size) >= LEAST_MAP), default=(alone, alone))
        tiles = []
        for tile in self.all_tiles:
            rigidity, mask = rigid.get(tile.udim), masks.get(tile.udim)
            # A few texels say how rigid a tile is, and not how finely it moves.
            small = rigidity is None or min(rigidity.shape) < LEAST_MAP
            size = other if small else (rigidity.shape[1], rigidity.shape[0])
            if settings.size is not None:
                size = (settings.size,) * 2
            # 0 leaves the size to the features.
            grid = min(settings.size or 0, LARGEST_GRID)
            # Settings of one layer hold for all layers of its tile.
            if tile.layer == 0:
                if rigidity is not None:
                    tile.set_rigidity(rigidity)
                    self.rigid_sums[tile.udim] = _rigid_sums(rigidity)
                    self._look_at("rigidity", f"--rigidity {self.maps['rigidity'][tile.udim]}", rigidity)
                if mask is not None:
                    tile.set_mask(mask)
                    self._look_at("mask", f"--mask {self.maps['mask'][tile.udim]}", mask)
                tile.set_settings(tile.settings, grid_width=grid, grid_height=grid, **settings.tile_settings)
            if settings.map_size is not None:
                size = (0, 0) if settings.map_size == AUTO else (int(settings.map_size),) * 2
            inputs = common.copy().text(tile.udim, dataclasses.astuple(tile.settings)).array(rigidity).array(mask)
            if tile.layer:
                inputs.text("layer", tile.layer)
            if settings.tiles is None or tile.udim in settings.tiles:
                tiles.append(TileWork(self, tile, tile.udim, tile.layer, tile.grid, size, inputs))
        return tiles

    def solve(
        self,
        frame: Frame,
        positions: np.ndarray,
        tiles: Sequence[TileWork],
        measure: bool,
        release: bool,
        warm: bool,
        stop: Callable[[], None],
    ) -> None:
        """Solves a pose. `stop` is called often, and raises to cancel. Raises SceneError, Failure."""
        settings = self.settings

        def progress(_fraction: float) -> None:
            stop()

        try:
            self.asset.solve(
                positions,
                quality=settings.quality,
                scale=settings.scale,
                warm=warm,
                temporal_weight=settings.temporal_weight if warm else 0.0,
                release_solvers=release,
                measure=measure,
                # At seams, tiles are brought together with those that are solved with them.
                tiles=self.all_tiles if settings.seams == "continue" else [tile.tile for tile in tiles],
                progress=progress,
            )
        except vrtm.InvalidArgumentError as error:
            raise SceneError(f"its pose cannot be taken: {one_line(error)}") from error
        except vrtm.Error as error:
            raise describe(error, f"{self.where}, frame {frame}") from error

    @property
    def udims(self) -> list[int]:
        return list(dict.fromkeys(tile.udim for tile in self.tiles))

    def without(self, option: str) -> list[int]:
        """The tiles to be baked that have no map, or no values per vertex, for `rigidity` or `mask`, if that was asked
        for."""
        if getattr(self.settings, option) is not None:
            return [udim for udim in self.udims if udim not in self.maps[option]]
        wanted = getattr(self.settings.options, f"{option}_primvar") is not None
        return self.udims if wanted and getattr(self.shape, f"vertex_{option}") is None else []


def parts(given: Given, common: Fingerprint, left_out: list[LeftOut]) -> list[Part]:
    """The parts of a mesh that are baked each by itself: with --subsets its subsets, and the faces in none of them;
    those without UVs are left out."""
    settings, shape = given.settings, given.shape
    if not settings.subsets:
        return [Part(given, None, common)]
    rest = np.ones(len(shape.face_counts), bool)
    chosen = []
    for name, faces in shape.subsets.items():
        chosen.append((name, faces[rest[faces]]))
        rest[faces] = False
    name = REST
    while name in shape.subsets:
        name += "_"
    chosen.append((name, np.flatnonzero(rest)))
    with_uvs = shape.textured
    left_out += [
        LeftOut("has no UVs", f"{shape.path} subset {n}") for n, f in chosen if len(f) and not with_uvs[f].any()
    ]
    found = [Part(given, (n, f), common) for n, f in chosen if with_uvs[f].any()]
    # One of them may lack a file, but not all.
    wanted = [(getattr(settings, option), [part.maps[option] for part in found]) for option in ("rigidity", "mask")]
    wanted += [(copy.pattern, [part.textures[number][1] for part in found]) for number, copy in enumerate(given.copies)]
    for pattern, maps in wanted:
        if pattern is not None and not any(maps):
            find_maps(pattern, shape.name, sorted({udim for part in found for udim in part.all_udims}))
    return found


def _rigid_sums(rigidity: np.ndarray) -> np.ndarray:
    """(height + 1, width + 1): how many blocks of texels that are not black lie below and to the left of each corner of
    a map's blocks, from v = 0 on. `rigidity`: (height, width), the first row at the top."""
    rigid = rigidity.reshape(rigidity.shape[0], rigidity.shape[1], -1).max(axis=2) > 0
    for axis in (0, 1):
        size = rigid.shape[axis]
        # Blocks of one size, the last of which may be cut: a face's share of them is taken for a share of the map.
        if size > _FINEST:
            cuts = np.arange(_FINEST) * size // _FINEST
            rigid = np.maximum.reduceat(rigid, cuts, axis=axis)
    sums = np.zeros((rigid.shape[0] + 1, rigid.shape[1] + 1), np.int32)
    sums[1:, 1:] = rigid[::-1].cumsum(axis=0, dtype=np.int32).cumsum(axis=1, dtype=np.int32)
    return sums
