"""OpenImageIO's st_warp: a texture that is warped offline, for programs that have no dependent lookup."""

import pathlib
import shlex
import shutil
import subprocess
import sys
import tempfile

import numpy as np
import OpenImageIO as oiio

import warp
from checks import check, document, run

folder = pathlib.Path(sys.argv[1])


def figures(a, b):
    # Not the outermost texels: st_warp reads nothing beyond an image's edge, where vrtm's maps clamp.
    worst = np.abs(a[..., :3] - b[..., :3]).max(-1)[2:-2, 2:-2] * 255
    return worst.mean(), np.percentile(worst, 99), worst.max()


def text(values):
    return "{:.2f} / {:.1f} / {:.0f} of 255".format(*values)


def warped():
    """The document's command, on a map of the texture's size."""
    command = document("OpenImageIO", "sh").strip()
    texture, exact = warp.read(folder / "texture.1002.png"), warp.Warp(folder / "warp.0001.1002.exr")
    truth, before = exact.texture(texture, factor=1), figures(texture, exact.texture(texture, factor=1))
    with tempfile.TemporaryDirectory() as place:
        place = pathlib.Path(place)
        warp.write(place / "albedo.1001.exr", texture)
        uv = exact.map(len(texture))
        warp.write(place / "redirect.1001.exr", np.concatenate([uv, np.zeros_like(uv[..., :1])], -1))
        for words, least, most in (command, 0, 0.5), (command.replace(":flip_t=1", ""), 50, 255):
            words = shlex.split(words)
            words[0] = shutil.which("oiiotool", path=str(pathlib.Path(sys.executable).parent)) or words[0]
            subprocess.run(words, cwd=place, check=True, capture_output=True, timeout=60)
            after = figures(warp.read(place / "warped.1001.exr"), truth)
            name = "t runs down" if least else "st_warp, filter triangle, flip_t"
            # The same bilinear filter on the same UVs in f32: what is left is rounding.
            check(f"oiio: {name}", least <= after[1] <= most, f"{text(after)}; unwarped {text(before)}")


def metadata():
    """That a file's texels are data is an attribute that OpenImageIO knows."""
    spec = oiio.ImageBuf(str(folder / "udim.1001.exr")).spec()
    space, names = spec.get_string_attribute("oiio:ColorSpace"), list(spec.channelnames)
    check("oiio: colour space data", (space, names) == ("data", ["R", "G", "B"]), f"{space!r}, channels {names}")


run(warped, metadata)
