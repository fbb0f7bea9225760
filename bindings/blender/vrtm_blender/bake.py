"""Bakes a range of frames to EXR files: of each tile, and of all tiles in one image, as the node group reads it."""

from __future__ import annotations

import contextlib
import os
import re
from collections.abc import Iterator, Mapping
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING

import bpy
import numpy as np

from . import exr, layers, live, nodes, result_image, session, solve, states
from .messages import Problem
from .rendered import evaluation

if TYPE_CHECKING:
    import vrtm

# A frame's number, as Blender counts: the last digits of the name.
_NUMBER = re.compile(r"\d+(?=\D*$)")
# Tokens for a tile in the path of an image with tiles.
_TOKENS = {"<UDIM>": r"\d{4}", "<UVTILE>": r"u\d+_v\d+"}


def folder_of(scene: bpy.types.Scene) -> Path:
    """The folder to write to, made if it is not there."""
    directory = scene.vrtm_bake.directory
    if directory.startswith("//") and not bpy.data.filepath:
        raise Problem(
            f"the folder {directory!r} lies beside the file, which was never saved: save it, or choose another"
        )
    folder = Path(bpy.path.abspath(directory))
    try:
        folder.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise Problem(f"the folder {str(folder)!r} cannot be made: {error.strerror}") from error
    return folder


def frames_of(scene: bpy.types.Scene) -> range:
    return range(scene.frame_start, scene.frame_end + 1, scene.frame_step)


def file_name(obj: bpy.types.Object, part: str, frame: int, kind: str = "redirect") -> str:
    """Blender counts the frames of a sequence by the last number in a name, so that the tile stands before it."""
    return f"{bpy.path.clean_name(obj.name)}.{kind}.{part}.{frame:0{4 + (frame < 0)}d}.exr"


def part_of(place: int | str, layer: int) -> str:
    """The part of a file's name for its content: a tile or all of them, and the layer, but for the first."""
    return f"{place}.layer{layer}" if layer else str(place)


def sequence(obj: bpy.types.Object, scene: bpy.types.Scene) -> tuple[list[str], int, int]:
    """The files of a bake with the scene's settings, for the node group: the first one of each layer, its frame, and
    the number of frames."""
    frames, image = frames_of(scene), obj.vrtm.image
    if frames.step != 1:
        raise Problem("Blender plays sequences without gaps only: bake with Step 1")
    if image is None:
        raise Problem(f"{obj.name} has no result image: press Update Now with the Image output on")
    layout = list(image[result_image.LAYOUT])
    place = "tiles" if layout[2:4] != [1, 1] else 1001 + layout[0] + 10 * layout[1]
    parts = [part_of(place, layer) for layer in range(image.get(layers.NUMBER, 1))]
    folder = Path(bpy.path.abspath(scene.vrtm_bake.directory))
    for frame in frames:
        for path in [folder / file_name(obj, part, frame) for part in parts]:
            if not path.is_file():
                raise Problem(f"{path} is not there: bake first")
    return [str(folder / file_name(obj, part, frames[0])) for part in parts], frames[0], len(frames)


class FrameBake:
    """The baking of frames for some objects: a step, and its file names, at a time."""

    def __init__(self, scene: bpy.types.Scene, objects: list[bpy.types.Object]) -> None:
        self.frames, self.kept = frames_of(scene), scene.frame_current
        self.overwrite = scene.vrtm_bake.overwrite
        self.uids = {obj.name: obj.session_uid for obj in objects}
        # Mesh and maps are read once.
        for obj in objects:
            states.state_of(obj).read_again()

    def steps(self) -> Iterator[tuple[int, list[Path]]]:
        """Goes to each frame and bakes it. The scene is left at the frame where it was, also if this is given up."""
        scene = bpy.context.scene
        # All of this stack is done at the end, the last first, also where another one fails.
        with contextlib.ExitStack() as end:
            for name in self.uids:
                end.push(partial(self._end, name))
            end.enter_context(session.during("baking"))
            end.callback(scene.frame_set, self.kept)
            self.begin()
            with evaluation(scene) as poses_of:
                for frame in self.frames:
                    scene.frame_set(frame)
                    objects = self.objects()
                    poses = zip(objects, poses_of(objects))
                    yield frame, [path for obj, pose in poses for path in self.bake(obj, pose, frame)]
            self.finish()

    def _end(self, name: str, failed: type | None, *_) -> None:
        if (obj := self._find(name)) is not None:
            # The viewport has settings of its own.
            live.touch(obj, mesh=False)
            if failed is not None:
                self.give_up(obj)

    def objects(self) -> list[bpy.types.Object]:
        """The objects, as they are now. Raises a Problem if one is gone."""
        for name in self.uids:
            if self._find(name) is None:
                raise Problem(f"{name} is gone: the bake ends")
        return list(filter(None, map(self._find, self.uids)))

    def _find(self, name: str) -> bpy.types.Object | None:
        obj = bpy.data.objects.get(name)
        return obj if obj is not None and obj.session_uid == self.uids[name] else None

    def begin(self) -> None:
        """Checks, before anything is written, that nothing of others is replaced. Raises a Problem."""

    def bake(self, obj: bpy.types.Object, pose: np.ndarray, frame: int) -> list[Path]:
        """Bakes a frame of an object, in the pose that a render has; returns the files."""
        raise NotImplementedError

    def finish(self) -> None:
        """After the last frame."""

    def give_up(self, obj: bpy.types.Object) -> None:
        """After a failure or an early end, for each object that is there."""


