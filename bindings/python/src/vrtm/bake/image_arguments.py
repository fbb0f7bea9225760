"""The options of `vrtm dilate` and `vrtm rigidity`."""

from __future__ import annotations

import math
import re
from argparse import ArgumentParser, ArgumentTypeError
from typing import Any

from vrtm.bake.parsing import LARGEST, WELDS, flag, fraction, normal_maps, positive, several, whole

DILATION = """\
Writes copies of textures that hold, around each chart, what the surface shows beyond the chart's seams, so that seams
do not show when a renderer filters. What lies in charts, and farther from seams, stays as it is."""

RIGIDITY = """\
Makes rigidity maps out of pictures: what is bright in a texture, has about a colour, or stands out of its surroundings
in a height map is rigid. One threshold holds for all tiles. A map that somebody has painted on is not replaced."""


def add_dilate(commands: Any) -> None:
    """Adds the subcommand `dilate`."""
    parser = commands.add_parser("dilate", help="fill textures around charts, across seams", description=DILATION)
    parser.add_argument("scene", metavar="SCENE", help="a USD, Alembic or OBJ file")
    several(parser, "--texture", "PATTERN", "images; <UDIM> stands for the tile, <mesh> for the mesh's name")
    normal_maps(parser)
    parser.add_argument("--out", required=True, metavar="DIR", help="where to write, under the textures' own names")
    parser.add_argument(
        "--reach", type=positive, default=1 / 16, metavar="X", help="how far from seams, in UV, at most 0.5 (0.0625)"
    )
    several(parser, "--uv", "NAME", "as for bake")
    parser.add_argument("--rest", metavar="WHERE", help="as for bake")
    parser.add_argument("--weld", choices=WELDS, default="index", help="by what faces hang together (index)")
    _common(parser)


def add_rigidity(commands: Any) -> None:
    """Adds the subcommand `rigidity`."""
    parser = commands.add_parser("rigidity", help="make rigidity maps out of textures", description=RIGIDITY)
    parser.add_argument("image", metavar="IMAGE", help="a texture or a height map; <UDIM> stands for the tile")
    parser.add_argument(
        "--out", required=True, metavar="IMAGE", help="the maps, .png, .tif or .exr, with <UDIM> if IMAGE has it"
    )
    parser.add_argument(
        "--from",
        dest="source",
        choices=("brightness", "colour", "height"),
        default="brightness",
        help="what is rigid: what is bright (the default), has about a colour, or stands out of its surroundings",
    )
    parser.add_argument(
        "--threshold",
        type=fraction,
        metavar="X",
        help="the least brightness, or the least height above the surroundings as a part of the largest (default: what "
        "parts them best)",
    )
    parser.add_argument(
        "--colour", type=_colour, metavar="RGB", help="with --from colour: '#cc994d' or 0.8,0.6,0.3, as stored"
    )
    parser.add_argument("--tolerance", type=positive, metavar="X", help="with --from colour: how far from it (0.2)")
    parser.add_argument(
        "--feature", type=fraction, metavar="UV", help="with --from height: the width of the largest feature (0.06)"
    )
    parser.add_argument(
        "--sunken", action="store_true", default=None, help="with --from height: what lies deeper is rigid"
    )
    flag(parser, "--invert", "the other part is rigid")
    parser.add_argument(
        "--grow", type=whole(-64, 64), default=0, metavar="N", help="texels by which what is rigid becomes larger (0)"
    )
    parser.add_argument(
        "--size", type=whole(16, LARGEST), default=1024, metavar="N", help="texels per side at most (1024)"
    )
    _common(parser)


def _common(parser: ArgumentParser) -> None:
    flag(parser, "--overwrite", "replace files that vrtm has not written, too")
    flag(parser, "--quiet", "print errors and warnings only")


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
