"""Warped copies of textures: texture(redirection(uv)), for renderers that have no dependent lookup.

A texel of the copy covers a parallelogram of the texture, which the redirection's Jacobian J maps the texel to.
Catmull-Rom interpolation filters as wide as a texel by itself; where nothing moves the copy is the texture, bit by bit.
What J adds to that is the ellipse of the covariance J Jt - 1, less what is negative of it: samples are taken all over
that, and averaged. The more the texture is squeezed, the more samples.
"""

from __future__ import annotations

import functools
import math
import os
import re
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
import OpenImageIO as oiio

from vrtm.bake.failure import INPUT, Failure
from vrtm.bake.fingerprint import Fingerprint

Fetch = Callable[[str, int, int, int, int], np.ndarray]
"""kind, whole width, whole height, first row, rows -> (rows, width, channels) f32 of a tile, first row at the top."""

VERSION = 1
"""Of the way of resampling: a file that was made in another way is not up to date."""

_KINDS = ("redirect", "warp", "jacobian", "filter")
_FORMATS = {"openexr": ".exr", "png": ".png", "tiff": ".tif"}
_KEPT_AS = {"uint8": "uint8", "uint16": "uint16", "half": "float16", "float": "float32"}
# Attributes that say how pixels are stored in one file, or when and by what it was made, and not what they mean.
_FILE_ONLY = re.compile(
    r"(compression|DateTime|Software|textureformat|oiio:(?!ColorSpace$|UnassociatedAlpha$).*|openexr:.*|tiff:.*|png:.*"
    r"|jpeg:.*|Exif:.*|planarconfig|thumbnail.*|fullscreenuv|.*[Ss]ubimage.*|vrtm:.*|Orientation|ImageDescription|capDate)"
)
_ROWS = 128
_COLUMNS = 128
_MOST_SAMPLES = 8
_MARGIN = 8


@dataclass(frozen=True)
class Copy:
    """A texture that gets a warped copy of each tile."""

    pattern: str
    kind: str
    """Its name in file names."""
    is_normal: bool
    down: bool
    """Whether green grows against v."""


@dataclass(frozen=True, eq=False)
class Texture:
    """An image as it is stored, with what its copy keeps of it."""

    path: str
    pixels: np.ndarray
    """(height, width, channels), the first row at the top: uint8, uint16, float16 or float32."""
    channels: tuple[str, ...]
    alpha: int
    attributes: dict[str, tuple[str, object]]
    """OpenImageIO's types and values."""
    format: str
    inputs: str
    """A hash of all these but the path."""

    @property
    def extension(self) -> str:
        """Of the copy's name."""
        return _FORMATS[self.format]


def listed(textures: tuple[str, ...], normal_maps: tuple[str, ...], down: bool) -> tuple[Copy, ...]:
    """The textures of a command line, each with a name of its own. Raises Failure."""
    copies: list[Copy] = []
    for pattern, is_normal in [(p, False) for p in textures] + [(p, True) for p in normal_maps]:
        option = "--normal-map" if is_normal else "--texture"
        stem = os.path.splitext(os.path.basename(pattern))[0]
        kind = re.sub(r"[._-]*<(UDIM|mesh)>", "", stem, flags=re.IGNORECASE).strip("._- ") or "texture"
        taken = {copy.kind for copy in copies} | set(_KINDS)
        if kind in taken:
            raise Failure(INPUT, f"{option} {pattern}: its copies would be named '{kind}', and so would other files")
        copies.append(Copy(pattern, kind, is_normal, down))
    return tuple(copies)


