"""The options of `vrtm bake`."""

from __future__ import annotations

import argparse
import math
import re
from collections.abc import Callable
from typing import Any, NoReturn

from vrtm.bake import frames
from vrtm.bake.scene import SceneOptions
from vrtm.bake.scene.timing import FILE
from vrtm.bake.settings import AUTO, EACH, OVERLAP, Settings
from vrtm.bake.words import near

DESCRIPTION = """\
Bakes redirection maps: where to sample the texture, per frame and tile, so that painted features keep their shape
while the mesh under them deforms. Reads USD, Alembic and OBJ. A file that is up to date is left alone, so that a bake
which was ended goes on where it stopped."""

EPILOG = """\
exit codes: 0 done; 2 a file or an option cannot be used; 3 done, but --max-strain or --max-error was exceeded, or the
layer redirects nothing; 4 the device is missing or lost, or memory is short; 128 + the signal's number if it was ended
(130 Ctrl-C, 143 SIGTERM); 1 an error of vrtm itself."""

DILATION = """\
Writes copies of textures that hold, around each chart, what the surface shows beyond the chart's seams, so that seams
do not show when a renderer filters. What lies in charts, and farther from seams, stays as it is."""

RIGIDITY = """\
Makes rigidity maps out of pictures: what is bright in a texture, has about a colour, or stands out of its surroundings
in a height map is rigid. One threshold holds for all tiles. A map that somebody has painted on is not replaced."""

LARGEST = 65536
WELDS = ("index", "position", "off")


class Parser(argparse.ArgumentParser):
    """Says in one line what is wrong."""

    def __init__(self, *arguments: Any, **options: Any) -> None:
        super().__init__(*arguments, **options)
        # A list of frames that begins with a minus sign is no option.
        self._negative_number_matcher = re.compile(r"-\d[\d.,:x\s-]*")

    def error(self, message: str) -> NoReturn:
        unknown, found = re.match(r"unrecognized arguments: (--[^\s=]+)", message), ""
        if unknown:
            commands = (a for a in self._actions if isinstance(a, argparse._SubParsersAction))
            parsers = [self, *(parser for action in commands for parser in action.choices.values())]
            found = near(unknown[1], {name for parser in parsers for name in parser._option_string_actions})
        self.exit(2, f"{self.prog}: {message}{found} (see {self.prog} --help)\n")


def add_to(commands: Any) -> argparse.ArgumentParser:
    """Adds the subcommand `bake`."""
    parser = commands.add_parser("bake", help="bake redirection maps", description=DESCRIPTION, epilog=EPILOG)
    _scene(parser.add_argument_group("scene"))
    _maps(parser.add_argument_group("what is rigid"))
    _files(parser.add_argument_group("files"))
    _content(parser.add_argument_group("content"))
    _borders(parser.add_argument_group("borders"))
    _material(parser.add_argument_group("material"))
    _layer(parser.add_argument_group("USD layer"))
    _work(parser.add_argument_group("work"))
    _messages(parser.add_argument_group("messages"))
    return parser


def add_dilate_to(commands: Any) -> None:
    """Adds the subcommand `dilate`."""
    parser = commands.add_parser("dilate", help="fill textures around charts, across seams", description=DILATION)
    parser.add_argument("scene", metavar="SCENE", help="a USD, Alembic or OBJ file")
    parser.add_argument(
        "--texture",
        nargs="+",
        action="extend",
        default=[],
        metavar="PATTERN",
        help="images; <UDIM> stands for the tile, <mesh> for the mesh's name",
    )
    _normal_maps(parser)
    parser.add_argument("--out", required=True, metavar="DIR", help="where to write, under the textures' own names")
    parser.add_argument(
        "--reach", type=_positive, default=1 / 16, metavar="X", help="how far from seams, in UV, at most 0.5 (0.0625)"
    )
    parser.add_argument("--uv", nargs="+", action="extend", default=[], metavar="NAME", help="as for bake")
    parser.add_argument("--rest", metavar="WHERE", help="as for bake")
    parser.add_argument("--weld", choices=WELDS, default="index", help="by what faces hang together (index)")
    parser.add_argument("--overwrite", action="store_true", help="replace files that vrtm has not written, too")
    parser.add_argument("--quiet", action="store_true", help="print errors and warnings only")


