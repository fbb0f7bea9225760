"""Images that record what they were made of: EXR, PNG and TIFF through OpenImageIO, the same bytes for the same
content."""

from __future__ import annotations

import json
from collections.abc import Mapping
from dataclasses import dataclass, field

import numpy as np
import OpenImageIO as oiio

from vrtm.bake import staging
from vrtm.bake.failure import INPUT, Failure, one_line
from vrtm.bake.fingerprint import Fingerprint

_PIXELS = "vrtm:pixels"
_FIGURES = "vrtm:figures"
# TIFF has no attributes of one's own: there they are JSON in the description.
_DESCRIPTION = "ImageDescription"


@dataclass(frozen=True)
class Target:
    """A file as it should be, less its pixels."""

    path: str
    width: int
    height: int
    channels: tuple[str, ...]
    dtype: str
    """As numpy names it: uint8, uint16, float16 or float32."""
    facts: Mapping[str, str | int]
    """What the file tells of itself, by names that begin with `vrtm:`; `vrtm:inputs` is the hash of its inputs."""
    attributes: Mapping[str, tuple[str, object]] = field(default_factory=dict)
    """Further attributes as OpenImageIO names them: types and values."""
    format: str = "openexr"
    """OpenImageIO's name of the file format."""
    alpha: int = -1
    """The channel that covers, -1: none does."""


def write(target: Target, pixels: np.ndarray, figures: Mapping[str, object] | None = None) -> None:
    """Writes (height, width, channels) pixels, the first row at the top. `figures` is kept for later runs, too. The
    file appears complete or not at all. Raises Failure."""
    spec = _spec(target)
    facts = dict(target.facts) | {_PIXELS: _digest(pixels)}
    if figures is not None:
        facts[_FIGURES] = json.dumps(figures, sort_keys=True)
    if target.format == "tiff":
        spec.attribute(_DESCRIPTION, json.dumps(facts, sort_keys=True))
    else:
        for name, value in facts.items():
            # PNG keeps texts alone.
            number = isinstance(value, int) and target.format == "openexr"
            spec.attribute(name, "int" if number else "string", value if number else str(value))

    def body(temporary: str) -> None:
        # By the format's name: the temporary name does not tell it.
        out = oiio.ImageOutput.create(target.format)
        if out is None:
            raise OSError(oiio.geterror())
        packed = np.ascontiguousarray(pixels)
        if not (out.open(temporary, spec) and out.write_image(packed) and out.close()):
            raise OSError(out.geterror())

    try:
        staging.write(target.path, body)
    except OSError as error:
        raise Failure(INPUT, f"{target.path}: {one_line(error.strerror or error)}") from error


def up_to_date(target: Target) -> dict | None:
    """The figures that a file records ({} if none), or None if it is missing, damaged, or made of other inputs. All its
    pixels are read: their hash stands in the file."""
    # As it is stored: not multiplied by what may be alpha.
    config = oiio.ImageSpec()
    config.attribute("oiio:UnassociatedAlpha", 1)
    file = oiio.ImageInput.open(target.path, config)
    if file is None:
        oiio.geterror()
        return None
    try:
        spec = file.spec()
        facts = _facts(spec, target)
        shape = (spec.width, spec.height, spec.nchannels, str(spec.format), file.format_name())
        if shape != (target.width, target.height, len(target.channels), _type(target.dtype), target.format):
            return None
        if target.format == "openexr" and tuple(spec.channelnames) != target.channels:
            return None
        if any(facts.get(name) != value for name, value in target.facts.items()):
            return None
        pixels = file.read_image(_type(target.dtype))
        if pixels is None or facts.get(_PIXELS) != _digest(np.asarray(pixels).reshape(spec.height, spec.width, -1)):
            file.geterror()
            return None
        return json.loads(facts.get(_FIGURES, "{}"))
    except (ValueError, TypeError):
        return None
    finally:
        file.close()


def _spec(target: Target) -> oiio.ImageSpec:
    spec = oiio.ImageSpec(target.width, target.height, len(target.channels), _type(target.dtype))
    spec.channelnames = target.channels
    spec.alpha_channel = target.alpha
    spec.attribute("compression", "zip")
    # OpenImageIO would put in the time of writing.
    spec.attribute("DateTime", "string", "")
    for name, (kind, value) in target.attributes.items():
        spec.attribute(name, kind, value)
    return spec


def _facts(spec: oiio.ImageSpec, target: Target) -> dict:
    if target.format == "tiff":
        return dict(json.loads(spec.get_string_attribute(_DESCRIPTION)))
    facts = {a.name: a.value for a in spec.extra_attribs if a.name.startswith("vrtm:")}
    wanted = target.facts
    return {n: int(v) if isinstance(wanted.get(n), int) and isinstance(v, str) else v for n, v in facts.items()}


def _digest(pixels: np.ndarray) -> str:
    return Fingerprint().array(pixels).hex()


def _type(dtype: str) -> str:
    return {"float16": "half", "float32": "float"}.get(dtype, dtype)
