"""Images that record what they were made of: EXR, PNG and TIFF through OpenImageIO, the same bytes for the same
content."""

import contextlib
import json
import os
from collections.abc import Mapping
from dataclasses import dataclass, field

import numpy as np
import OpenImageIO as oiio

from vrtm.bake import mip_levels, overwrite, staging
from vrtm.bake.failure import INPUT, Failure, unwritable
from vrtm.bake.fingerprint import Fingerprint
from vrtm.bake.scene.images import KEPT, said

_TYPES = {ours: theirs for theirs, ours in KEPT.items()}
_PIXELS = "vrtm:pixels"
_FIGURES = "vrtm:figures"
# TIFF has no attributes of one's own: there they are JSON in the description.
_DESCRIPTION = "ImageDescription"
# Blender and OpenImageIO take the first for the colour space. No chromaticities: a program that reads those converts
# the numbers like colours. Edges are clamped where the wrap mode is read.
DATA = {"colorInteropID": ("string", "data"), "oiio:ColorSpace": ("string", "data"), "wrapmodes": ("string", "clamp")}
"""Attributes of images that are no colours."""
_PNG_END = b"\0\0\0\0IEND\xaeB`\x82"


@dataclass(frozen=True)
class Target:
    """A file as it should be, less its pixels."""

    path: str
    width: int
    """0, and so the height, while that is not known: a file of any size is up to date then."""
    height: int
    channels: tuple[str, ...]
    dtype: str
    """As numpy names it: uint8, uint16, float16 or float32."""
    facts: Mapping[str, str | int]
    """Statements of the file about itself, by names that begin with `vrtm:`; `vrtm:inputs` is the hash of its
    inputs."""
    attributes: Mapping[str, tuple[str, object]] = field(default_factory=dict)
    """Further attributes as OpenImageIO names them: types and values."""
    format: str = "openexr"
    """OpenImageIO's name of the file format."""
    alpha: int = -1
    """The channel that covers, -1: none does."""
    has_levels: bool = False
    """True for a texture that is tiled, with mip levels."""


def write(target: Target, pixels: np.ndarray, figures: Mapping[str, object] | None = None) -> None:
    """Writes (height, width, channels) pixels, the first row at the top. `figures` is kept for later runs, too. The
    file appears complete or not at all. Raises Failure."""
    spec = oiio.ImageSpec(target.width, target.height, len(target.channels), _TYPES[target.dtype])
    spec.channelnames = target.channels
    spec.alpha_channel = target.alpha
    # OpenImageIO would put in the time of writing.
    further = {"compression": ("string", "zip"), "DateTime": ("string", "")}
    for name, (kind, value) in (further | dict(target.attributes)).items():
        spec.attribute(name, kind, value)
    facts = dict(target.facts)
    if figures is not None:
        facts[_FIGURES] = json.dumps(figures, sort_keys=True)
    facts[_PIXELS] = _digest(pixels, facts)
    if target.format == "tiff":
        spec.attribute(_DESCRIPTION, json.dumps(facts, sort_keys=True))
    else:
        for name, value in facts.items():
            # PNG keeps texts alone.
            number = isinstance(value, int) and target.format == "openexr"
            spec.attribute(name, "int" if number else "string", value if number else str(value))

    def body(temporary: str) -> None:
        packed = np.ascontiguousarray(pixels)
        if target.has_levels:
            mip_levels.write(temporary, target.format, spec, packed)
            return
        # By the format's name, because the temporary name has no ending.
        out = oiio.ImageOutput.create(target.format)
        if out is None:
            raise OSError(said(oiio))
        if not (out.open(temporary, spec) and out.write_image(packed) and out.close()):
            raise OSError(said(out))

    try:
        # A closed image may lack its last bytes.
        staging.write(target.path, body, is_whole=_is_whole)
    except OSError as error:
        overwrite.remove_damaged(target.path, _read)
        raise unwritable(target.path, error) from error