@functools.lru_cache(maxsize=4)
def read(path: str) -> Texture:
    """Reads a texture. Its channels are independent values: neither is alpha multiplied in, nor are colours converted.
    Raises Failure."""
    config = oiio.ImageSpec()
    config.attribute("oiio:UnassociatedAlpha", 1)
    file = oiio.ImageInput.open(path, config)
    if file is None:
        raise Failure(INPUT, f"{path}: {oiio.geterror().strip() or 'no such image'}")
    try:
        spec = file.spec()
        if spec.deep:
            raise Failure(INPUT, f"{path}: a deep image")
        if (spec.width, spec.height, spec.x, spec.y) != (spec.full_width, spec.full_height, spec.full_x, spec.full_y):
            raise Failure(INPUT, f"{path}: its data window is not the whole image")
        dtype = _KEPT_AS.get(str(spec.format), "float32")
        pixels = file.read_image(0, 0, 0, spec.nchannels, {"float16": "half", "float32": "float"}.get(dtype, dtype))
        if pixels is None:
            raise Failure(INPUT, f"{path}: {file.geterror().strip() or 'cannot be read'}")
        source = file.format_name()
    finally:
        file.close()
    pixels = np.asarray(pixels).reshape(spec.height, spec.width, spec.nchannels)
    channels = tuple(spec.channelnames)
    integer = pixels.dtype.kind == "u"
    kept = {a.name: (str(a.type), a.value) for a in spec.extra_attribs if not _FILE_ONLY.fullmatch(a.name)}
    if source in _FORMATS and integer == (source != "openexr"):
        form = source
    else:
        form = "openexr" if not integer else "png" if len(channels) <= 4 else "tiff"
    hashed = Fingerprint().text(VERSION, oiio.__version__, form, channels, spec.alpha_channel).array(pixels)
    for name in sorted(kept):
        hashed.text(name, kept[name])
    if spec.alpha_channel >= 0 and form != "openexr":
        kept["oiio:UnassociatedAlpha"] = ("int", 1)
    return Texture(path, pixels, channels, spec.alpha_channel, kept, form, hashed.hex())


def warp(texture: Texture, copy: Copy, fetch: Fetch, stop: Callable[[], None] = lambda: None) -> np.ndarray:
    """The copy: (height, width, channels) as the texture. `stop` is called now and then, and may raise."""
    height, width, channels = texture.pixels.shape
    if copy.is_normal and channels < 3:
        raise Failure(INPUT, f"{texture.path}: a normal map needs three channels, it has {channels}")
    top = float(np.iinfo(texture.pixels.dtype).max) if texture.pixels.dtype.kind == "u" else 1.0
    source = texture.pixels.astype(np.float32) / np.float32(top)
    # What overshoots beside an edge must not leave the range that the texture has.
    low, high = source.min(axis=(0, 1)), source.max(axis=(0, 1))
    # A margin, since there is nothing to interpolate with beyond an image's edge.
    padded = oiio.ImageBuf(np.pad(source, ((_MARGIN, _MARGIN), (_MARGIN, _MARGIN), (0, 0)), mode="edge"))
    out = np.empty_like(texture.pixels)
    across = (np.arange(width) + 0.5) / width
    for first in range(0, height, _ROWS):
        stop()
        part = slice(first, min(first + _ROWS, height))
        count = part.stop - first
        delta = fetch("redirection_delta", width, height, first, count)[..., :2].astype(np.float64)
        jacobian = fetch("jacobian", width, height, first, count)
        still = (delta == 0).all(axis=-1) & (jacobian == np.float32([1, 0, 0, 1])).all(axis=-1)
        delta[..., 0] += across
        delta[..., 1] += 1 - (np.arange(first, part.stop)[:, None] + 0.5) / height
        strip = _sampled(padded, delta, _footprint(jacobian, width, height), source.shape)
        strip = np.clip(strip, low, high)
        if copy.is_normal:
            strip[..., :3] = _turned(strip[..., :3], jacobian, copy.down)
        moved = np.rint(strip * top) if top != 1.0 else strip
        out[part] = np.where(still[..., None], texture.pixels[part], moved.astype(out.dtype))
    return out


