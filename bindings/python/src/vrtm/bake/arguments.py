"""The options of `vrtm bake`."""

from __future__ import annotations

import argparse
from typing import Any

from vrtm._records import about_settings
from vrtm.bake import basis_arguments, carry_arguments, frames
from vrtm.bake.parsing import (
    LARGEST,
    WELDS,
    flag,
    listed,
    normal_maps,
    not_negative,
    positive,
    several,
    uv_names,
    whole,
)
from vrtm.bake.scene import SceneOptions
from vrtm.bake.scene.timing import FILE
from vrtm.bake.settings import AUTO, EACH, NUMBERS, OVERLAP, Settings

DESCRIPTION = """\
Bakes redirection maps: where to sample the texture, per frame and tile, so that painted features keep their shape
while the mesh under them deforms. Reads USD, Alembic and OBJ. A file that is up to date is left alone, so that a bake
which was ended goes on where it stopped."""

EPILOG = """\
exit codes: 0 done; 2 a file or an option cannot be used; 3 done, but --max-strain or --max-error was exceeded, or the
layer redirects nothing; 4 the device is missing or lost, or memory is short; 128 + the signal's number if it was ended
(130 Ctrl-C, 143 SIGTERM); 1 an error of vrtm itself."""


def add_to(commands: Any) -> argparse.ArgumentParser:
    """Adds the subcommand `bake`."""
    parser = commands.add_parser("bake", help="bake redirection maps", description=DESCRIPTION, epilog=EPILOG)
    _scene(parser.add_argument_group("scene"))
    _maps(parser.add_argument_group("what is rigid"))
    _files(parser.add_argument_group("files"))
    _content(parser.add_argument_group("content"))
    _borders(parser.add_argument_group("borders"))
    _material(parser.add_argument_group("material"))
    basis_arguments.add(parser.add_argument_group("basis maps"))
    carry_arguments.add(parser.add_argument_group("geometry on the skin"))
    _layer(parser.add_argument_group("USD layer"))
    _work(parser.add_argument_group("work"))
    _messages(parser.add_argument_group("messages"))
    return parser


def _scene(group: argparse._ArgumentGroup) -> None:
    group.add_argument("scene", metavar="SCENE", help="a USD, Alembic or OBJ file")
    several(
        group,
        "--poses",
        "FILE",
        "OBJ: the poses, as files or patterns (pose.####.obj, pose.%%04d.obj, pose.$F4.obj, pose.<frame>.obj, "
        "pose.*.obj)",
    )
    several(group, "--meshes", "NAME", "names or prim paths, with * wildcards (default: all meshes that have UVs)")
    several(
        group,
        "--uv",
        "NAME",
        "the UV set; of several names, also with commas between them, each mesh takes the first that it has "
        "(default: st, or the only one)",
    )
    group.add_argument(
        "--texture-uv",
        metavar="NAME",
        help="USD: the UV set that textures are looked up by, where --uv is one without overlaps: the maps then hold "
        "UVs of this set, and are looked up by that of --uv",
    )
    flag(
        group,
        "--subsets",
        "USD: bake the subsets of a mesh that materials are bound to each by itself, and the faces in none of "
        "them as 'rest': for materials that use the same UVs; give <subset> in --rigidity",
    )
    group.add_argument(
        "--rest",
        metavar="WHERE",
        help="the rest shape: bind, pref, first, frame:N, or a file with the same faces (default: the scene's own)",
    )
    group.add_argument("--subdivide", type=whole(0, 8), default=0, metavar="N", help="levels of subdivision (0)")
    several(group, "--population-mask", "PRIM", "USD: load these prims only")
    group.add_argument(
        "--variant",
        dest="variants",
        nargs=3,
        action="append",
        default=[],
        metavar=("PRIM", "SET", "SELECTION"),
        help="USD: select a variant; may be given several times",
    )
    group.add_argument(
        "--fps",
        type=lambda text: text if text == FILE else positive(text),
        metavar="X",
        help="frames per second: frame N is at N / X seconds. file: as the file says, in USD by framesPerSecond "
        "(default: whole time codes of USD are frames; Alembic: file)",
    )
    flag(
        group,
        "--world",
        "with the transforms above a mesh: what an animated scale stretches is stretched (the rest has those of "
        "its frame, or of the first)",
    )
    flag(
        group,
        "--allow-units",
        "take poses that are larger or smaller than the rest as a whole for deformations: the rest is not "
        "scaled, and a factor of 10 does not end the bake",
    )