def add_rigidity_to(commands: Any) -> None:
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
        type=_fraction,
        metavar="X",
        help="the least brightness, or the least height above the surroundings as a part of the largest (default: what "
        "parts them best)",
    )
    parser.add_argument(
        "--colour", type=_colour, metavar="RGB", help="with --from colour: '#cc994d' or 0.8,0.6,0.3, as stored"
    )
    parser.add_argument("--tolerance", type=_positive, metavar="X", help="with --from colour: how far from it (0.2)")
    parser.add_argument(
        "--feature", type=_fraction, metavar="UV", help="with --from height: the width of the largest feature (0.06)"
    )
    parser.add_argument(
        "--sunken", action="store_true", default=None, help="with --from height: what lies deeper is rigid"
    )
    parser.add_argument("--invert", action="store_true", help="the other part is rigid")
    parser.add_argument(
        "--grow", type=_whole(-64, 64), default=0, metavar="N", help="texels by which what is rigid becomes larger (0)"
    )
    parser.add_argument(
        "--size", type=_whole(16, LARGEST), default=1024, metavar="N", help="texels per side at most (1024)"
    )
    parser.add_argument("--overwrite", action="store_true", help="replace files that vrtm has not written, too")
    parser.add_argument("--quiet", action="store_true", help="print errors and warnings only")


def _scene(group: argparse._ArgumentGroup) -> None:
    group.add_argument("scene", metavar="SCENE", help="a USD, Alembic or OBJ file")
    group.add_argument(
        "--poses",
        nargs="+",
        action="extend",
        default=[],
        metavar="FILE",
        help="OBJ: the poses, as files or patterns (pose.####.obj, pose.%%04d.obj, pose.$F4.obj, pose.<frame>.obj, "
        "pose.*.obj)",
    )
    group.add_argument(
        "--meshes",
        nargs="+",
        action="extend",
        default=[],
        metavar="NAME",
        help="names or prim paths, with * wildcards (default: all meshes that have UVs)",
    )
    group.add_argument(
        "--uv",
        nargs="+",
        action="extend",
        default=[],
        metavar="NAME",
        help="the UV set; of several names, also with commas between them, each mesh takes the first that it has "
        "(default: st, or the only one)",
    )
    group.add_argument(
        "--texture-uv",
        metavar="NAME",
        help="USD: the UV set that textures are looked up by, where --uv is one without overlaps: the maps then hold "
        "UVs of this set, and are looked up by that of --uv",
    )
    group.add_argument(
        "--subsets",
        action="store_true",
        help="USD: bake the subsets of a mesh that materials are bound to each by itself, and the faces in none of "
        "them as 'rest': for materials that use the same UVs; give <subset> in --rigidity",
    )
    group.add_argument(
        "--rest",
        metavar="WHERE",
        help="the rest shape: bind, pref, first, frame:N, or a file with the same faces (default: the scene's own)",
    )
    group.add_argument("--subdivide", type=_whole(0, 8), default=0, metavar="N", help="levels of subdivision (0)")
    group.add_argument(
        "--population-mask", nargs="+", action="extend", default=[], metavar="PRIM", help="USD: load these prims only"
    )
    group.add_argument(
        "--variant",
        nargs=3,
        action="append",
        default=[],
        metavar=("PRIM", "SET", "SELECTION"),
        help="USD: select a variant; may be given several times",
    )
    group.add_argument(
        "--fps",
        type=lambda text: text if text == FILE else _positive(text),
        metavar="X",
        help="frames per second: frame N is at N / X seconds. file: as the file says, in USD by framesPerSecond "
        "(default: whole time codes of USD are frames; Alembic: file)",
    )
    group.add_argument(
        "--world",
        action="store_true",
        help="with the transforms above a mesh: what an animated scale stretches is stretched (the rest has those of "
        "its frame, or of the first)",
    )
    group.add_argument(
        "--allow-units",
        action="store_true",
        help="take poses that are larger or smaller than the rest as a whole for deformations: the rest is not "
        "scaled, and a factor of 10 does not end the bake",
    )


