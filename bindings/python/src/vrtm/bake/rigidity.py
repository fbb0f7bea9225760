"""`vrtm rigidity`: rigidity maps out of textures, heights or detail."""

import argparse
import glob
import os

import numpy as np

import vrtm
from vrtm import rigidity
from vrtm.bake import image_file, overwrite, staging, tokens
from vrtm.bake.console import Console
from vrtm.bake.failure import INPUT, Failure
from vrtm.bake.fingerprint import Fingerprint
from vrtm.bake.image_file import Target
from vrtm.bake.scene.images import read_colours
from vrtm.bake.stopping import Stop
from vrtm.bake.words import counted

VERSION = 1
"""Of the way of making maps: a file that was made in another way is not up to date."""

_FORMATS = {".png": ("png", "uint8"), ".tif": ("tiff", "uint8"), ".exr": ("openexr", "float16")}
_MAKERS = {
    "brightness": (rigidity.of_brightness, ("threshold",)),
    "colour": (rigidity.of_colour, ("colour", "tolerance")),
    "height": (rigidity.of_heights, ("feature", "threshold", "sunken")),
    "detail": (rigidity.of_detail, ("cells", "ceiling", "margin", "mask", "normal_map")),
}
"""By --from: what makes the maps, and the options that it takes."""


def make(parsed: argparse.Namespace, console: Console, stop: Stop) -> None:
    """Runs the command, until it is to stop. Raises Failure, and what vrtm.bake.failure.describe knows."""
    options = _options(parsed)
    paths = _found(parsed.image)
    ending = os.path.splitext(parsed.out)[1].lower()
    if ending not in _FORMATS:
        raise Failure(INPUT, f"--out {parsed.out}: its name must end in .png, .tif or .exr")
    for name, pattern in (("--out", parsed.out), ("--and", parsed.also), ("--normal-map", parsed.normal_map)):
        if pattern and tokens.has_tile(pattern) != tokens.has_tile(parsed.image):
            raise Failure(INPUT, f"{name} {pattern}: either it and {parsed.image} have <UDIM>, or none of them")
    painted, bumps = (_found(pattern) if pattern else {} for pattern in (parsed.also, parsed.normal_map))
    if lost := sorted(painted.keys() - paths):
        raise Failure(INPUT, f"--and {painted[lost[0]]}: {parsed.image} has no such tile")
    outputs = {udim: tokens.tiled(parsed.out, udim) for udim in paths}
    read = [(path, "a picture") for found in (paths, painted, bumps) for path in found.values()]
    overwrite.check([(path, "--out") for path in outputs.values()], read, parsed.overwrite)
    pictures, features, normals = {}, {}, {}
    for udim, path in paths.items():
        stop.check()
        pictures[udim] = rigidity.smaller(read_colours(path, parsed.source == "detail"), parsed.size)
        if udim in painted:
            features[udim] = np.clip(rigidity.brightness(read_colours(painted[udim])), 0, 1)
        if udim in bumps:
            normals[udim] = rigidity.smaller(read_colours(bumps[udim]), parsed.size)
    inputs = Fingerprint().text(VERSION, vrtm.version(), parsed.source, sorted(options.items()))
    inputs.text(parsed.invert, parsed.grow)
    for kind in (pictures, features, normals):
        for udim, pixels in kind.items():
            inputs.text(udim).array(pixels)
    form, dtype = _FORMATS[ending]
    targets = {}
    for udim, path in outputs.items():
        height, width = features.get(udim, pictures[udim]).shape[:2]
        facts: dict[str, str | int] = {"vrtm:kind": "rigidity", "vrtm:inputs": inputs.copy().text(udim).hex()}
        target = Target(path, width, height, ("Y",), dtype, facts, format=form)
        # Painted maps are found before anything is written.
        if image_file.up_to_date(target, parsed.overwrite) is None:
            targets[udim] = target
    if targets:
        staging.sweep(os.path.dirname(parsed.out))
        if parsed.source == "detail":
            given = {name: options[name] for name in ("cells", "ceiling", "margin") if name in options}
            given |= {"ceiling": 1.0} if parsed.mask else {}
            maps = rigidity.of_detail(pictures, features if parsed.also else None, normals, linear=True, **given)
        else:
            maps = _MAKERS[parsed.source][0](pictures, **options)
        stop.check()
        for udim, values in maps.items():
            values = np.clip(rigidity.changed(values, parsed.invert or parsed.mask, parsed.grow), 0, 1)
            if udim in features and not parsed.mask:
                # A solve takes what is over half of the largest rigidity for features.
                values *= features[udim].max() if parsed.source == "detail" else 1
                values = np.maximum(rigidity.fitted(values, features[udim].shape), features[udim])
            maps[udim] = values
        _write(parsed, maps, targets, console)
    console.info(f"{counted(len(targets), 'file')} written, {len(outputs) - len(targets)} up to date: {parsed.out}")


def _write(
    parsed: argparse.Namespace, maps: dict[int, np.ndarray], targets: dict[int, Target], console: Console
) -> None:
    for where, bad in (("nothing is rigid in any", (0, 0)), ("all is rigid in all", (1, 1))):
        if not parsed.mask and all((values.min(), values.max()) == bad for values in maps.values()):
            console.warning(f"{where} of {len(maps)} maps: another --threshold, or another --from, may find more")
    for udim, target in targets.items():
        values = maps[udim][..., None]
        pixels = np.rint(255 * values).astype(np.uint8) if target.dtype == "uint8" else values.astype(np.float16)
        image_file.write(target, pixels)
        console.info(f"{target.path}: {np.mean(values):.1%} {'free' if parsed.mask else 'rigid'}")


def _options(parsed: argparse.Namespace) -> dict:
    """The options that were given, of those that --from takes. Raises Failure for others."""
    own = _MAKERS[parsed.source][1]
    given = {name for _, names in _MAKERS.values() for name in names if getattr(parsed, name) is not None}
    for name in sorted(given.difference(own)):
        others = " or ".join(source for source, (_, names) in _MAKERS.items() if name in names)
        raise Failure(INPUT, f"--{name.replace('_', '-')}: only with --from {others}")
    if "colour" in own and "colour" not in given:
        raise Failure(INPUT, "--from colour: --colour says which")
    if "mask" in own and (parsed.invert or parsed.grow):
        raise Failure(INPUT, "--invert, --grow: not with --from detail")
    return {name: getattr(parsed, name) for name in own if name in given}


def _found(pattern: str) -> dict[int, str]:
    """The pictures by their tiles; one alone by 0. Raises Failure."""
    if not tokens.has_tile(pattern):
        return {0: pattern}
    there = set(glob.glob(tokens.with_tiles(glob.escape(pattern), "*")))
    found = {udim: path for udim in range(1001, 10000) if (path := tokens.tiled(pattern, udim)) in there}
    if not found:
        raise Failure(INPUT, f"{pattern}: no such file")
    if len(set(found.values())) < len(found):
        raise Failure(INPUT, f"{pattern}: several tiles have the same name: write <UDIM>")
    return found
