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
    texture, exact = warp.read(folder / "texture.1002.png"), warp.Warp(folder / "warp.1002.exr")
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
    """Checks the attribute by which OpenImageIO knows that a file's texels are data."""
    files = {"udim": "RGB", "udim_alpha": "RGBA", "redirect": "RGB", "delta": "RGB", "jacobian": "RGBA", "filter": "RGB"}
    for name, channels in files.items():
        spec = oiio.ImageBuf(str(folder / f"{name}.1001.exr")).spec()
        space, names = spec.get_string_attribute("oiio:ColorSpace"), "".join(spec.channelnames)
        check(f"oiio: {name} is data", (space, names) == ("data", channels), f"colour space {space!r}, channels {names}")


def values():
    """Every form beside the exact redirection; f32 rounds a UV by 6e-8, and one of tile 1002 by 1.2e-7."""
    for tile in 1001, 1002:
        exact = warp.Warp(folder / f"warp.{tile}.exr")
        truth, place = exact.map(256), warp.centres(256, 256)
        forms = ("redirect", truth), ("udim", truth + [tile - 1001, 0]), ("delta", truth - place), ("udim_alpha", truth + [tile - 1001, 0])
        for name, expected in forms:
            error = np.abs(warp.read(folder / f"{name}.{tile}.exr")[..., :2] - expected).max()
            check(f"oiio: {name} of {tile}", error < 5e-7, f"largest error {error:.1e}")
        largest = np.linalg.svd(exact.map(256, jacobian=True).reshape(256, 256, 2, 2), compute_uv=False)[..., 0]
        error = np.abs(warp.read(folder / f"filter.{tile}.exr") / largest[..., None] - 1)
        # On a border of two triangles either one's derivative will do.
        check(f"oiio: filter scale of {tile}", np.percentile(error, 99) < 1e-3, f"99 % off by {np.percentile(error, 99):.1e}")


run(warped, metadata, values)