def _maps(group: argparse._ArgumentGroup) -> None:
    where = "<UDIM> stands for the tile, <mesh> for the mesh's name, <subset> for that of --subsets"
    group.add_argument("--rigidity", metavar="PATTERN", help=f"images, white = rigid; {where}")
    group.add_argument("--mask", metavar="PATTERN", help="images; what is dark does not move")
    group.add_argument(
        "--strict",
        action="store_true",
        help="exit code 2 if anything is not baked that no option leaves out, and that would not stay as it is",
    )
    group.add_argument("--rigidity-primvar", metavar="NAME", help="a primvar in place of images ('colors' in OBJ)")
    group.add_argument("--mask-primvar", metavar="NAME", help="a primvar in place of images")


def _files(group: argparse._ArgumentGroup) -> None:
    group.add_argument("--out", default="out", metavar="DIR", help="where to write (out)")
    group.add_argument(
        "--name",
        metavar="PATTERN",
        help="names below --out, with <mesh>, <subset>, <kind>, <frame> and <UDIM> (default: "
        "<kind>.<frame>.<UDIM>.exr, and before it <mesh>. if there are several, and <subset>. with --subsets)",
    )
    group.add_argument(
        "--frames",
        type=_numbers,
        metavar="LIST",
        help="such as 1-10x2,15 or -3--1, or with parts of frames 1-3x0.5 (default: all whole ones)",
    )
    group.add_argument("--tiles", type=_whole_numbers, metavar="LIST", help="such as 1001,1011-1013 (default: all)")
    group.add_argument("--force", action="store_true", help="also write files that are up to date")
    group.add_argument(
        "--overwrite",
        action="store_true",
        help="replace files that vrtm has not written, too; one that the bake reads is never replaced",
    )


def _content(group: argparse._ArgumentGroup) -> None:
    group.add_argument(
        "--size",
        type=_whole(1, LARGEST),
        metavar="N",
        help="cells of the grid per side (default: the rigidity map's; 1024 with a primvar)",
    )
    group.add_argument(
        "--map-size",
        type=_size,
        metavar="N",
        help="texels per side (the grid's); auto: per tile and frame the least that keeps --max-error (1 if that is "
        "not given), or what comes closest to it",
    )
    group.add_argument(
        "--form",
        choices=("tile", "udim", "delta"),
        help="the UVs in the map: within the tile, among all UDIM tiles, or what to add to the mesh's own "
        "(tile; with --layer, udim)",
    )
    group.add_argument(
        "--half",
        action="store_true",
        help="numbers of 16 bits, for --form delta: the smallest maps, two fifths of the bytes",
    )
    group.add_argument("--alpha", action="store_true", help="RGBA, with 1 in A where a chart covers the texel")
    group.add_argument(
        "--sheet",
        action="store_true",
        help="also draw a picture per mesh, to judge by: its worst frame at rest, with its own UVs, and redirected",
    )
    group.add_argument("--exact", action="store_true", help="do not move values next to folds")
    group.add_argument("--warp", action="store_true", help="also write the warp, the redirection's inverse")
    group.add_argument("--jacobian", action="store_true", help="also write the redirection's derivatives")
    group.add_argument("--filter-scale", action="store_true", help="also write how much wider a filter has to be")
    group.add_argument(
        "--texture",
        nargs="+",
        action="extend",
        default=[],
        metavar="PATTERN",
        dest="textures",
        help="also write warped copies of these textures, for renderers without dependent lookups",
    )
    _normal_maps(group)


