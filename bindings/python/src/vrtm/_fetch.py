"""The outputs to request from Asset.redirect and Asset.fetch."""

import ctypes
from typing import Any

import numpy as np
from numpy.typing import DTypeLike

from . import _abi
from ._arrays import Pinned, Pixels
from ._carrier import Arrays, CarriedTarget, Carrier
from ._images import Target, image_size
from ._library import new
from ._names import natural, value_of
from ._records import FetchKind, Origin
from ._tile import Tile


class Fetch:
    """One image of a tile, for Asset.redirect and Asset.fetch; the arguments are those of Tile.fetch."""

    def __init__(
        self,
        tile: Tile,
        kind: FetchKind = "redirection",
        size: int | tuple[int, int] | None = None,
        *,
        dtype: DTypeLike = np.float32,
        channels: int = 0,
        origin: Origin = "top",
        uv_set: int = 0,
        out: Pixels | None = None,
    ) -> None:
        if not isinstance(tile, Tile):
            raise TypeError(f"tile: {tile!r} is no vrtm.Tile")
        self.tile, self.kind = tile, kind
        value_of("fetch_kind", kind, "kind")
        self._uv_set = natural("uv_set", uv_set, 32)
        self._size = None if size is None else image_size(size)
        self._more: dict[str, Any] = {"dtype": dtype, "channels": channels, "origin": origin, "out": out}

    def target(self, pinned: Pinned, next: bool) -> Target:
        """The array that the output is written to: of the last solve, or of the next."""
        size = self.tile._size(self.kind, self._size, self._more["out"], next=next)
        return Target(pinned, self.kind, size, **self._more)

    def struct(self, target: Target) -> _abi.vrtm_fetch:
        """The library's struct."""
        struct = new(_abi.vrtm_fetch)
        struct.kind = value_of("fetch_kind", self.kind, "kind")
        struct.tile, struct.uv_set = self.tile._handle, self._uv_set
        struct.image = ctypes.pointer(target.struct)
        return struct


class CarrierFetch:
    """The points of a carrier, for Asset.redirect and Asset.fetch; the arguments are those of Carrier.fetch."""

    def __init__(self, carrier: Carrier, *names: str, dtype: DTypeLike = np.float32, out: Arrays | None = None) -> None:
        if not isinstance(carrier, Carrier):
            raise TypeError(f"carrier: {carrier!r} is no vrtm.Carrier")
        self.carrier, self._names, self._dtype, self._out = carrier, names, dtype, out

    def target(self, _pinned: Pinned, _next: bool) -> CarriedTarget:
        """The arrays that the points are written to."""
        return CarriedTarget(self.carrier, self._names, self._dtype, self._out)

    def struct(self, target: CarriedTarget) -> _abi.vrtm_fetch:
        """The library's struct."""
        struct = new(_abi.vrtm_fetch)
        struct.kind, struct.carrier = value_of("fetch_kind", "carried"), self.carrier._handle
        struct.carried = ctypes.pointer(target.struct)
        return struct