def _footprint(jacobian: np.ndarray, width: int, height: int) -> np.ndarray:
    """(rows, width, 3): the symmetric matrix (xx, xy, yy), in UVs, whose product with points of the unit square around
    0 spreads samples as far as the redirection widens a texel."""
    ratio = width / height
    a, b = jacobian[..., 0].astype(np.float64), jacobian[..., 1].astype(np.float64) * ratio
    c, d = jacobian[..., 2].astype(np.float64) / ratio, jacobian[..., 3].astype(np.float64)
    xx, xy, yy = a * a + b * b, a * c + b * d, c * c + d * d
    # The eigenvalues of J Jt, and of each what exceeds 1, as a root: a function of the matrix.
    mean, half = (xx + yy) / 2, np.hypot((xx - yy) / 2, xy)
    large, small = np.sqrt(np.maximum(mean + half - 1, 0)), np.sqrt(np.maximum(mean - half - 1, 0))
    share = np.divide(large - small, 2 * half, out=np.zeros_like(half), where=half > 1e-12)
    base = small - share * (mean - half)
    # It has the eigenvectors of J Jt and the eigenvalues `small` and `large`.
    return np.stack([(base + share * xx) / width, share * xy, (base + share * yy) / height], axis=-1)


def _sampled(padded: oiio.ImageBuf, at: np.ndarray, spread: np.ndarray, shape: tuple[int, ...]) -> np.ndarray:
    """(rows, width, channels) f32: the texture around `at`, averaged over the footprint."""
    height, width, _ = shape
    scale = np.array([width, height]) / (np.array([width, height]) + 2 * _MARGIN)
    shift = _MARGIN / (np.array([width, height]) + 2 * _MARGIN)
    texels = np.stack([spread[..., 0] * width, spread[..., 2] * height], axis=-1).max(axis=-1)
    widest = np.maximum.reduceat(texels.max(axis=0), np.arange(0, texels.shape[1], _COLUMNS))
    out = np.empty((*at.shape[:2], shape[2]), np.float32)
    # Side by side columns with as many samples as the widest footprint in them needs.
    for index, most in enumerate(widest):
        part = np.s_[:, index * _COLUMNS : (index + 1) * _COLUMNS]
        total = np.zeros(out[part].shape, np.float64)
        count = 1 if most < 0.3 else min(_MOST_SAMPLES, 1 + math.ceil(most))
        steps = (np.arange(count) + 0.5) / count - 0.5
        for x in steps:
            for y in steps:
                s = at[part][..., 0] + spread[part][..., 0] * x + spread[part][..., 1] * y / height
                t = at[part][..., 1] + spread[part][..., 1] * x / width + spread[part][..., 2] * y
                places = np.stack([np.clip(s, 0, 1), np.clip(t, 0, 1)], axis=-1) * scale + shift
                total += _interpolated(padded, places.astype(np.float32))
        out[part] = total / (count * count)
    return out


def _interpolated(padded: oiio.ImageBuf, places: np.ndarray) -> np.ndarray:
    rows, columns, _ = places.shape
    out = oiio.ImageBuf(oiio.ImageSpec(columns, rows, padded.nchannels, "float"))
    if not oiio.ImageBufAlgo.st_warp(out, padded, oiio.ImageBuf(places), "catmull-rom", flip_t=True):
        raise RuntimeError(out.geterror())
    return np.asarray(out.get_pixels("float")).reshape(rows, columns, padded.nchannels)


def _turned(encoded: np.ndarray, jacobian: np.ndarray, down: bool) -> np.ndarray:
    """Normals, from 0 to 1, turned back by the angle that the redirection turns a feature by, and of length 1."""
    normals = encoded.astype(np.float64) * 2 - 1
    sign = -1.0 if down else 1.0
    du, dv = jacobian[..., 0].astype(np.float64), jacobian[..., 2].astype(np.float64)
    length = np.hypot(du, dv)
    cosine = np.divide(du, length, out=np.ones_like(du), where=length > 0)
    sine = np.divide(dv, length, out=np.zeros_like(dv), where=length > 0)
    x, y = normals[..., 0], normals[..., 1] * sign
    turned = np.stack([cosine * x + sine * y, (cosine * y - sine * x) * sign, normals[..., 2]], axis=-1)
    size = np.linalg.norm(turned, axis=-1, keepdims=True)
    turned = np.divide(turned, size, out=np.broadcast_to([0.0, 0.0, 1.0], turned.shape).copy(), where=size > 1e-6)
    return turned / 2 + 0.5
