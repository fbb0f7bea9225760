"""Warped copies of textures: texture(redirection(uv)), for renderers that have no dependent lookup.

A texel of the copy covers a parallelogram of the texture, which the redirection's Jacobian J maps the texel to.
Catmull-Rom interpolation filters as wide as a texel by itself; where nothing moves the copy is the texture, bit by bit.
What J adds to that is the ellipse of the covariance J Jt - 1, less what is negative of it: samples are taken all over
that, and averaged. The more the texture is squeezed, the more samples.
"""

import functools
import os
import re
from collections.abc import Callable, Mapping
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass

import numpy as np
import OpenImageIO as oiio

from vrtm.bake import mip_levels, tokens
from vrtm.bake.failure import INPUT, Failure
from vrtm.bake.fingerprint import Fingerprint
from vrtm.bake.image_file import Target
from vrtm.bake.scene.images import KEPT, opened, texels_of, white
from vrtm.resample import MARGIN, interpolated, turned

Fetch = Callable[[str, int, int, int, int], np.ndarray]
"""kind, whole width, whole height, first row, rows -> (rows, width, channels) f32 of a tile, first row at the top."""

VERSION = 1
"""Of the way of resampling: a file that was made in another way is not up to date."""

_KINDS = ("redirect", "warp", "jacobian", "filter")
_FORMATS = {"openexr": ".exr", "png": ".png", "tiff": ".tif"}
# Attributes that say how pixels are stored in one file, or when and by what it was made, and not what they mean.
_FILE_ONLY = re.compile(
    r"(compression|DateTime|Software|textureformat|oiio:(?!ColorSpace$|UnassociatedAlpha$).*|openexr:.*|tiff:.*|png:.*"
    r"|jpeg:.*|Exif:.*|planarconfig|thumbnail.*|fullscreenuv|.*[Ss]ubimage.*|vrtm:.*|Orientation|ImageDescription|capDate)"
)
_ROWS = 128
_MOST_SAMPLES = 8
_AT_ONCE = 1 << 15
"""Texels that are interpolated at a time: what that takes fits into a processor's cache."""


@dataclass(frozen=True)
class Copy:
    """A texture that gets a warped copy of each tile."""

    pattern: str
    kind: str
    """Its name in file names."""
    is_normal: bool
    down: bool
    """True if green grows against v."""

    def read(self, path: str) -> "Texture":
        """Reads a texture. Raises SceneError, Failure."""
        texture = read(path)
        if self.is_normal and len(texture.channels) < 3:
            raise Failure(INPUT, f"{path}: a normal map needs three channels, it has {len(texture.channels)}")
        return texture


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
    has_levels: bool = False
    """True if it is tiled, with mip levels, as its copy will be."""

    def target(self, path: str, facts: Mapping[str, str | int]) -> Target:
        (height, width, _), dtype = self.pixels.shape, str(self.pixels.dtype)
        how = (self.attributes, self.format, self.alpha, self.has_levels)
        return Target(path, width, height, self.channels, dtype, facts, *how)


def listed(textures: tuple[str, ...], normal_maps: tuple[str, ...], down: bool) -> tuple[Copy, ...]:
    """The textures of a command line, each with a name of its own. Raises Failure."""
    copies: list[Copy] = []
    for given, is_normal in [*((p, False) for p in textures), *((p, True) for p in normal_maps)]:
        pattern = re.sub("<udim>", "<UDIM>", given, flags=re.IGNORECASE)
        option = "--normal-map" if is_normal else "--texture"
        kind = tokens.bare(os.path.splitext(os.path.basename(pattern))[0]).strip("._- ") or "texture"
        taken = {copy.kind for copy in copies} | set(_KINDS)
        if kind in taken:
            raise Failure(INPUT, f"{option} {pattern}: its copies would be named '{kind}', and so would other files")
        copies.append(Copy(pattern, kind, is_normal, down))
    return tuple(copies)