def _borders(group: argparse._ArgumentGroup) -> None:
    group.add_argument(
        "--seams",
        choices=("shut", "keep", "continue"),
        default="shut",
        help="at seams nothing moves (shut); or features that touch one stay as they are, whole (keep); or they keep "
        "their shape across it: textures that renderers look up by the maps then have to be dilated (vrtm dilate)",
    )
    group.add_argument(
        "--seam-reach",
        type=_positive,
        default=0.0,
        metavar="UV",
        help="how far charts go on beyond their seams: the radius of the largest feature on one, at most 0.5 (0.03125)",
    )
    group.add_argument(
        "--open-borders",
        choices=("fixed", "slide"),
        default="fixed",
        help="at borders beyond which the surface ends nothing moves (fixed), or textures slide along them, so that "
        "features there keep their shape",
    )
    group.add_argument(
        "--overlap",
        type=lambda text: "first" if text == "first_face" else text,
        choices=(EACH, "fixed", "first"),
        default=OVERLAP,
        help="of charts that lie over one another, as mirrored halves do, each gets maps of its own, in layers (each); "
        f"or nothing moves there (fixed); or the chart of the first face moves all (first) ({OVERLAP})",
    )
    group.add_argument(
        "--max-layers",
        type=_whole(2, LARGEST),
        metavar="N",
        help=f"with --overlap each: the most layers that a tile may have ({Settings.max_layers})",
    )


def _material(group: argparse._ArgumentGroup) -> None:
    for name, text in (
        ("smoothness", "how stiff elastic material is, against 1 for rigid material (0.02)"),
        ("smoothness-floor", "how stiff all material is in addition (0.0005)"),
        ("orientation", "how strongly rigid features are kept from turning (0)"),
        ("orientation-density", "an addition to that where they are dense (0)"),
        ("room", "how strongly cells are kept from losing their area (0.3)"),
        ("room-threshold", "the fraction of a cell's area under which that starts (0.4)"),
        ("protect", "how far features that a pose does not strain come before the others, 0 to 1 (0)"),
    ):
        group.add_argument(f"--{name}", type=_not_negative, metavar="X", help=text)


def _normal_maps(to: argparse._ActionsContainer) -> None:
    to.add_argument(
        "--normal-map",
        nargs="+",
        action="extend",
        default=[],
        metavar="PATTERN",
        dest="normal_maps",
        help="the same for normal maps in tangent space, whose normals are turned along",
    )
    to.add_argument(
        "--normal-y",
        choices=("up", "down"),
        default="up",
        help="whether green grows with v in these (up, as in OpenGL) or against it (down, as in DirectX)",
    )


def _layer(group: argparse._ArgumentGroup) -> None:
    group.add_argument("--layer", metavar="FILE", help="write a USD layer to be sublayered over the shot; '' for none")
    group.add_argument(
        "--layer-mode",
        choices=("texture", "primvar", "both"),
        default="texture",
        help="redirect the materials' texture lookups (default), author a primvar st_redirected, or both",
    )
    group.add_argument("--only-layer", action="store_true", help="write nothing but the layer")
    group.add_argument(
        "--root",
        metavar="FILE",
        help="with --layer: also write a layer to open by itself: the layer over the shot, with the shot's time codes, "
        "axis and units",
    )
    group.add_argument(
        "--freeze",
        type=_number,
        metavar="FRAME",
        help="with --layer: name the files of this frame at all times, for programs that ignore names over time, such "
        "as Blender",
    )


