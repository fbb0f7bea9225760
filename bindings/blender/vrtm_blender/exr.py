"""EXR files of one picture: floats of 32 or 16 bits, compressed without loss, with attributes that tell whose they are.

Blender's own `Image.save` takes no attributes, and Blender brings no OpenImageIO to Python on all systems. The format:
https://openexr.com/en/latest/OpenEXRFileLayout.html
"""

from __future__ import annotations

import os
import struct
import zlib
from collections.abc import Mapping
from concurrent.futures import ThreadPoolExecutor

import numpy as np

_MAGIC = b"\x76\x2f\x31\x01\x02\0\0\0"
# Rows that are compressed together, and the number of that compression.
_ROWS, _ZIP = 16, 3
# Channels in the order in which they are stored, that of their names, and their places in a pixel.
_CHANNELS = (("A", 3), ("B", 2), ("G", 1), ("R", 0))
# OpenEXR's own: more takes much longer for little.
_LEVEL = 4
# Channels' types by their numbers in a file.
_TYPES = {1: "<f2", 2: "<f4"}


def file_of(pixels: np.ndarray, facts: Mapping[str, str | int], halves: bool = False) -> bytes:
    """The file of (height, width, 4) float32 pixels, the bottom row first. `facts` are attributes. With 16 bits for a
    value, `halves`, it is off by 1 / 2048 of itself at most, or by 2^-25 where that is more."""
    of = 1 if halves else 2
    height, width = pixels.shape[:2]
    box = struct.pack("<4i", 0, 0, width - 1, height - 1)
    channels = b"".join(name.encode() + b"\0" + struct.pack("<iiii", of, 0, 1, 1) for name, _ in _CHANNELS) + b"\0"
    header = []
    # In front, so that they are there whatever else of the file is not.
    for name, value in sorted(facts.items()):
        number = isinstance(value, int)
        packed = struct.pack("<i", value) if number else value.encode()
        header.append(_attribute(name, "int" if number else "string", packed))
    header += [
        _attribute("channels", "chlist", channels),
        _attribute("compression", "compression", bytes([_ZIP])),
        _attribute("dataWindow", "box2i", box),
        _attribute("displayWindow", "box2i", box),
        _attribute("lineOrder", "lineOrder", b"\0"),
        _attribute("pixelAspectRatio", "float", struct.pack("<f", 1)),
        _attribute("screenWindowCenter", "v2f", struct.pack("<ff", 0, 0)),
        _attribute("screenWindowWidth", "float", struct.pack("<f", 1)),
    ]
    start = _MAGIC + b"".join(header) + b"\0"
    # Rows from the top, and in each of them a channel after the other.
    rows = np.ascontiguousarray(pixels[::-1, :, [place for _, place in _CHANNELS]].transpose(0, 2, 1), _TYPES[of])
    firsts = range(0, height, _ROWS)
    with ThreadPoolExecutor(os.cpu_count()) as pool:
        packed = pool.map(lambda first: _packed(rows[first : first + _ROWS]), firsts)
        parts = [struct.pack("<ii", first, len(data)) + data for first, data in zip(firsts, packed)]
    begins = np.cumsum([len(start) + 8 * len(parts), *map(len, parts[:-1])])
    return b"".join([start, begins.astype("<u8").tobytes(), *parts])


def _attribute(name: str, kind: str, value: bytes) -> bytes:
    return name.encode() + b"\0" + kind.encode() + b"\0" + struct.pack("<i", len(value)) + value


def _packed(rows: np.ndarray) -> bytes:
    """Rows as EXR's ZIP has them: the bytes of even places before those of odd ones, each as its difference to the one
    before; or as they are, if that is not longer."""
    raw = rows.view(np.uint8).ravel()
    parted = np.concatenate([raw[0::2], raw[1::2]])
    differences = parted.copy()
    # Modulo 256.
    differences[1:] = parted[1:] - parted[:-1] + np.uint8(128)
    data = zlib.compress(differences, _LEVEL)
    return data if len(data) < len(raw) else raw.tobytes()