def _maps(group: argparse._ArgumentGroup) -> None:
    where = "<UDIM> stands for the tile, <mesh> for the mesh's name, <subset> for that of --subsets"
    group.add_argument("--rigidity", metavar="PATTERN", help=f"images, white = rigid; {where}")
    group.add_argument("--mask", metavar="PATTERN", help="images; what is dark does not move")
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
        type=listed(frames.parse),
        metavar="LIST",
        help="such as 1-10x2,15 or -3--1, or with parts of frames 1-3x0.5 (default: all whole ones)",
    )
    group.add_argument(
        "--tiles", type=listed(frames.parse_whole), metavar="LIST", help="such as 1001,1011-1013 (default: all)"
    )
    flag(group, "--force", "also write files that are up to date")
    flag(
        group, "--overwrite", "replace files that vrtm has not written, too; one that the bake reads is never replaced"
    )


def _content(group: argparse._ArgumentGroup) -> None:
    group.add_argument(
        "--size",
        type=lambda text: None if text == AUTO else whole(1, LARGEST)(text),
        metavar="N",
        help="cells of the grid per side; auto, the default: 20 across the narrowest rigid features of each tile, but "
        "64 to 4096, and no more than the rigidity map has texels or 256",
    )
    group.add_argument(
        "--map-size",
        type=lambda text: text if text == AUTO else whole(1, LARGEST)(text),
        metavar="N",
        help="texels per side (those of --size, or of the rigidity map; 1024 with a primvar); auto: per tile and "
        "frame the least that keeps --max-error (1 if that is not given), or what comes closest to it",
    )
    group.add_argument(
        "--form",
        choices=("tile", "udim", "delta"),
        help="the UVs in the map: within the tile, among all UDIM tiles, or what to add to the mesh's own "
        "(tile; with --layer, udim)",
    )
    flag(group, "--half", "numbers of 16 bits, for --form delta: the smallest maps, two fifths of the bytes")
    flag(group, "--alpha", "RGBA, with 1 in A where a chart covers the texel")
    flag(
        group,
        "--sheet",
        "also draw a picture per mesh, to judge by: its worst frame at rest, with its own UVs, and redirected",
    )
    flag(group, "--warp", "also write the warp, the redirection's inverse")
    flag(group, "--jacobian", "also write the redirection's derivatives")
    flag(group, "--filter-scale", "also write how much wider a filter has to be")
    several(
        group,
        "--texture",
        "PATTERN",
        "also write warped copies of these textures, for renderers without dependent lookups",
        "textures",
    )
    normal_maps(group)


def _borders(group: argparse._ArgumentGroup) -> None:
    group.add_argument(
        "--seams",
        choices=(AUTO, "shut", "keep", "continue"),
        default=AUTO,
        help="at seams nothing moves (shut); or features that touch one stay as they are, whole (keep); or they keep "
        "their shape across it: textures that renderers look up by the maps then have to be dilated (vrtm dilate). "
        "auto, the default: continue where all textures of a mesh are copies or dilated, else the better one of shut "
        "and keep",
    )
    group.add_argument(
        "--seam-reach",
        type=positive,
        default=1 / 32,
        metavar="UV",
        help="how far charts go on beyond their seams: the radius of the largest feature on one, at most 0.5 (0.03125)",
    )
    group.add_argument(
        "--open-borders",
        choices=(AUTO, "fixed", "slide"),
        default=AUTO,
        help="at borders beyond which the surface ends nothing moves (fixed), or textures slide along them, so that "
        "features there keep their shape. auto, the default: slide where all textures of a mesh are copies or dilated, "
        "and nothing else is where it ends",
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
        type=whole(2, LARGEST),
        metavar="N",
        help=f"with --overlap each: the most layers that a tile may have ({Settings.max_layers})",
    )


