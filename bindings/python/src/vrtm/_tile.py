"""Tiles: one UDIM unit square of an asset."""

from __future__ import annotations

import ctypes
import dataclasses
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike, DTypeLike, NDArray

from . import _abi
from ._arrays import Pinned, Pixels
from ._images import PIXELS, Target, image, image_size, pixel_type
from ._library import Handle, check, library, new
from ._names import fill, known, natural, record, told, value_of
from ._records import (
    FetchKind,
    MapInfo,
    Origin,
    TileEstimate,
    TileInfo,
    TileReport,
    TileSettings,
    TileSettingsFields,
    WorstFeature,
)

if TYPE_CHECKING:
    from typing_extensions import Unpack

    from ._asset import Asset


class Tile(Handle):
    """A tile of an asset: its maps, settings and results. Asset.tiles and Asset.tile hand them out."""

    asset: Asset
    """The asset that the tile belongs to."""
    udim: int
    """UDIM number, 1001 + U + 10 V."""
    uv_set: int
    """The UV set that the tile belongs to."""
    layer: int
    """Layer of its UDIM number: 0 unless the asset was made with max_layers. Layers share their maps and settings: what
    is set for one of them holds for all."""
    layers: int
    """Number of layers of its UDIM number."""

    def __init__(self, asset: Asset, index: int) -> None:
        self._handle, key = _abi.vrtm_tile(), _abi.vrtm_tile_key()
        check(library.vrtm_asset_get_tile(asset._handle, index, ctypes.byref(self._handle)))
        check(library.vrtm_tile_get_key(self._handle, ctypes.byref(key)))
        vars(self).update(asset=asset, udim=key.udim, uv_set=key.uv_set, layer=key.layer, layers=key.layers)

    @property
    def info(self) -> TileInfo:
        """Facts that need no solve. The first call, and the first after a change of maps or settings, prepares the
        tile's grid, which takes time."""
        return told(TileInfo, library.vrtm_tile_get_info, self._handle)

    def set_rigidity(self, rigidity: ArrayLike | None, *, channel: int = 0, origin: Origin = "top") -> None:
        """Sets the rigidity map: an image (height, width) or (height, width, channels) of uint8, uint16, float16 or
        float32, 0 (elastic) to 1 (rigid; for integers their largest value), of any size. `origin`: "top" if the first
        row is at v = 1, as in image files, or "bottom". None removes it: the tile then has the rigidity of the
        vertices, if there is any."""
        self._set(library.vrtm_tile_set_rigidity, "rigidity", rigidity, channel, origin)

    def update_rigidity(
        self, rigidity: ArrayLike, x: int, y: int, width: int, height: int, *, channel: int = 0, origin: Origin = "top"
    ) -> None:
        """Updates a part of the rigidity map, after a brush stroke: `width` x `height` texels from column `x`
        and row `y` of the array. `rigidity` is the whole map, with the size and format of the one that was set."""
        pinned = Pinned()
        part = (natural(name, value, 32) for name, value in zip(("x", "y", "width", "height"), (x, y, width, height)))
        struct = image(pinned, "rigidity", rigidity, channel, origin)
        check(library.vrtm_tile_update_rigidity(self._handle, ctypes.byref(struct), *part))

    def set_mask(self, mask: ArrayLike | None, *, channel: int = 0, origin: Origin = "top") -> None:
        """Sets the warp mask: points under a texel below 0.5 do not move. None: all may move."""
        self._set(library.vrtm_tile_set_mask, "mask", mask, channel, origin)

    def _set(self, function: Any, name: str, value: ArrayLike | None, channel: int, origin: Origin) -> None:
        pinned = Pinned()
        struct = None if value is None else ctypes.byref(image(pinned, name, value, channel, origin))
        check(function(self._handle, struct))

    @property
    def settings(self) -> TileSettings:
        """A copy of the settings, with the defaults filled in; set_settings changes them."""
        return told(TileSettings, library.vrtm_tile_get_settings, self._handle)

    def set_settings(self, settings: TileSettings | None = None, **fields: Unpack[TileSettingsFields]) -> None:
        """Sets all settings: those given, with `fields` changed; without either, the defaults. To change one and keep
        the others: tile.set_settings(tile.settings, smoothness=0.05)."""
        known("setting of a tile", fields, TileSettings.__annotations__)
        settings = dataclasses.replace(settings or TileSettings(), **fields)
        for name in ("grid_width", "grid_height"):
            natural(name, getattr(settings, name), 32)
        struct = new(_abi.vrtm_tile_settings)
        fill(struct, settings)
        check(library.vrtm_tile_set_settings(self._handle, ctypes.byref(struct)))

    @property
    def grid(self) -> tuple[int, int]:
        """Cells of the grid in u and v that the tile has with its present rigidity and settings. The tile is not
        prepared."""
        cells = _abi.vrtm_tile_grid()
        check(library.vrtm_tile_get_grid(self._handle, ctypes.byref(cells)))
        return cells.width, cells.height

    def freeze(self, frozen: bool = True) -> None:
        """Freezes or unfreezes the tile: solves skip a frozen tile, so that it keeps its result."""
        check(library.vrtm_tile_freeze(self._handle, int(bool(frozen))))

    def estimate(self) -> TileEstimate:
        """Estimates the memory for preparing and solving the tile, to about a tenth."""
        return told(TileEstimate, library.vrtm_tile_get_estimate, self._handle)

    def save(self) -> bytes:
        """The prepared tile as bytes, for load on another machine or in a later session."""
        size = ctypes.c_size_t()
        check(library.vrtm_tile_save(self._handle, None, 0, ctypes.byref(size)))
        data = ctypes.create_string_buffer(size.value)
        check(library.vrtm_tile_save(self._handle, data, size.value, ctypes.byref(size)))
        return data.raw[: size.value]

    def load(self, data: bytes) -> None:
        """Loads a tile that save wrote; mesh, maps and settings must be the same. Any other data is refused."""
        block = np.frombuffer(data, np.uint8)
        check(library.vrtm_tile_load(self._handle, block.ctypes.data, len(block)))

    def fetch(
        self,
        kind: FetchKind = "redirection",
        size: int | tuple[int, int] | None = None,
        *,
        dtype: DTypeLike = np.float32,
        channels: int = 0,
        origin: Origin = "top",
        uv_set: int = 0,
        out: Pixels | None = None,
    ) -> Pixels:
        """An output of the last solve as an image, (height, width, channels).

        kind        "redirection": the UV at which to sample the texture, within the tile, v up;
                    "redirection_delta": the redirection minus the texel's own UV (vrtm bake --form delta);
                    "redirection_udim": the redirection plus the tile's offset (--form udim);
                    "warp": the redirection's inverse, texels on nodes; "jacobian": du'/du, du'/dv, dv'/du, dv'/dv;
                    "filter_scale": its largest singular value;
                    "uv_set": where the redirection leads to, as a UV of the set `uv_set`; "uv_set_delta": how far that
                    is from the texel's own UV of that set
        size        (width, height) or one number for both; None = that of `out`, or the grid's (a warp's has one node
                    more)
        dtype       float32 or float16
        channels    0 = as many as the kind has; 3 = a third that is 0; 4 = a fourth that is 1 where charts are
        origin      "top": the first row is at v = 1; or "bottom"
        uv_set      for "uv_set" and "uv_set_delta": the UV set of the values
        out         an array to write into, of the right shape, of any strides

        Never waits for a solve. Raises NotSolvedError before the first.
        """
        number = value_of("fetch_kind", kind, "kind")
        size = self._size(kind, None if size is None else image_size(size), out)
        target = Target(Pinned(), kind, size, dtype=dtype, channels=channels, origin=origin, out=out)
        return self._fetch(number, target, uv_set=natural("uv_set", uv_set, 32))

    def _fetch(self, kind: int, target: Target, **fields: int) -> Pixels:
        fetch = new(_abi.vrtm_fetch)
        fetch.kind, fetch.tile = kind, self._handle
        for name, value in fields.items():
            setattr(fetch, name, value)
        fetch.image = ctypes.pointer(target.struct)
        check(library.vrtm_asset_fetch(ctypes.byref(fetch), 1))
        return target.done()

    def fetch_part(
        self,
        kind: FetchKind,
        whole: int | tuple[int, int],
        part: tuple[int, int, int, int],
        *,
        dtype: DTypeLike = np.float32,
        channels: int = 0,
        origin: Origin = "top",
        out: Pixels | None = None,
    ) -> Pixels:
        """A part of an output, for images that are too large to be held in memory: of an image of `whole` texels
        (width, height), those of `part`: (x, y, width, height), rows counted in the order of `origin`."""
        number = value_of("fetch_kind", kind, "kind")
        x, y, width, height = part
        target = Target(
            Pinned(), kind, image_size((width, height)), dtype=dtype, channels=channels, origin=origin, out=out
        )
        whole_width, whole_height = image_size(whole)
        place = {"x": natural("part", x, 32), "y": natural("part", y, 32)}
        return self._fetch(number, target, whole_width=whole_width, whole_height=whole_height, **place)

    def dilation(
        self,
        size: int | tuple[int, int],
        *,
        reach: float = 1 / 16,
        channels: int = 0,
        origin: Origin = "top",
        out: NDArray[np.float32] | None = None,
    ) -> NDArray[np.float32]:
        """Sources of the texels around the tile's charts, (height, width, channels) of float32. A texel beside the
        charts, up to about `reach` (in UV) from a seam, has the UV, among all tiles, of the texel to copy into it: the
        one that lies beyond the seam on the surface. All other texels have their own UV. A fourth channel is 1 in
        charts and where a source was found. Depends on the mesh alone: no solve is needed."""
        target = Target(
            Pinned(), "redirection_udim", image_size(size), dtype=np.float32, channels=channels, origin=origin, out=out
        )
        check(library.vrtm_tile_fetch_dilation(self._handle, reach, ctypes.byref(target.struct)))
        return target.done()

    def fetch_external(
        self,
        kind: FetchKind,
        size: int | tuple[int, int],
        fd: int,
        memory_size: int,
        *,
        memory_type: int = 0,
        offset: int = 0,
        row_stride: int = 0,
        origin: Origin = "top",
        dtype: DTypeLike = np.float32,
    ) -> None:
        """A redirection into memory of a Vulkan device on the same GPU (Device.info, Adapter.uuid), without copying
        through the CPU: rows of two numbers per texel, bit for bit those of fetch, complete when the call returns.

        kind                      "redirection", "redirection_delta" or "redirection_udim"
        size                      (width, height) or one number for both
        fd                        the memory as an opaque file descriptor, which the caller still owns
        memory_size, memory_type  the allocationSize and memoryTypeIndex that it was allocated with
        offset, row_stride        where the first texel lies, and from row to row; multiples of a texel, 0 = packed
        origin                    "top": the first row is at v = 1; or "bottom"
        dtype                     float32, or float16, which is for the delta and takes half of the bytes

        Nothing may use the memory during the call. Raises UnsupportedError on the CPU.
        """
        image = new(_abi.vrtm_external_image)
        image.handle_kind = value_of("external_kind", "opaque_fd")
        image.handle = natural("fd", fd, 31)
        image.memory_size = natural("memory_size", memory_size, 64)
        image.memory_type = natural("memory_type", memory_type, 32)
        image.offset = natural("offset", offset, 64)
        image.row_stride = natural("row_stride", row_stride, 64)
        image.width, image.height = image_size(size)
        image.origin = value_of("origin", origin)
        image.format = PIXELS[pixel_type(dtype)]
        number = value_of("fetch_kind", kind, "kind")
        check(library.vrtm_tile_fetch_external(self._handle, number, ctypes.byref(image)))

    def inspect_map(
        self,
        kind: FetchKind = "redirection",
        size: int | tuple[int, int] | None = None,
        *,
        dtype: DTypeLike = np.float32,
    ) -> MapInfo:
        """Quality of a redirection map of this kind, size and format when a renderer interpolates in it: its folds, its
        distance from the redirection itself (in UV), and the size that suffices."""
        desc = new(_abi.vrtm_map_desc)
        desc.kind = value_of("fetch_kind", kind, "kind")
        desc.format = PIXELS[pixel_type(dtype)]
        desc.width, desc.height = self._size(kind, None if size is None else image_size(size), None)
        return told(MapInfo, library.vrtm_tile_inspect_map, self._handle, ctypes.byref(desc))

    def report(self) -> TileReport:
        """The report of the tile's last solve. Raises NotSolvedError before the first solve."""
        return told(TileReport, library.vrtm_tile_get_report, self._handle)

    def worst_features(self) -> list[WorstFeature]:
        """The painted features that are worse than without vrtm in the last solve, at most 16, those whose error rose
        most first; none if it did not measure. Raises NotSolvedError before the first solve."""
        found, count = (_abi.vrtm_worst_feature * 16)(), ctypes.c_uint32()
        check(library.vrtm_tile_get_worst_features(self._handle, found, len(found), ctypes.byref(count)))
        return [record(WorstFeature, feature) for feature in found[: count.value]]

    def _size(self, kind: FetchKind, size: tuple[int, int] | None, out: Any, *, next: bool = False) -> tuple[int, int]:
        """(width, height) of an output: as asked for, or that of `out`, or one texel per cell of the last result's
        grid; `next`: of the grid that the next solve will have."""
        if size is not None:
            return size
        if isinstance(out, np.ndarray) and out.ndim == 3:
            return out.shape[1], out.shape[0]
        of: TileReport | TileInfo = self.info if next else self.report()
        nodes = 1 if kind == "warp" else 0
        return of.grid_width + nodes, of.grid_height + nodes

    def __repr__(self) -> str:
        return f"<vrtm.Tile {self._name} of UV set {self.uv_set}>"

    @property
    def _name(self) -> str:
        return f"{self.udim} layer {self.layer}" if self.layers > 1 else str(self.udim)