@functools.lru_cache(maxsize=4)
def read(path: str) -> Texture:
    """Reads a texture. Its channels are independent values: neither is alpha multiplied in, nor are colours converted.
    Raises SceneError, Failure."""
    spec, pixels, source = texels_of(path)
    if (spec.width, spec.height, spec.x, spec.y) != (spec.full_width, spec.full_height, spec.full_x, spec.full_y):
        raise Failure(INPUT, f"{path}: its data window is not the whole image")
    channels = tuple(spec.channelnames)
    kept = {a.name: (str(a.type), a.value) for a in spec.extra_attribs if _can_be_kept(a)}
    has_levels = mip_levels.are_in(path, spec)
    form = _format(source, str(pixels.dtype), len(channels), has_levels)
    hashed = Fingerprint().text(VERSION, oiio.VERSION_STRING, form, channels, spec.alpha_channel).array(pixels)
    if has_levels:
        hashed.text("levels")
    for name in sorted(kept):
        hashed.text(name, kept[name])
    if spec.alpha_channel >= 0 and form != "openexr":
        kept["oiio:UnassociatedAlpha"] = ("int", 1)
    return Texture(path, pixels, channels, spec.alpha_channel, kept, form, hashed.hex(), has_levels)


def _can_be_kept(attribute: oiio.ParamValue) -> bool:
    """True if an attribute means something in a copy, and can be written: one may have bytes that are no UTF-8."""
    if _FILE_ONLY.fullmatch(attribute.name):
        return False
    try:
        oiio.ImageSpec().attribute(attribute.name, str(attribute.type), attribute.value)
    except (RuntimeError, TypeError, ValueError):
        return False
    return True


@functools.cache
def extension(path: str) -> str:
    """Of the names of a texture's copies. Only the texture's header is read. Raises SceneError."""
    with opened(path) as file:
        spec = file.spec()
        own, has_levels = os.path.splitext(path)[1], mip_levels.are_in(path, spec)
        form = _format(file.format_name(), KEPT.get(str(spec.format), "float32"), spec.nchannels, has_levels)
        return own if own.lower() in mip_levels.ENDINGS else _FORMATS[form]


def _format(source: str, dtype: str, channels: int, has_levels: bool) -> str:
    """The file format of a copy: the texture's own, unless that cannot be written or may lose something."""
    integer = dtype.startswith("uint")
    if has_levels:
        return "tiff" if integer else "openexr"
    if source in _FORMATS and integer == (source != "openexr"):
        return source
    return "openexr" if not integer else "png" if channels <= 4 else "tiff"


def warp(
    texture: Texture, copy: Copy, fetch: Fetch, stop: Callable[[], None] = lambda: None, threads: int = 1
) -> np.ndarray:
    """The copy: (height, width, channels) as the texture. `stop` is called now and then, and may raise. `fetch` and
    `stop` are called on several threads at once."""
    height, width, channels = texture.pixels.shape
    top = white(texture.pixels.dtype)
    source = texture.pixels.astype(np.float32) / np.float32(top)
    # Overshoots beside an edge must not leave the texture's range.
    low, high = source.min(axis=(0, 1)), source.max(axis=(0, 1))
    # A margin, since there is nothing to interpolate with beyond an image's edge.
    padded = np.pad(source, ((MARGIN, MARGIN), (MARGIN, MARGIN), (0, 0)), mode="edge")
    out = np.empty_like(texture.pixels)
    across = (np.arange(width) + 0.5) / width

    def strip_from(first: int) -> None:
        stop()
        part = slice(first, min(first + _ROWS, height))
        count = part.stop - first
        delta = fetch("redirection_delta", width, height, first, count)[..., :2].astype(np.float64)
        jacobian = fetch("jacobian", width, height, first, count)
        still = (delta == 0).all(axis=-1) & (jacobian == np.float32([1, 0, 0, 1])).all(axis=-1)
        # In texels of the texture, from its upper left corner.
        x = (delta[..., 0] + across) * width
        y = np.arange(first, part.stop)[:, None] + 0.5 - delta[..., 1] * height
        strip = np.empty((count, width, channels), np.float32)
        moves = ~still
        strip[still] = 0
        strip[moves] = _sampled(padded, x[moves], y[moves], _footprint(jacobian[moves], width, height))
        strip = np.clip(strip, low, high)
        if copy.is_normal:
            strip[..., :3] = turned(strip[..., :3], jacobian, copy.down)
        moved = np.rint(strip * top) if top != 1.0 else strip
        out[part] = np.where(still[..., None], texture.pixels[part], moved.astype(out.dtype))

    # Numpy lets go of Python's lock in what takes the time here.
    with ThreadPoolExecutor(threads) as pool:
        try:
            for done in [pool.submit(strip_from, first) for first in range(0, height, _ROWS)]:
                done.result()
        except BaseException:
            pool.shutdown(cancel_futures=True)
            raise
    return out