def _material(group: argparse._ArgumentGroup) -> None:
    for name in NUMBERS:
        # The first sentence says what it is, the last one its limits.
        first, *_, limits = about_settings[name].removesuffix(".").split(". ")
        text = f"{first[0].lower()}{first[1:]}; {limits}".replace("%", "%%")
        group.add_argument(f"--{name.replace('_', '-')}", type=not_negative, metavar="X", help=text)


def _layer(group: argparse._ArgumentGroup) -> None:
    group.add_argument("--layer", metavar="FILE", help="write a USD layer to be sublayered over the shot; '' for none")
    group.add_argument(
        "--layer-mode",
        choices=("texture", "primvar", "both"),
        default="texture",
        help="redirect the materials' texture lookups (default), author a primvar st_redirected, or both",
    )
    flag(group, "--only-layer", "write nothing but the layer")
    group.add_argument(
        "--root",
        metavar="FILE",
        help="with --layer: also write a layer to open by itself: the layer over the shot, with the shot's time codes, "
        "axis and units",
    )
    group.add_argument(
        "--freeze",
        type=_frame,
        metavar="FRAME",
        help="with --layer: name the files of this frame at all times, for programs that ignore names over time, such "
        "as Blender",
    )


def _work(group: argparse._ArgumentGroup) -> None:
    group.add_argument("--quality", choices=("draft", "normal"), default="normal")
    flag(group, "--warm", "start each frame from the one before it in --frames")
    group.add_argument(
        "--temporal-weight",
        type=positive,
        default=0.0,
        metavar="X",
        help="with --warm: how strongly each frame is held to the one before it; 0.03 to 0.3 is useful",
    )
    group.add_argument("--weld", choices=WELDS, default="index", help="by what faces hang together (index)")
    group.add_argument("--device", choices=("auto", "cpu", "gpu"), default="auto", help="where to compute (auto)")
    group.add_argument("--adapter", type=whole(0, 255), default=0, metavar="N", help="which GPU; see vrtm devices")
    group.add_argument("--jobs", type=whole(0, 1024), default=0, metavar="N", help="frames at a time (0: by the cores)")
    group.add_argument("--threads", type=whole(0, 1024), default=0, metavar="N", help="threads per job (0: the rest)")
    flag(group, "--measure", "measure strain and the maps' errors, for the report (takes longer)")
    group.add_argument("--max-strain", type=positive, metavar="X", help="exit code 3 if a tile's RMS strain is larger")
    group.add_argument(
        "--max-error",
        type=positive,
        metavar="TEXELS",
        help="exit code 3 if 1 %% of a map is further off than that, in texels of the texture; with --basis also the "
        "most that a sum may be off from the map of its frame",
    )
    flag(
        group,
        "--strict",
        "exit code 2 if anything is not baked that no option leaves out, and that would not stay as it is",
    )
    group.add_argument(
        "--texture-size",
        type=whole(1, 1 << 20),
        default=4096,
        metavar="N",
        help="texels of the texture per side (4096)",
    )


def _messages(group: argparse._ArgumentGroup) -> None:
    flag(group, "--dry-run", "say what would be baked: meshes, tiles, maps, files, memory; write nothing")
    group.add_argument("--report", metavar="FILE.json", help="write all figures")
    group.add_argument("--log", metavar="FILE", help="also write all messages to a file, each with its time")
    flag(group, "--verbose", "also say what the library says")
    flag(group, "--no-progress", "no progress bar, and no line per frame")
    flag(group, "--quiet", "nothing but warnings and errors")
    flag(group, "--openjd", "progress and status lines of OpenJobDescription")
    group.add_argument(
        "--more",
        metavar="OPTIONS",
        default="",
        help="further options in one argument, quoted as in a shell: --more='--half'",
    )


