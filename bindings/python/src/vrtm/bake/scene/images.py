"""Rigidity and mask maps from image files, through OpenImageIO."""

import contextlib
import glob
import os
import re
import unicodedata
from collections.abc import Iterator, Sequence

import numpy as np

from vrtm.bake import tokens
from vrtm.bake.scene.topology import luminance
from vrtm.bake.scene.types import SceneError, not_loaded
from vrtm.rigidity import light

try:
    import OpenImageIO as oiio
except ImportError as error:
    raise not_loaded(error, "images", "OpenImageIO", "bake", "OpenImageIO") from error

MOST = "VRTM_MAX_IMAGE"
"""The environment variable that says how many texels the sides of an image may have, if it is square."""
# The formats that vrtm takes as they are, and what numpy calls them; all others become f32.
KEPT = {"uint8": "uint8", "uint16": "uint16", "half": "float16", "float": "float32"}


def find_maps(
    pattern: str, mesh: str = "", udims: Sequence[int] = (1001,), subset: str = "", required: bool = True
) -> dict[int, str]:
    """The existing files of a pattern by UDIM number, `<UDIM>`, or another token of `tokens.tiled`, standing for the
    tile, `<mesh>` for the shape's name and `<subset>` for that of one of its subsets.

    A pattern without such a token is the map of a shape with one tile. One with `<mesh>` or `<subset>` may have no file
    for some of them, and so may any that is not `required`: then nothing is found. Raises SceneError if no file of
    another pattern exists, or if the shape has several tiles that the pattern does not tell apart.
    """
    named = pattern.replace("<mesh>", mesh).replace("<subset>", subset)
    if not tokens.has_tile(named):
        if len(udims) != 1:
            raise SceneError(f"{pattern}: the shape {mesh} has {len(udims)} tiles ({_listed(udims)}): write <UDIM>")
        paths = {udims[0]: named}
    else:
        paths = {udim: tokens.tiled(named, udim) for udim in udims}
        if len(set(paths.values())) < len(paths):
            raise SceneError(f"{pattern}: some of the tiles {_listed(udims)} have the same name: write <UDIM>")
    found = {udim: path for udim, name in sorted(paths.items()) if (path := _file(name)) is not None}
    if not found and required and "<mesh>" not in pattern and "<subset>" not in pattern:
        there = sorted(glob.glob(tokens.with_tiles(glob.escape(named), "*")))
        beside = f"; there is {there[0]}" if there else ""
        if re.search("[<>$%]", tokens.with_tiles(named, "")):
            beside = f"; the tokens of a tile are {tokens.TILES}"
        wanted = f" for the tiles {_listed(udims)} of {mesh}" if mesh else ""
        raise SceneError(f"{pattern}: no such file{wanted}{beside}")
    return found


def _file(path: str) -> str | None:
    """The file of a name; None if there is none. Letters with marks count as the same however they are put together:
    some file systems take them apart."""
    folder, name = os.path.split(path)
    forms = () if path.isascii() else ("NFC", "NFD")
    ways = [path, *(unicodedata.normalize(form, path) for form in forms)]
    ways += [os.path.join(folder, unicodedata.normalize(form, name)) for form in forms]
    return next(filter(os.path.isfile, ways), None)


def _listed(udims: Sequence[int]) -> str:
    return ", ".join(map(str, sorted(udims)))


def read_map(path: str) -> np.ndarray:
    """(height, width) of an image's first part, first row at the top: uint8, uint16, float16 or float32.

    Of several channels it is the one named Y, else the luminance of R, G and B (as f32 unless the image is
    grey all over), else R, else the first. Alpha does not count, values are not converted as colours, and what lies
    outside of the data window is 0. Raises SceneError.
    """
    spec, texels, _ = texels_of(path)
    return _whole(spec, _one_channel(list(spec.channelnames), texels))


def read_colours(path: str, linear: bool = False) -> np.ndarray:
    """(height, width, 3) f32 of an image's first part, first row at the top: its R, G and B as they are stored, but for
    integers, which are divided by their largest value; or three times the channel that read_map would take. `linear`:
    integers are sRGB, and become linear light. Raises SceneError."""
    spec, texels, _ = texels_of(path)
    short = _short(list(spec.channelnames))
    channels = [texels[..., short.index(c)] for c in "RGB" if c in short]
    if len(channels) < 3:
        channels = [_one_channel(list(spec.channelnames), texels)] * 3
    colours = np.stack([_whole(spec, channel) for channel in channels], -1)
    if linear and colours.dtype.kind == "u":
        colours = light(np.linspace(0, 1, np.iinfo(colours.dtype).max + 1)).astype(np.float32)[colours]
    else:
        colours = colours.astype(np.float32) / np.float32(white(texels.dtype))
    if not np.isfinite(colours).all():
        raise SceneError(f"{path}: holds texels that are no numbers")
    return colours


