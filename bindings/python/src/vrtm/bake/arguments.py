"""The options of `vrtm bake`: ten usual ones, and all others by group."""

import argparse
import functools
from collections.abc import Iterator
from typing import Any

from vrtm._records import about_settings
from vrtm.bake import frames
from vrtm.bake.parsing import LARGEST, WELDS, either, listed, normal_maps, not_negative, option, positive, whole
from vrtm.bake.scene import SceneOptions
from vrtm.bake.scene.timing import FILE
from vrtm.bake.settings import AUTO, CONNECTED, EACH, NUMBERS, OVERLAP, Settings
from vrtm.basis.stored import FORMATS, HALF

DESCRIPTION = """\
Bakes redirection maps. Per frame and tile, such a map says where to sample the texture so that painted features keep
their shape while the mesh deforms. Files that are up to date are left alone, so an interrupted bake resumes."""

EPILOG = """\
exit codes: 0 done; 2 a file or an option cannot be used; 3 done, but --max-strain, --max-error or --max-worse was
exceeded, or the layer names files that do not exist; 4 the device is missing or lost, or memory is short; 128 + the
signal's number if it was ended (130 Ctrl-C, 143 SIGTERM); 1 an error of vrtm itself."""


_NUMBERS = {
    "smoothness": "Stiffness of the soft parts. Lower values keep rigid features in shape better.",
    "smoothness_floor": "Stiffness of all parts, rigid ones too, which keeps the solve stable.",
    "orientation": "Hold rigid features against turning. Higher values turn them less.",
    "orientation_density": "Hold rigid features against turning where they are dense, and let sparse ones turn.",
    "room": "Protect texture between rigid features from being crushed. Higher values leave it more room.",
    "room_threshold": "The part of its area to which texture may shrink before --room protects it.",
    "harm": "Stiffness that a feature gains where it would come out worse than without the warp.",
}
"""Sentences of the numbers among the library's settings of a tile, which states their limits."""


class _Help(argparse.Action):
    """Prints the help of the options in its own group, or, with a `const`, of all."""

    def __call__(self, parser: argparse.ArgumentParser, *_: Any) -> None:
        for action in parser._actions:
            if not self.const and action.container is not self.container:
                action.help = argparse.SUPPRESS
        parser.print_help()
        parser.exit()