def settings(parser: argparse.ArgumentParser, a: argparse.Namespace) -> Settings:
    """The settings of a command line. What cannot go together ends the program with exit code 2."""
    for message, found in _wrong(a).items():
        if found:
            parser.error(message)

    def same(kind: type) -> dict:
        given = {name: value for name, value in vars(a).items() if name in kind.__dataclass_fields__}
        return {name: tuple(value) if isinstance(value, list) else value for name, value in given.items()}

    further = {"uv": uv_names(a.uv), "variants": tuple(map(tuple, a.variants)), "skip_still": True}
    own = {
        "options": SceneOptions(**same(SceneOptions) | further),
        "measure": a.measure or a.max_strain is not None or a.max_error is not None,
        "form": a.form or ("udim" if a.layer or a.texture_uv is not None else "tile"),
        "max_layers": a.max_layers or Settings.max_layers,
        "numbers": {name: value for name in NUMBERS if (value := getattr(a, name)) is not None},
    }
    return Settings(**same(Settings) | own)


def _wrong(a: argparse.Namespace) -> dict[str, object]:
    """What may be wrong with a command line, each with whether it is."""
    patterns = filter(None, [a.rigidity, a.mask, *a.textures, *a.normal_maps])
    mode = f"--layer-mode {a.layer_mode}"
    of_corners = a.layer and a.layer_mode != "texture"
    # What is not there in the UV set that textures are looked up by.
    without_texture_uv = {
        "--form tile": a.form == "tile",
        "--texture": a.textures,
        "--normal-map": a.normal_maps,
        "--jacobian": a.jacobian,
        "--filter-scale": a.filter_scale,
        "--subdivide": a.subdivide,
        mode: of_corners,
    }
    both = "exclude each other"
    return {
        "one of --rigidity and --rigidity-primvar is needed: it says what keeps its shape": not (
            a.rigidity or a.rigidity_primvar
        ),
        f"--rigidity and --rigidity-primvar {both}": a.rigidity and a.rigidity_primvar,
        f"--mask and --mask-primvar {both}": a.mask and a.mask_primvar,
        "--only-layer needs --layer": a.only_layer and a.layer is None,
        f"--only-layer and --sheet {both}: a sheet shows a frame that was baked": a.only_layer and a.sheet,
        **basis_arguments.wrong(a),
        **carry_arguments.wrong(a),
        "--root needs --layer": a.root is not None and not a.layer,
        "--freeze needs --layer": a.freeze is not None and not a.layer,
        f"--freeze {a.freeze}: it is none of --frames {frames.text(a.frames or ())}": a.freeze is not None
        and a.frames is not None
        and a.freeze not in a.frames,
        "--temporal-weight needs --warm: there is nothing else to hold a frame to": a.temporal_weight and not a.warm,
        "<subset> needs --subsets": not a.subsets and any("<subset>" in pattern for pattern in patterns),
        f"--subsets and --open-borders slide {both}: textures would slide where subsets meet": a.subsets
        and a.open_borders == "slide",
        f"--max-layers needs --overlap {EACH}": a.max_layers is not None and a.overlap != EACH,
        f"--quiet and --verbose {both}": a.quiet and a.verbose,
        f"--quiet and --dry-run {both}": a.quiet and a.dry_run,
        f"{mode} takes all tiles of a mesh, so that --tiles cannot go with it": of_corners and a.tiles,
        **{
            f"--texture-uv and {option} {both}": a.texture_uv is not None and given
            for option, given in without_texture_uv.items()
        },
    }


def _frame(text: str) -> frames.Frame:
    found = listed(frames.parse)(text)
    if len(found) != 1:
        raise argparse.ArgumentTypeError(f"'{text}' is not one frame")
    return found[0]
