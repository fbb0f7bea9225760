"""Textures as renderers read them in parts: tiled, with mip levels, by OpenImageIO's maketx."""

import os
import tempfile

import numpy as np
import OpenImageIO as oiio

from vrtm.bake.scene.images import said

ENDINGS = (".tx", ".tex")
"""Of names of such files, be they tiled or not."""
_OF_FILE = "openexr:.*|tiff:.*|oiio:(subimages|miplevels)"
"""Attributes that a file gets as it is written."""


def are_in(path: str, spec: oiio.ImageSpec) -> bool:
    """True for a texture of this kind, by its name and header."""
    return path.lower().endswith(ENDINGS) or spec.get_int_attribute("oiio:miplevels", 1) > 1


def write(path: str, form: str, spec: oiio.ImageSpec, pixels: np.ndarray) -> None:
    """Writes an image with its levels. `form`: OpenImageIO's name of the file format. Raises OSError."""
    image = oiio.ImageBuf(spec)
    image.set_pixels(spec.roi, pixels)
    config = oiio.ImageSpec()
    config.set_format(spec.format)
    config.attribute("wrapmodes", spec.get_string_attribute("wrapmodes", "black,black"))
    config.attribute("maketx:fileformatname", form)
    for further in ("hash", "compute_average"):
        config.attribute(f"maketx:{further}", 0)
    with tempfile.TemporaryDirectory(prefix="vrtm-") as folder:
        made = os.path.join(folder, "made")
        if not oiio.ImageBufAlgo.make_texture(oiio.MakeTxTexture, image, made, config):
            raise OSError(said(oiio))
        _copy(made, path, form)


def are_whole(file: oiio.ImageInput) -> bool:
    """True if all levels of an open image can be read."""
    spec = file.spec()
    last = max(spec.width, spec.height).bit_length() - 1
    return all(file.read_image(0, level, 0, spec.nchannels, spec.format) is not None for level in range(1, last + 1))


def _copy(made: str, path: str, form: str) -> None:
    """Copies all levels, without the time of writing, which maketx puts in."""
    config = oiio.ImageSpec()
    config.attribute("oiio:UnassociatedAlpha", 1)
    source, out, level = oiio.ImageInput.open(made, config), oiio.ImageOutput.create(form), 0
    if source is None or out is None:
        raise OSError(said(oiio))
    further = "AppendMIPLevel" if out.supports("mipmap") else "AppendSubimage"
    while source.seek_subimage(0, level):
        spec = source.spec()
        spec.erase_attribute(_OF_FILE)
        spec.attribute("DateTime", "string", "")
        pixels = source.read_image(0, level, 0, spec.nchannels, spec.format)
        if pixels is None:
            raise OSError(said(source))
        if not (out.open(path, spec, further if level else "Create") and out.write_image(pixels)):
            raise OSError(said(out))
        level += 1
    source.close()
    if not out.close():
        raise OSError(said(out))