def add_to(commands: Any) -> argparse.ArgumentParser:
    parser = commands.add_parser(
        "bake",
        help="bake redirection maps",
        usage="vrtm bake SCENE --rigidity PATTERN [OPTION ...]",
        description=DESCRIPTION,
        epilog=EPILOG,
        add_help=False,
    )

    def group(title: str) -> functools.partial[None]:
        return functools.partial(option, parser.add_argument_group(title))

    add = group("usual options")
    usual = add.args[0]
    usual.add_argument("scene", metavar="SCENE", help="The USD, Alembic or OBJ file.")
    text = "Images that are white where the surface is to keep its shape. In this and other patterns, <UDIM> stands "
    text += "for the tile, <mesh> for the mesh and <subset> for the part of --subsets."
    add("--rigidity", text, "PATTERN")
    add("--mask", "Images that are dark where nothing may move.", "PATTERN")
    text = "Also write warped copies of these textures, for renderers that cannot look a map up."
    add("--texture", text, "PATTERN...", dest="textures")
    add("--layer", "Write a USD layer that redirects the shot's textures, to be sublayered over it.", "FILE")
    text = "OBJ: the files of the poses, or a pattern such as pose.####.obj, pose.%%04d.obj, pose.$F4.obj, "
    text += "pose.<frame>.obj or pose.*.obj."
    add("--poses", text, "FILE...")
    add("--meshes", "Bake these meshes, by name or path, with * as a wildcard. All that deform by default.", "NAME...")
    text = "Bake these frames, such as 1-10x2,15, -3--1, or 1-3x0.5 with parts of frames. All whole ones by default."
    add("--frames", text, "LIST", type=listed(frames.parse))
    add("--out", "Write to this folder.", "DIR", default="out")
    add("--sheet", "Also draw a picture per mesh to judge by: the worst frame without and with the maps.")
    add("--dry-run", "List the meshes, tiles, maps, files and memory, and write nothing: also without --rigidity.")
    shared = {"action": _Help, "nargs": 0, "default": argparse.SUPPRESS}
    usual.add_argument("-h", "--help", help="Show the usual options and exit.", **shared)
    usual.add_argument("--help-all", help="Show all options and exit.", const=True, **shared)

    add = group("scene")
    add("--exclude", "Leave these meshes out, by name or path, with * as a wildcard.", "NAME...")
    text = "The UV set to bake. Of several names each mesh takes the first that it has. By default st, or the only set."
    add("--uv", text, "NAME...")
    text = "USD: the UV set that textures are looked up by, if --uv names another one, without overlaps."
    add("--texture-uv", text, "NAME")
    add("--subsets", "USD: bake each material of a mesh separately; faces without one are the part 'rest'.")
    text = "The shape at rest: bind, pref, first, frame:N, or a file with the same faces. By default the scene's own."
    add("--rest", text, "WHERE")
    text = "Refine subdivision surfaces by so many levels. By default the cage is baked."
    add("--subdivide", text, "N", type=whole(0, 8), default=0)
    text = "USD: select a variant. The option may be repeated."
    add("--variant", text, nargs=3, action="append", dest="variants", default=[], metavar=("PRIM", "SET", "SELECTION"))
    text = "Count frames by this rate: frame N is at N / X seconds. With the word file the scene states the rate. By "
    text += "default whole time codes of USD are frames, and Alembic states the rate."
    add("--fps", text, "X", type=either(FILE, positive))
    add("--world", "Apply the transforms above a mesh, so that an animated scale counts as a stretch.")
    add("--allow-units", "Take a mesh whose size differs from the rest for a deformation, and do not scale the rest.")

    add = group("what is rigid")
    add("--rigidity-primvar", "Take the rigidity from this primvar instead of images ('colors' in OBJ).", "NAME")
    add("--mask-primvar", "Take the mask from this primvar instead of images.", "NAME")

    add = group("files")
    text = "Name the files below --out in this way, with <mesh>, <subset>, <kind>, <frame> and <UDIM>. By default "
    text += "<kind>.<frame>.<UDIM>.exr, after <mesh>. if there are several, and <subset>. with --subsets."
    add("--name", text, "PATTERN")
    add("--tiles", "Bake these tiles, such as 1001,1011-1013. All by default.", "LIST", type=listed(frames.parse_whole))
    text = "Bake the first (1/10) to the last (10/10) tenth of the frames, and write nothing but the files of single "
    text += "frames. The same command without it then writes the layer, carried geometry, basis maps, sheets and "
    text += "report."
    add("--task", text, "K/N", type=_task)
    add("--overwrite", "Also replace files that vrtm has not written, but never one that the bake reads.")

    add = group("content")
    text = "Cells of the solver's grid per side. With auto, the default, 20 lie across the narrowest rigid feature of "
    text += "each tile: 64 to 4096, and no more than the rigidity map has texels or 256."
    add("--size", text, "N", type=lambda text: None if text == AUTO else whole(1, LARGEST)(text))
    text = "Texels of the maps per side. By default as --size, or as the rigidity map; 1024 with a primvar. With auto, "
    text += "each map gets the fewest that keep --max-error (1)."
    add("--map-size", text, "N", type=either(AUTO, whole(1, LARGEST)))
    text = "The UVs in a map: within the tile, among all UDIM tiles, or the difference to add to the mesh's own. By "
    text += "default tile, with --layer udim."
    add("--form", text, choices=("tile", "udim", "delta"))
    add("--half", "Store 16-bit numbers: with --form delta the smallest maps, two fifths of the bytes.")
    add("--alpha", "Add an alpha channel that is 1 where a chart covers the texel.")
    add("--warp", "Also write the warp, the inverse of the redirection.")
    add("--jacobian", "Also write the redirection's derivatives.")
    add("--filter-scale", "Also write how much wider a texture filter has to be.")
    normal_maps(add)

    add = group("borders")
    text = "At seams nothing moves (shut); features that touch one stay as they are (keep); or features keep their "
    text += "shape across them (continue), for which textures in a renderer have to be dilated. With auto, the bake "
    text += "chooses: continue if all textures of a mesh are copies or dilated, else the better of shut and keep."
    add("--seams", text, choices=(AUTO, "shut", "keep", "continue"), default=AUTO)
    text = "With --seams continue, the radius of the largest feature on a seam, in UV, at most 0.5."
    add("--seam-reach", text, "UV", type=positive, default=Settings.seam_reach)
    text = "Where the surface ends nothing moves (fixed), or textures slide along the border (slide). With auto, they "
    text += "slide if all textures of a mesh are copies or dilated, and no other mesh goes on there."
    add("--open-borders", text, choices=(AUTO, "fixed", "slide"), default=AUTO)
    text = "Charts that lie over one another, as mirrored halves do, each get maps of their own, in layers (each); do "
    text += "not move there (fixed); or all follow the chart of the first face (first)."
    add("--overlap", text, choices=(EACH, "fixed", "first"), default=OVERLAP)
    text = f"With --overlap each, the most layers of a tile ({Settings.max_layers} by default)."
    add("--max-layers", text, "N", type=whole(2, LARGEST))

    add = group("material")
    for name in NUMBERS:
        limits = about_settings[name].removesuffix(".").rsplit(". ", 1)[-1]
        add(f"--{name.replace('_', '-')}", f"{_NUMBERS[name]} ({limits})", "X", type=not_negative)

    add = group("basis maps")
    text = "Also write as few maps as possible whose weighted sum is within --max-error texels (1) of each frame's "
    text += "map, and the weights of the frames."
    add("--basis", text)
    text = "Numbers of these maps: 16-bit floats (EXR), or integers (PNG) with a range per map in the file of weights."
    add("--basis-format", text, choices=tuple(FORMATS), default=HALF)
    add("--gltf", "Also write the mesh as glTF with UV morph targets, for engines and materials without a map.")
    text = "Also write the mesh as USD with blend shapes, and one with its UVs as points, for scripts that blend UVs."
    add("--blend-shapes", text)
    text = "The frames are poses of a rig, and this table (CSV) has the values of its controls: a first line 'frame' "
    text += "and their names, then a line of numbers per frame. The weights become functions of them."
    add("--controls", text, "FILE")
    text = "Do not fit the maps to these frames, and measure the sum on them."
    add("--held-out", text, "LIST", type=listed(frames.parse))

    add = group("geometry on the surface")
    text = "Move instances, points, curves and detail meshes along with the paint: these prims and all below them. "
    text += "carried.usdc (a layer) or carried.abc (an archive) in --out has them in all frames."
    add("--carry-prims", text, "PATH...")
    add("--carry", "The USD or Alembic file of these prims, in the world of the scene. The scene by default.", "FILE")
    text = "Leave geometry in place that is farther from the mesh than this, in its units. By default 5 %% of the "
    text += "diagonal of the mesh's bounding box."
    add("--carry-farthest", text, "X", type=positive)
    text = "Geometry follows each rigid feature as one body (feature), the redirected surface (surface), or the "
    text += "surface as if nothing were redirected (none)."
    add("--carry-fit", text, choices=("feature", "surface", "none"), default="feature")
    text = "Bind each connected part of a detail mesh as one rigid body (connected), or each of its points (none)."
    add("--carry-pieces", text, choices=("none", CONNECTED), default="none")

    add = group("USD layer")
    text = "The layer redirects texture lookups of the materials (texture), or authors the primvar st_redirected for "
    text += "them (primvar)."
    add("--layer-mode", text, choices=("texture", "primvar"), default="texture")
    add("--only-layer", "Write nothing but the layer.")
    add("--root", "Also write a layer to open directly: the shot's settings, the layer and the shot below.", "FILE")
    add("--freeze", "Name the files of this frame at all times, for programs such as Blender.", "FRAME", type=_frame)

    add = group("work")
    text = "The quality of the solve; draft is several times as fast."
    add("--quality", text, choices=("draft", "normal"), default="normal")
    text = "Features keep the size that they have at rest, as on a body that swells (keep), or grow with the pose as a "
    text += "whole, as under a scale control (follow)."
    add("--scale", text, choices=("keep", "follow"), default="keep")
    add("--warm", "Start each frame from the one before it in --frames.")
    text = "With --warm, hold each frame to the one before it, against jitter. Useful are 0.03 to 0.3."
    add("--temporal-weight", text, "X", type=positive)
    text = "Faces are connected by their vertices, by equal positions, or not at all."
    add("--weld", text, choices=WELDS, default="index")
    add("--device", "Compute on the CPU or on a GPU.", choices=("auto", "cpu", "gpu"), default="auto")
    add("--adapter", "The number of the GPU, as vrtm devices lists it.", "N", type=whole(0, 255))
    add("--jobs", "Frames at a time. By default as the cores and the memory allow.", "N", type=whole(0, 1024))
    add("--threads", "Threads of each job. By default the cores are shared out.", "N", type=whole(0, 1024))
    add("--measure", "Measure strain and the errors of the maps for the report, which takes longer.")
    add("--max-strain", "End with exit code 3 if the RMS strain of a tile is larger.", "X", type=positive)
    text = "End with exit code 3 if 1 %% of a map is off by more texels of the texture. With --basis also the most "
    text += "that a sum may be off."
    add("--max-error", text, "TEXELS", type=positive)
    text = "End with exit code 3 if more painted features of a tile are worse than without vrtm."
    add("--max-worse", text, "N", type=whole(0, 1 << 31))
    add("--strict", "End with exit code 2 if anything is not baked unintentionally.")
    text = "Do not read back what was written, to compare it with what was meant."
    add("--no-check", text, dest="check", action="store_false")
    add("--texture-size", "Texels of the texture per side, for errors.", "N", type=whole(1, 1 << 20), default=4096)

    add = group("messages")
    add("--report", "Write all figures as JSON.", "FILE")
    add("--log", "Also add all messages to this file, with their times.", "FILE")
    add("--verbose", "Also print details, such as messages of the library.")
    add("--no-progress", "Print no progress bar, and no line per frame.")
    add("--quiet", "Print nothing but warnings and errors.")
    add("--openjd", "Print progress and status lines of OpenJobDescription.")
    add("--settings", "Further options in a file, quoted as in a shell, such as vrtm's page writes.", "FILE")
    add("--more", "Further options in one argument, quoted as in a shell: --more='--half'.", "OPTIONS", action="append")
    return parser


