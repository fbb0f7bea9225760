"""The options of basis maps."""

from __future__ import annotations

import argparse

from vrtm.bake import frames
from vrtm.bake.parsing import flag, listed
from vrtm.bake.settings import AUTO
from vrtm.basis.stored import FORMATS, HALF


def add(group: argparse._ArgumentGroup) -> None:
    """Adds them."""
    flag(
        group,
        "--basis",
        "also write as few maps as it takes, and weights per frame, such that the weighted sum of these maps is off by "
        "at most --max-error texels (1) from the redirection of any frame",
    )
    group.add_argument(
        "--basis-format",
        choices=tuple(FORMATS),
        default=HALF,
        help="with --basis: the numbers of the maps, 16-bit floats (EXR), or integers of a range per map and channel "
        "(PNG), whose offset and scale stand in the file of weights (%(default)s)",
    )
    flag(
        group,
        "--gltf",
        "with --basis: also write glTF, the mesh with morph targets of UVs that its own weights drive: for engines and "
        "materials without a map; it is split where UVs would be off in between",
    )
    flag(
        group,
        "--blend-shapes",
        "with --basis: also write USD, the same mesh with blend shapes, and a mesh of its UVs with others, which the "
        "same weights drive: no program blends a primvar, and a script has to take UVs from these points",
    )
    group.add_argument(
        "--controls",
        metavar="FILE",
        help="with --basis: the frames are poses of a rig, and the weights functions of its controls: a table with "
        "commas, the first line 'frame' and the controls' names, then a line of numbers per frame",
    )
    group.add_argument(
        "--held-out",
        type=listed(frames.parse),
        metavar="LIST",
        help="with --basis: frames to measure the sum on that it is not fitted to",
    )


def wrong(a: argparse.Namespace) -> dict[str, object]:
    """What may be wrong with them, each with whether it is."""
    both = "exclude each other"
    return {
        "--controls needs --basis": a.controls is not None and not a.basis,
        "--gltf needs --basis": a.gltf and not a.basis,
        "--basis-format needs --basis": a.basis_format != HALF and not a.basis,
        f"--gltf and --subsets {both}": a.gltf and a.subsets,
        "--blend-shapes needs --basis": a.blend_shapes and not a.basis,
        f"--blend-shapes and --subsets {both}": a.blend_shapes and a.subsets,
        "--held-out needs --basis": a.held_out is not None and not a.basis,
        **{
            f"--basis and {option} {both}": a.basis and given
            for option, given in {
                f"--map-size {AUTO}": a.map_size == AUTO,
                "--only-layer": a.only_layer,
                "--texture-uv": a.texture_uv is not None,
                "--tiles": a.tiles is not None,
            }.items()
        },
    }
