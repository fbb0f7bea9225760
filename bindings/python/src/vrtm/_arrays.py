"""numpy arrays as the library's arrays: as views where their layout allows it, as copies otherwise."""

from collections.abc import Callable, Sequence
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from . import _abi
from ._library import new

FLOATS = {np.dtype(np.float32): _abi.VRTM_SCALAR_F32, np.dtype(np.float64): _abi.VRTM_SCALAR_F64}


Pixels = NDArray[np.floating[Any]]
"""Outputs: of float32 or float16."""


class Pinned:
    """Structs for one call, and the memory that they point to, which must live as long."""

    def __init__(self) -> None:
        self._kept: list[Any] = []
        #: Rows that a list of numbers may have: faces with their corners, points with theirs.
        self.rows = 1

    def keep(self, value: Any) -> Any:
        self._kept.append(value)
        return value

    def vectors(self, name: str, value: ArrayLike, components: int, *, more: int = 0) -> _abi.vrtm_array:
        """An array of vectors, (count, components), or of numbers, (count,). `more`: the number of further components
        that are allowed and ignored."""
        array = floats(name, value)
        shape = array.shape
        if components == 1 and array.ndim == 1:
            array = array[:, None]
        if array.ndim != 2 or not components <= array.shape[1] <= components + more:
            wanted = "(count,)" if components == 1 else f"(count, {components})"
            raise ValueError(f"{name}: has the shape {shape}, not {wanted}")
        array = array[:, :components]
        packed = components * array.itemsize
        if (components > 1 and array.strides[1] != array.itemsize) or array.strides[0] < packed:
            array = np.ascontiguousarray(array)
        struct = new(_abi.vrtm_array)
        struct.format = FLOATS[array.dtype]
        struct.data = self.keep(array).ctypes.data
        struct.count = len(array)
        struct.stride = array.strides[0] if len(array) > 1 else 0
        return self.keep(struct)

    def indices(self, name: str, value: ArrayLike, *, none: bool = False) -> NDArray[np.uint32]:
        """A list of unsigned 32-bit integers, which may have two dimensions with a row for each face. `none`: -1 is
        allowed and means "none"."""
        array = array_of(name, value)
        if array.ndim > 1 and array.size not in (0, *array.shape) and array.shape[0] != self.rows:
            # Its numbers would be read in another order than the caller thinks of.
            raise ValueError(f"{name}: has the shape {array.shape}, not (count,) or ({self.rows}, n)")
        if array.dtype.kind not in "iu" and array.size:
            raise TypeError(f"{name}: holds {array.dtype}, not integers")
        array = array.reshape(-1)
        # Unsigned 32-bit integers need no check, and -1 has the bits that mean "none".
        if array.dtype.newbyteorder("=") != np.uint32 and array.size:
            least, most = int(array.min()), int(array.max())
            if least < (-1 if none else 0) or most > 0xFFFFFFFF:
                bad = least if least < 0 else most
                raise ValueError(f"{name}: {bad} at {int(np.flatnonzero(array == bad)[0])} is out of range")
        if array.dtype == np.int32:
            array = array.view(np.uint32)
        return self.keep(np.ascontiguousarray(array.astype(np.uint32, copy=False)))


def array_of(name: str, value: ArrayLike) -> np.ndarray:
    """Returns numpy's array of a value. Raises ValueError for rows of different lengths."""
    try:
        array = np.asarray(value)
        ragged = array.dtype == object and any(isinstance(row, (Sequence, np.ndarray)) for row in array.flat)
    except ValueError:
        ragged = True
    if ragged:
        faces = ": faces of different lengths are one list of all their corners, with face_counts"
        raise ValueError(f"{name}: holds rows of different lengths{faces * name.endswith('indices')}")
    return array


def floats(name: str, value: ArrayLike) -> np.ndarray:
    """An array of f32 or f64: returned unchanged if it has such a type, else converted."""
    array = array_of(name, value)
    if array.dtype in FLOATS and array.dtype.isnative:
        return array
    if array.dtype.kind not in "fiub":
        raise TypeError(f"{name}: holds {array.dtype}, not numbers")
    # Types without more bits than f32 are converted to it without loss.
    return array.astype(np.float32 if array.dtype.itemsize <= 2 or array.dtype.str[1:] == "f4" else np.float64)


def output(name: str, out: Any, shape: tuple[int, ...], dtype: Any = np.float32) -> np.ndarray:
    """A contiguous output array: the caller's if it is suitable, or a new one."""
    if out is None:
        return np.empty(shape, dtype)
    if not isinstance(out, np.ndarray) or out.shape != shape or out.dtype != dtype:
        found = f"{out.dtype} {out.shape}" if isinstance(out, np.ndarray) else type(out).__name__
        raise ValueError(f"{name}: is {found}, not an array of {np.dtype(dtype)} {shape}")
    if not out.flags.writeable:
        raise ValueError(f"{name}: is read-only")
    return out


def filled(out: Any, shape: tuple[int, ...], write: Callable[[int], None]) -> NDArray[np.float32]:
    """The caller's array, or a new one, with what `write` puts at the address of a packed array of this shape."""
    array = output("out", out, shape)
    packed = np.ascontiguousarray(array)
    write(packed.ctypes.data)
    if packed is not array:
        array[...] = packed
    return array