_NEEDED_BY = {
    "--basis": ("--controls", "--gltf", "--blend-shapes", "--basis-format", "--held-out"),
    "--carry-prims": ("--carry", "--carry-farthest", "--carry-fit", "--carry-pieces"),
    "--layer": ("--root", "--freeze", "--only-layer"),
    "--warm": ("--temporal-weight",),
}
_EXCLUDES = {
    "--rigidity": ("--rigidity-primvar",),
    "--mask": ("--mask-primvar",),
    "--gltf": ("--subsets",),
    "--blend-shapes": ("--subsets",),
    "--basis": ("--only-layer", "--texture-uv", "--tiles"),
    "--carry-prims": ("--only-layer", "--subsets", "--tiles"),
    "--only-layer": ("--sheet",),
    "--task": ("--only-layer", "--warm"),
    "--texture-uv": ("--texture", "--normal-map", "--jacobian", "--filter-scale", "--subdivide"),
    "--quiet": ("--verbose", "--dry-run"),
}


def settings(parser: argparse.ArgumentParser, a: argparse.Namespace) -> Settings:
    """The settings of a command line. Options in conflict end the program with exit code 2."""
    for message in _conflicts(parser, a):
        parser.error(message)

    def same(kind: type) -> dict:
        given = {name: value for name, value in vars(a).items() if name in kind.__dataclass_fields__}
        given = {name: tuple(value) if isinstance(value, list) else value for name, value in given.items()}
        # The defaults are those of the settings.
        return {name: value for name, value in given.items() if value is not None}

    further = {"variants": tuple(map(tuple, a.variants)), "lenient": True}
    own = {
        "options": SceneOptions(**same(SceneOptions) | further),
        "measure": a.measure or any(most is not None for most in (a.max_strain, a.max_error, a.max_worse)),
        "form": a.form or ("udim" if a.layer or a.texture_uv is not None else "tile"),
        "numbers": {name: value for name in NUMBERS if (value := getattr(a, name)) is not None},
    }
    if a.task is not None:
        # One file of all frames is none of a task's. Of the layer, corner UVs are files of single frames.
        own |= {name: getattr(Settings, name) for name in ("sheet", "root", "freeze", "report", "basis", "gltf")}
    return Settings(**same(Settings) | own)


