"""The options of `vrtm dilate` and `vrtm rigidity`."""

import functools
import math
import re
from argparse import ArgumentTypeError
from collections.abc import Callable
from typing import Any

from vrtm.bake.parsing import LARGEST, WELDS, fraction, normal_maps, not_negative, option, positive, whole

DILATION = """\
Writes copies of textures in which the surroundings of each chart show the surface beyond its seams, so that seams do
not show when a renderer filters. Texels in charts, and texels farther from seams, stay as they are."""

RIGIDITY = """\
Makes rigidity maps of pictures. Rigid are the bright parts of a texture, the parts of about one colour, or the parts
that stand out in a height map. One threshold holds for all tiles. Painted maps are not replaced."""


def add_dilate(commands: Any) -> None:
    parser = commands.add_parser("dilate", help="fill textures around charts, across seams", description=DILATION)
    parser.add_argument("scene", metavar="SCENE", help="The USD, Alembic or OBJ file.")
    add = functools.partial(option, parser)
    text = "Images of the texture; <UDIM> stands for the tile, <mesh> for the mesh."
    add("--texture", text, "PATTERN...")
    normal_maps(add)
    add("--out", "Write to this folder, under the names of the textures.", "DIR", required=True)
    text = "Fill texels up to this distance from seams, in UV, at most 0.5."
    add("--reach", text, "X", type=positive, default=1 / 16)
    add("--uv", "The UV set. Of several names each mesh takes the first that it has.", "NAME...")
    add("--rest", "The shape at rest: bind, pref, first, frame:N, or a file with the same faces.", "WHERE")
    text = "Faces are connected by their vertices, by equal positions, or not at all."
    add("--weld", text, choices=WELDS, default="index")
    _common(add)


def add_rigidity(commands: Any) -> None:
    parser = commands.add_parser("rigidity", help="make rigidity maps out of textures", description=RIGIDITY)
    parser.add_argument("image", metavar="IMAGE", help="A texture or a height map; <UDIM> stands for the tile.")
    add = functools.partial(option, parser)
    add("--out", "Write these maps, .png, .tif or .exr, with <UDIM> if IMAGE has it.", "IMAGE", required=True)
    text = "Rigid are the bright parts, the parts of about one colour, or the parts that stand out of their "
    text += "surroundings. With detail, what is drawn outside of the features of --and becomes grey."
    add("--from", text, dest="source", choices=("brightness", "colour", "height", "detail"), default="brightness")
    add("--and", "Add these rigidity maps, made or painted. Theirs is the size.", "IMAGE", dest="also")
    text = "The least brightness, or the least height above the surroundings as a part of the largest. By default the "
    text += "value that separates the texels best."
    add("--threshold", text, "X", type=fraction)
    add("--colour", "With --from colour, the colour as stored: '#cc994d' or 0.8,0.6,0.3.", "RGB", type=_colour)
    add("--tolerance", "With --from colour, the largest distance from it (0.2 by default).", "X", type=positive)
    add("--feature", "With --from height, the width of the largest feature (0.06 by default).", "UV", type=fraction)
    add("--sunken", "With --from height, sunken parts are rigid.", default=None)
    text = "With --from detail, the most grey (0.3 by default). From 0.5 on, grey would be a feature."
    add("--ceiling", text, "X", type=_grey)
    add("--cells", "With --from detail, cells of the solve per side (256 by default).", "N", type=whole(16, LARGEST))
    text = "With --from detail, the cells around features that stay elastic (4 by default)."
    add("--margin", text, "CELLS", type=not_negative)
    add("--normal-map", "With --from detail, the texture's normal map.", "IMAGE")
    text = "With --from detail, write a map for --mask of vrtm bake instead: detail is black, and keeps its place."
    add("--mask", text, default=None)
    add("--invert", "The other part is rigid.")
    add("--grow", "Add so many texels to the rigid parts, or remove them (-2).", "N", type=whole(-64, 64), default=0)
    add("--size", "Most texels of the maps per side.", "N", type=whole(16, LARGEST), default=1024)
    _common(add)


def _common(add: Callable[..., None]) -> None:
    add("--overwrite", "Also replace files that vrtm has not written.")
    add("--quiet", "Print nothing but warnings and errors.")


def _grey(text: str) -> float:
    if (value := fraction(text)) >= 0.5:
        raise ArgumentTypeError(f"'{text}' is not under 0.5")
    return value


def _colour(text: str) -> tuple[float, ...]:
    if re.fullmatch("#[0-9a-fA-F]{6}", text):
        return tuple(byte / 255 for byte in bytes.fromhex(text[1:]))
    try:
        red, green, blue = map(float, text.split(","))
    except ValueError:
        red = green = blue = math.nan
    if not math.isfinite(red + green + blue):
        raise ArgumentTypeError(f"'{text}' is no colour, such as '#cc994d' or 0.8,0.6,0.3")
    return red, green, blue