class Bake(FrameBake):
    """The baking of some objects' redirections."""

    def __init__(self, scene: bpy.types.Scene, objects: list[bpy.types.Object]) -> None:
        self.folder = folder_of(scene)
        super().__init__(scene, objects)

    def _prepared(self, obj: bpy.types.Object) -> tuple[vrtm.Asset, result_image.Layout, list[tuple[int | str, int]]]:
        """The object's asset, the layout of its tiles, and the parts with a file each: tiles by their numbers, or all
        of them, and their layers."""
        state = states.state_of(obj)
        state.end_job()
        solve.prepare(obj, state)
        layout = result_image.layout_of(state.asset, obj.name, solve.level_of(obj)[2])
        parts: list[tuple[int | str, int]] = [(tile.udim, tile.layer) for tile in state.asset.tiles]
        if (layout.columns, layout.rows) != (1, 1):
            parts += [("tiles", layer) for layer in range(layers.number_of(state.asset))]
        return state.asset, layout, parts

    def begin(self) -> None:
        outputs: list[tuple[str, str]] = []
        for obj in self.objects():
            check_name(obj)
            parts = self._prepared(obj)[2]
            outputs += [
                (str(self.folder / file_name(obj, part_of(*part), frame)), obj.name)
                for frame in self.frames
                for part in parts
            ]
        check_free(outputs, self.overwrite)
        self.planned = {path for path, _ in outputs}
        # Files that killed bakes have left.
        session.library("vrtm.bake.staging").sweep(str(self.folder))

    def bake(self, obj: bpy.types.Object, pose: np.ndarray, frame: int) -> list[Path]:
        asset, layout, parts = self._prepared(obj)
        asset.solve(pose, **solve.options_of(obj))
        images = [result_image.redirection(asset, layout, layer) for layer in range(layers.number_of(asset))]
        written = []
        for place, layer in parts:
            path = self.folder / file_name(obj, part_of(place, layer), frame)
            if str(path) not in self.planned:
                raise Problem(f"{obj.name} has other tiles at frame {frame} than at first")
            pixels = images[layer] if place == "tiles" else images[layer][layout.place(place)]
            facts = {"vrtm:form": "delta"} | ({} if place == "tiles" else {"vrtm:udim": place})
            save(pixels, path, obj, "redirect", frame, facts | ({"vrtm:layer": layer} if layer else {}))
            written.append(path)
        return written


def save(
    pixels: np.ndarray, path: Path, obj: bpy.types.Object, kind: str, frame: int, more: Mapping, halves: bool = False
) -> None:
    """Writes a picture, (height, width, 4) float32 with the bottom row first, as EXR: whole, or not at all. It says
    whose it is, and `more`. `halves`: in 16 bits."""
    # The kind is the mark by which a file is known as one that may be replaced.
    facts = {"vrtm:kind": kind, "vrtm:mesh": obj.name, "vrtm:frame": frame, "vrtm:version": session.library().version()}
    facts |= more
    try:
        session.library("vrtm.bake.staging").write_bytes(str(path), exr.file_of(pixels, facts, halves))
    except OSError as error:
        raise Problem(f"{path} cannot be written: {error.strerror or error}") from error


def check_name(obj: bpy.types.Object) -> None:
    """Raises a Problem if another object that is set up has the same names of files."""
    for other in bpy.data.objects:
        if other != obj and other.library is None and other.vrtm.is_set_up:
            if file_name(other, "", 0).casefold() == file_name(obj, "", 0).casefold():
                raise Problem(f"{obj.name}: its files have the names of those of {other.name}: rename one")


def check_free(outputs: list[tuple[str, str]], overwriting: bool) -> None:
    """Raises a Problem if an output, a path with the name of its object, replaces what is not a bake's, unless
    `overwriting`, or what the open file reads."""
    overwrite = session.library("vrtm.bake.overwrite")
    try:
        overwrite.check(outputs, _read_files(), overwriting)
    except overwrite.Conflict as conflict:
        hint = ": choose another folder, or switch Overwrite on" if conflict.replaceable else ""
        raise Problem(f"{conflict}{hint}") from conflict


def _read_files() -> list[tuple[str, str]]:
    """The files that the open file is made of, and the name of each to the artist. Baked files that a node group reads
    are no inputs of a bake."""
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