def _work(group: argparse._ArgumentGroup) -> None:
    group.add_argument("--quality", choices=("draft", "normal", "high"), default="normal")
    group.add_argument("--warm", action="store_true", help="start each frame from the one before it in --frames")
    group.add_argument(
        "--temporal-weight",
        type=_positive,
        default=0.0,
        metavar="X",
        help="with --warm: how strongly each frame is held to the one before it; 0.03 to 0.3 is useful",
    )
    group.add_argument("--weld", choices=WELDS, default="index", help="by what faces hang together (index)")
    group.add_argument("--device", choices=("auto", "cpu", "gpu"), default="auto", help="where to compute (auto)")
    group.add_argument("--adapter", type=_whole(0, 255), default=0, metavar="N", help="which GPU; see vrtm devices")
    group.add_argument(
        "--jobs", type=_whole(0, 1024), default=0, metavar="N", help="frames at a time (0: by the cores)"
    )
    group.add_argument("--threads", type=_whole(0, 1024), default=0, metavar="N", help="threads per job (0: the rest)")
    group.add_argument(
        "--measure", action="store_true", help="measure strain and the maps' errors, for the report (takes longer)"
    )
    group.add_argument("--max-strain", type=_positive, metavar="X", help="exit code 3 if a tile's RMS strain is larger")
    group.add_argument(
        "--max-error",
        type=_positive,
        metavar="TEXELS",
        help="exit code 3 if 1 %% of a map is further off than that, in texels of the texture",
    )
    group.add_argument(
        "--texture-size",
        type=_whole(1, 1 << 20),
        default=4096,
        metavar="N",
        help="texels of the texture per side (4096)",
    )


def _messages(group: argparse._ArgumentGroup) -> None:
    group.add_argument(
        "--dry-run",
        action="store_true",
        help="say what would be baked: meshes, tiles, maps, files, memory; write nothing",
    )
    group.add_argument("--report", metavar="FILE.json", help="write all figures")
    group.add_argument("--log", metavar="FILE", help="also write all messages to a file, each with its time")
    group.add_argument("--verbose", action="store_true", help="also say what the library says")
    group.add_argument("--no-progress", action="store_true", help="no progress bar, and no line per frame")
    group.add_argument("--quiet", action="store_true", help="nothing but warnings and errors")
    group.add_argument("--openjd", action="store_true", help="progress and status lines of OpenJobDescription")
    group.add_argument(
        "--more",
        metavar="OPTIONS",
        default="",
        help="further options in one argument, quoted as in a shell: --more='--half'",
    )


def settings(parser: argparse.ArgumentParser, arguments: argparse.Namespace) -> Settings:
    """The settings of a command line. What cannot go together ends the program with exit code 2."""
    given = vars(arguments)
    a = arguments
    if not (a.rigidity or a.rigidity_primvar):
        parser.error("one of --rigidity and --rigidity-primvar is needed: it says what keeps its shape")
    for pattern, primvar in (("rigidity", "rigidity_primvar"), ("mask", "mask_primvar")):
        if given[pattern] and given[primvar]:
            parser.error(f"--{pattern} and --{primvar.replace('_', '-')} exclude each other")
    if a.only_layer and a.layer is None:
        parser.error("--only-layer needs --layer")
    if a.only_layer and a.sheet:
        parser.error("--only-layer and --sheet exclude each other: a sheet shows a frame that was baked")
    for option in ("root", "freeze"):
        if given[option] is not None and not a.layer:
            parser.error(f"--{option} needs --layer")
    if a.freeze is not None and a.frames is not None and a.freeze not in a.frames:
        parser.error(f"--freeze {a.freeze}: it is none of --frames {frames.text(a.frames)}")
    if a.temporal_weight and not a.warm:
        parser.error("--temporal-weight needs --warm: there is nothing else to hold a frame to")
    patterns = [a.rigidity, a.mask, *a.textures, *a.normal_maps]
    if not a.subsets and any("<subset>" in pattern for pattern in patterns if pattern):
        parser.error("<subset> needs --subsets")
    if a.subsets and a.open_borders == "slide":
        parser.error("--subsets and --open-borders slide exclude each other: textures would slide where subsets meet")
    if a.max_layers is not None and a.overlap != EACH:
        parser.error(f"--max-layers needs --overlap {EACH}")
    for option in ("verbose", "dry_run"):
        if a.quiet and given[option]:
            parser.error(f"--quiet and --{option.replace('_', '-')} exclude each other")
    if a.layer and a.layer_mode != "texture" and a.tiles:
        parser.error(f"--layer-mode {a.layer_mode} takes all tiles of a mesh, so that --tiles cannot go with it")
    if a.texture_uv is not None:
        _check_texture_uv(parser, a)
    options = SceneOptions(
        meshes=tuple(a.meshes),
        uv=uv_names(a.uv),
        skip_still=True,
        texture_uv=a.texture_uv,
        rest=a.rest,
        rigidity_primvar=a.rigidity_primvar,
        mask_primvar=a.mask_primvar,
        subdivide=a.subdivide,
        population_mask=tuple(a.population_mask),
        variants=tuple(tuple(v) for v in a.variant),
        poses=tuple(a.poses),
        fps=a.fps,
        world=a.world,
    )
    measure = a.measure or a.max_strain is not None or a.max_error is not None
    own = Settings.__dataclass_fields__
    same = {name: tuple(v) if isinstance(v, list) else v for name, v in given.items() if name in own}
    form = a.form or ("udim" if a.layer or a.texture_uv is not None else "tile")
    layers = a.max_layers or Settings.max_layers
    return Settings(**same | {"options": options, "measure": measure, "form": form, "max_layers": layers})