def _footprint(jacobian: np.ndarray, width: int, height: int) -> np.ndarray:
    """(texels, 4): two axes (x, y), in texels and y down, over which samples are spread: what the redirection widens a
    texel by beyond the texel itself. The first is the longer one."""
    ratio = width / height
    a, b = jacobian[:, 0].astype(np.float64), jacobian[:, 1].astype(np.float64) * ratio
    c, d = jacobian[:, 2].astype(np.float64) / ratio, jacobian[:, 3].astype(np.float64)
    # The eigenvalues of J Jt, and of each what exceeds 1, as a root. Roots are the same on all machines, and angles are
    # not.
    xx, xy, yy = a * a + b * b, a * c + b * d, c * c + d * d
    mean, difference = (xx + yy) / 2, (xx - yy) / 2
    half = np.sqrt(difference * difference + xy * xy)
    long, short = np.sqrt(np.maximum(mean + half - 1, 0)), np.sqrt(np.maximum(mean - half - 1, 0))
    share = np.divide(difference, half, out=np.ones_like(half), where=half > 1e-12)
    cosine = np.sqrt(np.maximum(1 + share, 0) / 2)
    sine = np.copysign(np.sqrt(np.maximum(1 - share, 0) / 2), xy)
    return np.stack([long * cosine, -long * sine, short * sine, short * cosine], axis=-1)


def _sampled(padded: np.ndarray, x: np.ndarray, y: np.ndarray, axes: np.ndarray) -> np.ndarray:
    """(texels, channels) f32: the texture around (x, y), averaged over the footprint."""
    out = np.empty((len(x), padded.shape[2]), np.float32)
    counts = [_samples(np.sqrt(axes[:, k] ** 2 + axes[:, k + 1] ** 2)) for k in (0, 2)]
    # Texels with as many samples along both axes are averaged together.
    kinds = counts[0] * (_MOST_SAMPLES + 1) + counts[1]
    for kind in np.unique(kinds):
        chosen = np.flatnonzero(kinds == kind)
        n, m = divmod(int(kind), _MOST_SAMPLES + 1)
        for start in range(0, len(chosen), _AT_ONCE):
            texels = chosen[start : start + _AT_ONCE]
            px, py, spread = x[texels], y[texels], axes[texels]
            total = np.zeros((len(texels), out.shape[1]), np.float32)
            for along in (np.arange(n) + 0.5) / n - 0.5:
                for across in (np.arange(m) + 0.5) / m - 0.5:
                    shift_x = along * spread[:, 0] + across * spread[:, 2]
                    shift_y = along * spread[:, 1] + across * spread[:, 3]
                    total += interpolated(padded, px + shift_x, py + shift_y)
            out[texels] = total / np.float32(n * m)
    return out


def _samples(length: np.ndarray) -> np.ndarray:
    """Number of samples of a footprint of so many texels."""
    return np.where(length < 0.3, 1, np.minimum(_MOST_SAMPLES, 1 + np.ceil(length))).astype(np.int64)