def up_to_date(target: Target, replace: bool = False) -> dict | None:
    """The figures that a file records ({} if none), or None if it is missing, damaged, or made of other inputs. All its
    pixels are read: their hash stands in the file. One of vrtm's own that is damaged is taken away, so that no program
    takes it for an image even if no other can be written in its place. Raises Failure for one that can be read and has
    other pixels, which somebody has painted, unless it may be replaced."""
    if not os.path.isfile(target.path):
        return None
    found = _read(target.path)
    if found is None:
        overwrite.remove_damaged(target.path, _read)
        return None
    spec, facts, digest = found
    if facts.get(_PIXELS, digest) != digest:
        if replace:
            return None
        reason = "its pixels, or its figures, are not those that vrtm wrote: --overwrite replaces it"
        raise Failure(INPUT, f"{target.path}: {reason}")
    if (
        # One without is another program's, or of another of vrtm's programs.
        _PIXELS not in facts
        or (target.width and (spec.width, spec.height) != (target.width, target.height))
        or (spec.nchannels, str(spec.format)) != (len(target.channels), _TYPES[target.dtype])
        or (target.format == "openexr" and tuple(spec.channelnames) != target.channels)
        or any(str(facts.get(name)) != str(value) for name, value in target.facts.items())
    ):
        return None
    try:
        return json.loads(facts.get(_FIGURES, "{}"))
    except (ValueError, TypeError):
        return None


def told(path: str) -> dict:
    """Statements of an image of vrtm about itself, but for a TIFF; its pixels are not read. Empty if there is none."""
    file = oiio.ImageInput.open(path) if os.path.isfile(path) else None
    if file is None:
        said(oiio)
        return {}
    try:
        return {} if file.format_name() == "tiff" else _facts(file.spec(), file.format_name())
    except ValueError:
        # Bytes that are no UTF-8.
        return {}
    finally:
        file.close()


def remove(path: str, mesh: str) -> bool:
    """Takes an image of a mesh away that vrtm has written, and nobody has changed; tells whether there is none now."""
    if not os.path.lexists(path):
        return True
    found = _read(path) if os.path.isfile(path) else None
    if found is None or found[1].get(_PIXELS) != found[2] or found[1].get("vrtm:mesh") != mesh:
        return False
    with contextlib.suppress(OSError):
        os.remove(path)
    return not os.path.lexists(path)


def _is_whole(path: str) -> bool:
    found = _read(path)
    return found is not None and found[1].get(_PIXELS) == found[2]


def _read(path: str) -> tuple[oiio.ImageSpec, dict, str] | None:
    """The header of an image, what it tells of itself, and the hash of its pixels and figures; None if it is damaged:
    compressed pixels have checksums in all three formats."""
    # As it is stored: not multiplied by what may be alpha.
    config = oiio.ImageSpec()
    config.attribute("oiio:UnassociatedAlpha", 1)
    file = oiio.ImageInput.open(path, config)
    if file is None:
        said(oiio)
        return None
    try:
        spec = file.spec()
        facts = _facts(spec, file.format_name())
        pixels = file.read_image(spec.format)
        if pixels is None:
            said(file)
            return None
        digest = _digest(np.asarray(pixels).reshape(spec.height, spec.width, -1), facts)
        is_whole = file.format_name() != "png" or _ends(path)
        if is_whole and spec.tile_width and facts.get(_PIXELS) == digest:
            is_whole = mip_levels.are_whole(file)
        return (spec, facts, digest) if is_whole else None
    except (OSError, ValueError, TypeError):
        return None
    finally:
        file.close()


def _ends(path: str) -> bool:
    """True if a PNG has its last chunk: its pixels can be read without."""
    with open(path, "rb") as file:
        file.seek(-len(_PNG_END), os.SEEK_END)
        return file.read() == _PNG_END


def _facts(spec: oiio.ImageSpec, form: str) -> dict:
    if form == "tiff":
        return dict(json.loads(spec.get_string_attribute(_DESCRIPTION)))
    return {a.name: a.value for a in spec.extra_attribs if a.name.startswith("vrtm:")}


def _digest(pixels: np.ndarray, facts: Mapping[str, object]) -> str:
    """A hash of the pixels, and of the figures that are told of them."""
    return Fingerprint().array(pixels).text(facts.get(_FIGURES, "")).hex()
