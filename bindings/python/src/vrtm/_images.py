"""numpy arrays as the library's images."""

from typing import Any

import numpy as np
from numpy.typing import ArrayLike, DTypeLike

from . import _abi
from ._arrays import Pinned, Pixels, array_of, output
from ._library import new
from ._names import value_of
from ._records import FetchKind, Origin

PIXELS = {
    np.dtype(np.float32): _abi.VRTM_PIXEL_F32,
    np.dtype(np.float16): _abi.VRTM_PIXEL_F16,
    np.dtype(np.uint16): _abi.VRTM_PIXEL_U16,
    np.dtype(np.uint8): _abi.VRTM_PIXEL_U8,
}

#: Channels of each kind of output, unless the caller asks for another number.
CHANNELS = {"jacobian": 4, "filter_scale": 1}


def image(pinned: Pinned, name: str, value: ArrayLike, channel: int, origin: Origin) -> _abi.vrtm_image:
    """An input image (height, width) or (height, width, channels), of which one channel is read."""
    array = array_of(name, value)
    shape = array.shape
    if array.ndim == 2:
        array = array[:, :, None]
    if array.ndim != 3 or 0 in shape or array.shape[0] <= 4 < array.shape[2]:
        raise ValueError(f"{name}: has the shape {shape}, not (height, width) or (height, width, channels)")
    if not 0 <= channel < array.shape[2]:
        raise ValueError(f"channel: {channel} is none of the {array.shape[2]} of {name}")
    array = array[:, :, channel]
    if array.dtype == np.bool_:
        array = array.astype(np.uint8) * 255
    elif array.dtype.kind == "f" and (array.dtype not in PIXELS or not array.dtype.isnative):
        array = array.astype(np.float32)
    if array.dtype not in PIXELS or not array.dtype.isnative:
        raise TypeError(f"{name}: holds {array.dtype}, not uint8, uint16, float16 or float32")
    if not _fits(array, array.itemsize):
        array = np.ascontiguousarray(array)
    struct = new(_abi.vrtm_image)
    struct.format = PIXELS[array.dtype]
    struct.data = pinned.keep(array).ctypes.data
    struct.height, struct.width = array.shape
    struct.row_stride, struct.pixel_stride = _strides(array)
    struct.origin = value_of("origin", origin)
    return pinned.keep(struct)


def _strides(array: np.ndarray) -> tuple[int, int]:
    """Bytes from row to row and from texel to texel; with a single row or texel, its stride has no meaning."""
    row, pixel = array.strides[:2]
    return (row if array.shape[0] > 1 else 0, pixel if array.shape[1] > 1 else 0)


def _fits(array: np.ndarray, texel: int) -> bool:
    """True if texels of this many bytes lie in ascending order without overlap."""
    height, width = array.shape[:2]
    row, pixel = _strides(array)
    end = (pixel or texel) * (width - 1) + texel
    return (width == 1 or pixel >= texel) and (height == 1 or row >= end)


class Target:
    """An output image that the library writes: the caller's array itself where its layout allows it."""

    def __init__(
        self,
        pinned: Pinned,
        kind: FetchKind,
        size: tuple[int, int],
        *,
        dtype: DTypeLike = np.float32,
        channels: int = 0,
        origin: Origin = "top",
        out: Pixels | None = None,
    ) -> None:
        dtype = pixel_type(dtype if out is None else getattr(out, "dtype", dtype))
        width, height = size
        shape = (height, width, channels or CHANNELS.get(kind, 2))
        #: The array that the caller gets.
        self.array = output("out", out, shape, dtype)
        texel = shape[2] * dtype.itemsize
        direct = self.array.strides[2] == dtype.itemsize or shape[2] == 1
        self._written = self.array if direct and _fits(self.array, texel) else np.empty(shape, dtype)
        struct = new(_abi.vrtm_image_out)
        struct.format = PIXELS[dtype]
        struct.data = pinned.keep(self._written).ctypes.data
        struct.width, struct.height = width, height
        struct.row_stride, struct.pixel_stride = _strides(self._written)
        struct.origin = value_of("origin", origin)
        struct.channels = channels
        self.struct = pinned.keep(struct)

    def done(self) -> Pixels:
        """After the call: the caller's array, filled."""
        if self._written is not self.array:
            self.array[...] = self._written
        return self.array


def pixel_type(dtype: DTypeLike) -> np.dtype:
    """Checks the number format of an output."""
    dtype = np.dtype(dtype)
    if dtype not in (np.dtype(np.float32), np.dtype(np.float16)):
        raise ValueError(f"dtype: {dtype} is neither float32 nor float16")
    return dtype


def image_size(size: Any) -> tuple[int, int]:
    """(width, height) as the caller gave it; a single number for both."""
    width, height = (size, size) if np.ndim(size) == 0 else size
    for name, value in (("width", width), ("height", height)):
        if not 1 <= int(value) <= 0xFFFFFFFF:
            raise ValueError(f"size: {value} is no {name} of an image")
    return int(width), int(height)