def uv_names(given: list[str]) -> tuple[str, ...] | None:
    """The UV sets of `--uv`, in order of preference."""
    return tuple(name for text in given for name in text.split(",") if name) or None


def _check_texture_uv(parser: argparse.ArgumentParser, a: argparse.Namespace) -> None:
    """Ends the program for what is not there in the UV set that textures are looked up by."""
    other = {
        "--form tile": a.form == "tile",
        "--texture": a.textures,
        "--normal-map": a.normal_maps,
        "--jacobian": a.jacobian,
        "--filter-scale": a.filter_scale,
        "--subdivide": a.subdivide,
        f"--layer-mode {a.layer_mode}": a.layer and a.layer_mode != "texture",
    }
    for option, given in other.items():
        if given:
            parser.error(f"--texture-uv and {option} exclude each other")


def _numbers(text: str) -> tuple[frames.Frame, ...]:
    try:
        return frames.parse(text)
    except ValueError as error:
        raise argparse.ArgumentTypeError(str(error)) from None


def _whole_numbers(text: str) -> tuple[int, ...]:
    try:
        return frames.parse_whole(text)
    except ValueError as error:
        raise argparse.ArgumentTypeError(str(error)) from None


def _number(text: str) -> frames.Frame:
    found = _numbers(text)
    if len(found) != 1:
        raise argparse.ArgumentTypeError(f"'{text}' is not one frame")
    return found[0]


def _size(text: str) -> int | str:
    return AUTO if text == AUTO else _whole(1, LARGEST)(text)


def _not_negative(text: str) -> float:
    try:
        number = float(text)
    except ValueError:
        number = math.nan
    if not 0 <= number < math.inf:
        raise argparse.ArgumentTypeError(f"'{text}' is not a number from 0 on")
    return number


def _fraction(text: str) -> float:
    number = _not_negative(text)
    if number > 1:
        raise argparse.ArgumentTypeError(f"'{text}' is not a number from 0 to 1")
    return number


def _colour(text: str) -> tuple[float, ...]:
    if re.fullmatch("#[0-9a-fA-F]{6}", text):
        return tuple(byte / 255 for byte in bytes.fromhex(text[1:]))
    try:
        red, green, blue = map(float, text.split(","))
    except ValueError:
        red = green = blue = math.nan
    if not math.isfinite(red + green + blue):
        raise argparse.ArgumentTypeError(f"'{text}' is no colour, such as '#cc994d' or 0.8,0.6,0.3")
    return red, green, blue


def _whole(first: int, last: int) -> Callable[[str], int]:
    def parse(text: str) -> int:
        try:
            number = int(text)
        except ValueError:
            number = first - 1
        if not first <= number <= last:
            raise argparse.ArgumentTypeError(f"'{text}' is not a whole number from {first} to {last}")
        return number

    return parse


def _positive(text: str) -> float:
    try:
        number = float(text)
    except ValueError:
        number = math.nan
    if not 0 < number < math.inf:
        raise argparse.ArgumentTypeError(f"'{text}' is not a number above 0")
    return number
