"""Maps as pictures, for notebooks."""

from __future__ import annotations

import base64
import html
import struct
import zlib
from typing import TYPE_CHECKING

import numpy as np

from ._errors import Error

if TYPE_CHECKING:
    from ._tile import Tile

_SIDE = 256
_SQUARES = 16


def figure(tile: Tile) -> str:
    """The tile's last result as HTML: a checkerboard as the redirection looks it up, the redder the farther away."""
    title = html.escape(repr(tile))
    try:
        report, found = tile.report(), tile.fetch("redirection", _SIDE, channels=4)
    except Error as error:
        return f"<figure><figcaption>{title}: {html.escape(error.message)}</figcaption></figure>"
    at = (np.arange(_SIDE) + 0.5) / _SIDE
    shift = np.hypot(found[..., 0] - at, found[..., 1] - at[::-1, None])
    light = 0.75 + 0.2 * (np.floor(found[..., :2] * _SQUARES).sum(-1) % 2)
    shift = np.where(found[..., 3] > 0, shift, 0)
    red = shift / max(shift.max(), 1e-9)
    colours = np.stack([light, light * (1 - 0.6 * red), light * (1 - 0.9 * red), found[..., 3]], -1)
    data = base64.b64encode(png(np.rint(255 * colours.clip(0, 1)).astype(np.uint8))).decode()
    text = f"looked up at most {shift.max():.3g} UV away; least Jacobian {report.min_jacobian:.3g}"
    return (
        f'<figure style="display: inline-block"><img src="data:image/png;base64,{data}" alt="redirection">'
        f"<figcaption>{title}<br>{text}</figcaption></figure>"
    )


def png(pixels: np.ndarray) -> bytes:
    """A PNG of (height, width, 4) uint8."""

    def chunk(kind: bytes, data: bytes) -> bytes:
        return struct.pack(">I", len(data)) + kind + data + struct.pack(">I", zlib.crc32(kind + data))

    height, width, _ = pixels.shape
    # Each row begins with the number of its filter, none.
    rows = np.pad(pixels.reshape(height, -1), ((0, 0), (1, 0)))
    header = chunk(b"IHDR", struct.pack(">IIBBBBB", width, height, 8, 6, 0, 0, 0))
    return b"\x89PNG\r\n\x1a\n" + header + chunk(b"IDAT", zlib.compress(rows.tobytes())) + chunk(b"IEND", b"")