def white(dtype: np.dtype) -> float:
    """The number that stands for 1."""
    return float(np.iinfo(dtype).max) if dtype.kind == "u" else 1.0


@contextlib.contextmanager
def opened(path: str) -> Iterator[oiio.ImageInput]:
    """An open image, of which only the header is read yet; as painted, without colours being multiplied by their alpha.
    Raises SceneError for one that would not be read."""
    # Raises UnicodeEncodeError for what is no UTF-8.
    path.encode()
    # A pipe would be waited for.
    if os.path.exists(path) and not os.path.isfile(path):
        raise SceneError(f"{path}: is no file")
    config = oiio.ImageSpec()
    config.attribute("oiio:UnassociatedAlpha", 1)
    image = oiio.ImageInput.open(path, config)
    if image is None:
        raise SceneError(f"{path}: {said(oiio) or 'no such image'}")
    try:
        spec, most = image.spec(), _most()
        if spec.deep or spec.depth > 1:
            raise SceneError(f"{path}: a {'deep' if spec.deep else 'volume'} image")
        for width, height in ((spec.width, spec.height), (spec.full_width, spec.full_height)):
            if width * height * max(spec.nchannels, 4) > 4 * most**2:
                raise SceneError(
                    f"{path}: {width} x {height} texels of {spec.nchannels} channels: more than {most} x {most} of 4 "
                    f"are not read, unless the environment variable {MOST} is larger"
                )
        yield image
    except UnicodeDecodeError as error:
        raise SceneError(f"{path}: tells of itself in bytes that are no UTF-8") from error
    finally:
        image.close()


def said(source: object) -> str:
    """The last error of OpenImageIO, or of one of its images; none is left then."""
    try:
        return " ".join(source.geterror().split())
    except UnicodeDecodeError as wrong:
        # It quotes the file.
        return " ".join(wrong.object.decode(errors="backslashreplace").split())


def _most() -> int:
    given = os.environ.get(MOST, "16384")
    if not re.fullmatch("[1-9][0-9]{0,8}", given):
        raise SceneError(f"{MOST}: '{given}' is not a number of texels")
    return int(given)


def texels_of(path: str) -> tuple[oiio.ImageSpec, np.ndarray, str]:
    """The header, (height, width, channels) of the data window as it is stored, and the file's format. Raises
    SceneError."""
    with opened(path) as image:
        spec, form = image.spec(), image.format_name()
        kept = KEPT.get(str(spec.format))
        texels = image.read_image(0, 0, 0, spec.nchannels, spec.format if kept else oiio.FLOAT)
        if texels is None:
            raise SceneError(f"{path}: {said(image) or 'cannot be read'}")
    return spec, np.asarray(texels).reshape(spec.height, spec.width, spec.nchannels), form


def _short(names: list[str]) -> list[str]:
    """The last parts of names such as `rigidity.R`."""
    return [name.rsplit(".", 1)[-1] for name in names]


def _one_channel(names: list[str], texels: np.ndarray) -> np.ndarray:
    short = _short(names)
    if len(names) == 1 or "Y" in short:
        return texels[..., short.index("Y") if "Y" in short else 0]
    if all(letter in short for letter in "RGB"):
        colours = texels[..., [short.index(letter) for letter in "RGB"]]
        red = colours[..., 0]
        if all(np.array_equal(red, colours[..., other], equal_nan=red.dtype.kind == "f") for other in (1, 2)):
            return red
        return (luminance(colours.astype(np.float64)) / white(red.dtype)).astype(np.float32)
    return texels[..., short.index("R") if "R" in short else 0]


def _whole(spec: oiio.ImageSpec, texels: np.ndarray) -> np.ndarray:
    """The display window, of which the data window may cover a part, or more than all."""
    x, y = spec.x - spec.full_x, spec.y - spec.full_y
    if (x, y, spec.width, spec.height) == (0, 0, spec.full_width, spec.full_height):
        return np.ascontiguousarray(texels)
    whole = np.zeros((spec.full_height, spec.full_width), texels.dtype)
    to = np.s_[max(y, 0) : max(y + spec.height, 0), max(x, 0) : max(x + spec.width, 0)]
    part = texels[max(-y, 0) :, max(-x, 0) :]
    rows, columns = whole[to].shape
    whole[to] = part[:rows, :columns]
    return whole
