"""The files that the open file is made of: what a bake must not replace."""

from __future__ import annotations

import os
import re

import bpy

from . import nodes

# A frame's number, as Blender counts: the last digits of the name.
_NUMBER = re.compile(r"\d+(?=\D*$)")
# What stands for a tile in the path of an image with tiles.
_TOKENS = {"<UDIM>": r"\d{4}", "<UVTILE>": r"u\d+_v\d+"}


def files() -> list[tuple[str, str]]:
    """Paths, and what each of them is to the artist. Baked files that a node group reads are no inputs of a bake."""
    found = [(bpy.data.filepath, "the open file")] if bpy.data.filepath else []
    baked, replaceable = nodes.baked_images(), set()
    for owner in (*bpy.data.images, *bpy.data.movieclips, *bpy.data.cache_files, *bpy.data.libraries):
        if not owner.filepath or getattr(owner, "packed_file", None) is not None:
            continue
        path = os.path.abspath(bpy.path.abspath(owner.filepath, library=owner.library))
        if owner in baked:
            replaceable.add(path)
            continue
        what = f"the file of {owner.id_type.lower()} {owner.name!r}"
        sequence = getattr(owner, "source", "") == "SEQUENCE" or getattr(owner, "is_sequence", False)
        found += [(one, what) for one in _each(path, sequence)]
    # Of all others Blender tells the paths alone.
    paths = {os.path.abspath(path) for path in bpy.utils.blend_paths(absolute=True)}
    return found + [(path, "a file that the open one reads") for path in sorted(paths - replaceable)]


def _each(path: str, sequence: bool) -> list[str]:
    """The path, or those of all tiles or frames that are there."""
    folder, name = os.path.split(path)
    pattern = re.escape(name)
    for token, digits in _TOKENS.items():
        pattern = pattern.replace(re.escape(token), digits)
    if sequence and (number := _NUMBER.search(name)):
        pattern = re.escape(name[: number.start()]) + r"-?\d+" + re.escape(name[number.end() :])
    if pattern == re.escape(name):
        return [path]
    try:
        return [path] + [os.path.join(folder, one) for one in sorted(os.listdir(folder)) if re.fullmatch(pattern, one)]
    except OSError:
        return [path]
