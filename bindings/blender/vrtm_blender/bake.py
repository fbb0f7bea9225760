"""Bakes a range of frames to EXR files: of each tile, and of all tiles in one image, as the node group reads it."""

from __future__ import annotations

import os
from collections.abc import Iterator
from pathlib import Path

import bpy
import numpy as np

from . import geometry, results, session, solve
from .messages import Problem

KINDS = {"delta": "redirection_delta", "udim": "redirection_udim", "tile": "redirection"}


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
    settings = scene.vrtm_bake
    frames = range(settings.frame_start, settings.frame_end + 1, settings.frame_step)
    if not frames:
        raise Problem(f"there is no frame from {settings.frame_start} to {settings.frame_end}")
    return frames


def file_name(obj: bpy.types.Object, part: int | str, frame: int) -> str:
    """Blender counts the frames of a sequence by the last number in a name, so that the tile stands before it."""
    return f"{bpy.path.clean_name(obj.name)}.redirect.{part}.{frame:04d}.exr"


def sequence(obj: bpy.types.Object, scene: bpy.types.Scene) -> tuple[str, int, int]:
    """What the node group reads of a bake with the scene's settings: the first file, its frame, and how many there
    are."""
    settings, frames = scene.vrtm_bake, frames_of(scene)
    if settings.form != "delta":
        raise Problem("the node group reads bakes of the form Delta")
    if settings.frame_step != 1:
        raise Problem("Blender plays sequences without gaps only: bake with Step 1")
    image = obj.vrtm.image
    if image is None:
        raise Problem(f"{obj.name} has no result image: press Update Now with the Image output on")
    layout = list(image[results.LAYOUT])
    part = "tiles" if layout[2:4] != [1, 1] else 1001 + layout[0] + 10 * layout[1]
    folder = Path(bpy.path.abspath(settings.directory))
    for frame in frames:
        path = folder / file_name(obj, part, frame)
        if not path.is_file():
            raise Problem(f"{path} is not there: bake first")
    return str(folder / file_name(obj, part, frames[0])), frames[0], len(frames)


class Bake:
    """The baking of some objects' frames: a step, and its file names, at a time."""

    def __init__(self, scene: bpy.types.Scene, objects: list[bpy.types.Object]) -> None:
        self.folder, self.frames = folder_of(scene), frames_of(scene)
        self.form = scene.vrtm_bake.form
        self.uids = [session.uid_of(obj) for obj in objects]
        self.names = [obj.name for obj in objects]
        self.kept = scene.frame_current
        # Mesh and maps are read once.
        for obj in objects:
            state = session.state_of(obj)
            state.mesh_changed = state.maps_changed = True

    def steps(self) -> Iterator[tuple[int, list[Path]]]:
        """Goes to each frame and writes it. The scene is left at the frame where it was, also if this is given up."""
        scene = bpy.context.scene
        session.baking = True
        try:
            for frame in self.frames:
                scene.frame_set(frame)
                depsgraph = bpy.context.evaluated_depsgraph_get()
                written: list[Path] = []
                for uid, name in zip(self.uids, self.names):
                    obj = bpy.data.objects.get(name)
                    if obj is None or session.uid_of(obj) != uid:
                        raise Problem(f"{name} is gone: the bake ends at frame {frame}")
                    written += self._write(obj, depsgraph, frame)
                yield frame, written
        finally:
            scene.frame_set(self.kept)
            session.baking = False

    def _write(self, obj: bpy.types.Object, depsgraph: bpy.types.Depsgraph, frame: int) -> list[Path]:
        state = session.state_of(obj)
        state.end_job()
        solve.prepare(obj, state)
        state.asset.solve(geometry.pose(obj, depsgraph), **solve.options_of(obj))
        layout = results.layout_of(state.asset, obj.name, obj.vrtm.map_size)
        size = (layout.size, layout.size)
        written = []
        for tile in state.asset.tiles:
            pixels = np.zeros((layout.size, layout.size, 4), np.float32)
            pixels[..., 3] = 1
            pixels[..., :2] = tile.fetch(KINDS[self.form], size, channels=2, origin="bottom")
            written.append(self.folder / file_name(obj, tile.udim, frame))
            save(pixels, written[-1])
        if self.form == "delta" and (layout.columns, layout.rows) != (1, 1):
            written.append(self.folder / file_name(obj, "tiles", frame))
            save(results.redirection(state.asset, layout), written[-1])
        return written


def save(pixels: np.ndarray, path: Path) -> None:
    """Writes a picture, (height, width, 4) float32 with the bottom row first, as EXR by Blender's own means: to a
    name beside the file's, which then takes its place, so that no file is ever half written."""
    height, width = pixels.shape[:2]
    image = bpy.data.images.new("vrtm bake", width, height, alpha=True, float_buffer=True, is_data=True)
    partial = path.with_name(f".{path.stem}.part.exr")
    try:
        image.alpha_mode, image.file_format = "CHANNEL_PACKED", "OPEN_EXR"
        image.pixels.foreach_set(np.ascontiguousarray(pixels).ravel())
        try:
            image.save(filepath=str(partial))
            os.replace(partial, path)
        except (RuntimeError, OSError) as error:
            raise Problem(f"{path} cannot be written: {' '.join(str(error).split())}") from error
    finally:
        bpy.data.images.remove(image)
        partial.unlink(missing_ok=True)