def _conflicts(parser: argparse.ArgumentParser, a: argparse.Namespace) -> Iterator[str]:
    """Messages about options of a command line that are missing or in conflict."""
    both = "exclude each other"

    def given(name: str) -> bool:
        action = parser._option_string_actions[name]
        value = getattr(a, action.dest)
        return value is not None and value != "" and value != action.default

    if not (given("--rigidity") or given("--rigidity-primvar") or a.dry_run):
        yield "one of --rigidity and --rigidity-primvar is needed: it says what keeps its shape (not by --dry-run)"
    for name, others in _EXCLUDES.items():
        yield from (f"{name} and {other} {both}" for other in others if given(name) and given(other))
    for name, others in _NEEDED_BY.items():
        yield from (f"{other} needs {name}" for other in others if given(other) and not given(name))
    if a.basis and a.map_size == AUTO:
        yield f"--basis and --map-size {AUTO} {both}"
    if a.freeze is not None and a.frames is not None and a.freeze not in a.frames:
        yield f"--freeze {a.freeze}: it is none of --frames {frames.text(a.frames)}"
    patterns = filter(None, [a.rigidity, a.mask, *a.textures, *a.normal_maps])
    if not a.subsets and any("<subset>" in pattern for pattern in patterns):
        yield "<subset> needs --subsets"
    if a.subsets and a.open_borders == "slide":
        yield f"--subsets and --open-borders slide {both}: textures would slide where subsets meet"
    if a.max_layers is not None and a.overlap != EACH:
        yield f"--max-layers needs --overlap {EACH}"
    mode = f"--layer-mode {a.layer_mode}" if a.layer and a.layer_mode != "texture" else ""
    if mode and a.tiles:
        yield f"{mode} takes all tiles of a mesh, so that --tiles cannot go with it"
    if a.texture_uv is not None and mode:
        yield f"--texture-uv and {mode} {both}"
    if a.texture_uv is not None and a.form == "tile":
        yield f"--texture-uv and --form tile {both}"


def _task(text: str) -> tuple[int, int]:
    number, _, count = text.partition("/")
    if number.isdecimal() and count.isdecimal() and 1 <= int(number) <= int(count):
        return int(number), int(count)
    raise argparse.ArgumentTypeError(f"'{text}' is not K/N, the number of a task from 1 to N, and N")


def _frame(text: str) -> frames.Frame:
    found = listed(frames.parse)(text)
    if len(found) != 1:
        raise argparse.ArgumentTypeError(f"'{text}' is not one frame")
    return found[0]
