"""Carriers: points that are bound to the rest surface, and ride on the warped one."""

import ctypes
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import DTypeLike, NDArray

from . import _abi
from ._arrays import FLOATS, Pinned, floats, output
from ._library import Owned, check, library, new
from ._names import natural, told, value_of
from ._records import CarrierInfo


@dataclass(frozen=True)
class Carried:
    """Carried points: arrays with a row for each point, None for those that were not asked for."""

    positions: NDArray[np.floating[Any]] | None = None
    """(points, 3): positions in the pose."""
    rotations: NDArray[np.floating[Any]] | None = None
    """(points, 4): rotations of the frames at rest, as quaternions x, y, z, w."""
    matrices: NDArray[np.floating[Any]] | None = None
    """(points, 3, 3): the same as matrices, whose columns are the axes."""
    stretch: NDArray[np.floating[Any]] | None = None
    """(points, 2): the stretch of the surface that is left, as two factors, the larger first."""
    uvs: NDArray[np.floating[Any]] | None = None
    """(points, 2): where the surface has the texture of each point, with the tile's place added."""


Arrays = dict[str, NDArray[np.floating[Any]]]
"""Arrays by name."""

_COLUMNS = {"positions": (3,), "rotations": (4,), "matrices": (3, 3), "stretch": (2,), "uvs": (2,)}


class Carrier(Owned):
    """Points bound to the rest surface of an asset; made by Asset.carrier. It follows the solves that come after it was
    made, keeps the data that it needs, and may be used after the asset is closed."""

    def __init__(self, asset: _abi.vrtm_asset, points: dict[str, Any], settings: dict[str, Any]) -> None:
        given = {name: value for name, value in points.items() if value is not None}
        # What each goes with, and its name in the library.
        known = {"uvs": ("layers", "uv"), "corners": ("weights", "corners"), "positions": ("", "nearest")}
        ways = [name for name in known if name in given]
        if len(ways) != 1:
            raise ValueError(f"one of uvs, corners and positions says where the points are, not {ways or 'none'}")
        more, bind = known[ways[0]]
        if wrong := sorted(set(given) - {more, ways[0]}):
            raise ValueError(f"{wrong[0]}: does not go with {ways[0]}")
        if ways[0] == "corners" and "weights" not in given:
            raise ValueError("weights: missing, three for each point")
        pinned, desc = Pinned(), new(_abi.vrtm_carrier_desc)
        desc.bind = value_of("bind", bind)
        desc.fit = value_of("fit", settings["fit"])
        desc.uv_set = natural("uv_set", settings["uv_set"], 32)
        desc.farthest, desc.skirt = settings["farthest"], settings["skirt"]
        given |= {name: settings[name] for name in ("heights", "frames", "pieces") if settings[name] is not None}
        if "frames" in given:
            frames = floats("frames", given.pop("frames"))
            frames = frames.reshape(len(frames), 9) if frames.shape[1:] == (3, 3) else frames
            given["matrices" if frames.shape[-1] == 9 else "frames"] = frames
        vectors = {"uvs": 2, "weights": 3, "positions": 3, "heights": 1, "matrices": 9, "frames": 4}
        for name, components in vectors.items():
            if name in given:
                setattr(desc, name, ctypes.pointer(pinned.vectors(name, given[name], components)))
        pinned.rows = count = len(np.asarray(given["weights" if ways[0] == "corners" else ways[0]]))
        for name, each in {"layers": 1, "corners": 3, "pieces": 1}.items():
            if name in given:
                numbers = pinned.indices(name, given[name], none=name == "pieces")
                if len(numbers) != each * count:
                    raise ValueError(f"{name}: has {len(numbers)} elements, not {each} for each of {count} points")
                setattr(desc, name, numbers.ctypes.data)
        handle = _abi.vrtm_carrier()
        check(library.vrtm_carrier_create(asset, ctypes.byref(desc), ctypes.byref(handle)))
        self._own(handle, library.vrtm_carrier_destroy)

    @property
    def info(self) -> CarrierInfo:
        """Numbers of points, also of those that could not be bound, and what the last fetch found."""
        return told(CarrierInfo, library.vrtm_carrier_get_info, self._handle)

    def states(self) -> NDArray[np.int32]:
        """Binding of each point, (points,): 0 on a chart; 1 outside of all charts, 2 in folded UVs, 3 too far from the
        surface. Points of states 1 to 3 move with the surface alone."""
        states = np.empty(self.info.points, np.int32)
        check(library.vrtm_carrier_fetch_states(self._handle, states.ctypes.data, len(states)))
        return states

    def fetch(self, *names: str, dtype: DTypeLike = np.float32, out: Arrays | None = None) -> Carried:
        """Carries the points into the pose of the asset's last solve. `names`: what is wanted of positions, rotations
        or matrices, stretch and uvs; by default positions and rotations. `out`: arrays by these names, which are
        wanted, too, and written in place, whatever the distance of their rows. Raises NotSolvedError before the first
        solve that came after the carrier was made."""
        target = CarriedTarget(self, names, dtype, out)
        check(library.vrtm_carrier_fetch(self._handle, ctypes.byref(target.struct)))
        return target.done()


class CarriedTarget:
    """Arrays that carried points are written to."""

    def __init__(self, carrier: Carrier, names: tuple[str, ...], dtype: DTypeLike, out: Arrays | None) -> None:
        count, carried = carrier.info.points, new(_abi.vrtm_carried)
        arrays: dict[str, Any] = {}
        out = {} if out is None else out
        if not isinstance(out, dict):
            raise TypeError(f"out: is a {type(out).__name__}, not a dict of arrays by name")
        wanted = [*(names or ("positions", "rotations")), *out]
        if wrong := [name for name in wanted if name not in tuple(_COLUMNS)]:
            raise ValueError(f"{wrong[0]!r} is none of {', '.join(_COLUMNS)}")
        for name in dict.fromkeys(wanted):
            given = out.get(name)
            format = np.dtype(getattr(given, "dtype", dtype))
            if format not in FLOATS:
                raise ValueError(f"{name}: {format} is neither float32 nor float64")
            array = output(name, given, (count, *_COLUMNS[name]), format)
            row = array[:1]
            if count and (not row.flags.c_contiguous or array.strides[0] < row.nbytes):
                raise ValueError(f"{name}: its rows are not contiguous")
            struct = new(_abi.vrtm_array_out)
            struct.format, struct.data = FLOATS[format], array.ctypes.data
            struct.count, struct.stride = count, array.strides[0] if count > 1 else 0
            arrays[name] = array
            setattr(carried, name, ctypes.pointer(struct))
        self.struct, self._arrays = carried, arrays

    def done(self) -> Carried:
        """The arrays, once they are written."""
        return Carried(**self._arrays)
