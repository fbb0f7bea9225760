"""Maps as pictures, for notebooks."""

from __future__ import annotations

import base64
import html
import struct
import zlib

import numpy as np

_SQUARES = 16


def figure(title: str, redirection: np.ndarray, least: float) -> str:
    """HTML of a redirection of four channels: a checkerboard that is looked up through it, redder where that is farther
    away. `least`: the least Jacobian."""
    rows, columns = redirection.shape[:2]
    across, up = (np.arange(columns) + 0.5) / columns, 1 - (np.arange(rows) + 0.5) / rows
    shift = np.hypot(redirection[..., 0] - across, redirection[..., 1] - up[:, None])
    light = 0.75 + 0.2 * (np.floor(redirection[..., :2] * _SQUARES).sum(-1) % 2)
    covered = redirection[..., 3]
    shift = np.where(covered > 0, shift, 0)
    red = shift / max(shift.max(), 1e-9)
    colours = np.stack([light, light * (1 - 0.6 * red), light * (1 - 0.9 * red), covered], -1)
    data = base64.b64encode(png(np.rint(255 * colours.clip(0, 1)).astype(np.uint8))).decode()
    text = f"looked up at most {shift.max():.3g} UV away; least Jacobian {least:.3g}"
    return (
        f'<figure style="display: inline-block"><img src="data:image/png;base64,{data}" alt="redirection">'
        f"<figcaption>{html.escape(title)}<br>{text}</figcaption></figure>"
    )


def without_picture(title: str, why: str) -> str:
    """HTML in the place of a figure, with the reason."""
    return f"<figure><figcaption>{html.escape(f'{title}: {why}')}</figcaption></figure>"


def png(pixels: np.ndarray) -> bytes:
    """A PNG of (height, width, 4) uint8."""

    def chunk(kind: bytes, data: bytes) -> bytes:
        return struct.pack(">I", len(data)) + kind + data + struct.pack(">I", zlib.crc32(kind + data))

    height, width, _ = pixels.shape
    # Each row begins with the number of its filter, none.
    rows = np.pad(pixels.reshape(height, -1), ((0, 0), (1, 0)))
    header = chunk(b"IHDR", struct.pack(">IIBBBBB", width, height, 8, 6, 0, 0, 0))
    return b"\x89PNG\r\n\x1a\n" + header + chunk(b"IDAT", zlib.compress(rows.tobytes())) + chunk(b"IEND", b"")
