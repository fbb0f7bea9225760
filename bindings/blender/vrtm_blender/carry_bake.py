"""Bakes carried things: keys of objects as a whole, and a file per frame of the points of others, which the carry
modifier reads without this add-on."""

from __future__ import annotations

from pathlib import Path

import bpy
import numpy as np

from . import carry, carry_nodes, geometry, solve, states
from .bake import FrameBake, check_free, file_name, folder_of, save
from .carriers import Moved
from .messages import Problem

# Texels per row of a file at most.
WIDTH = 4096
KIND = "carried"


def layout(number: int) -> tuple[int, int]:
    """Columns, and rows of places; those of turns are above them."""
    columns = min(number, WIDTH)
    return columns, -(-number // columns)


def texels(number: int) -> np.ndarray:
    """The texels of each point in a file: u, v of its place, and v of its turn, (number, 3)."""
    columns, rows = layout(number)
    index = np.arange(number)
    v = (index // columns + 0.5) / (2 * rows)
    return np.stack([(index % columns + 0.5) / columns, v, v + 0.5], -1)


def picture(places: np.ndarray, turns: np.ndarray) -> np.ndarray:
    columns, rows = layout(len(places))
    pixels = np.zeros((2, rows * columns, 4), np.float32)
    pixels[..., 3] = 1
    for half, values in zip(pixels, (places, turns)):
        half[: len(values), :3] = values
    return pixels.reshape(2 * rows, columns, 4)


class Bake(FrameBake):
    """The baking of the things that some objects carry. If it is given up, they are live as before."""

    def __init__(self, scene: bpy.types.Scene, skins: list[bpy.types.Object]) -> None:
        super().__init__(scene, skins)
        self.things = {skin.name: [obj.name for obj in carry.carried_by(skin)] for skin in skins}
        points = [obj for skin in skins for obj in self._points(skin)]
        if points and self.frames.step != 1:
            raise Problem("Blender plays sequences without gaps only: bake with Step 1")
        # Keys alone need no folder.
        self.folder = folder_of(scene) if points else Path()

    def _path(self, obj: bpy.types.Object, frame: int) -> Path:
        return self.folder / file_name(obj, "points", frame, KIND)

    def finish(self) -> None:
        for skin in self.objects():
            skin.vrtm.carried_baked = True
            for obj in self._points(skin):
                carry_nodes.show_baked(obj, str(self._path(obj, self.frames[0])), self.frames[0], self.frames[-1])

    def give_up(self, skin: bpy.types.Object) -> None:
        live_again(skin)

    def _things(self, skin: bpy.types.Object) -> list[bpy.types.Object]:
        for name in self.things[skin.name]:
            if name not in bpy.data.objects:
                raise Problem(f"{name} is gone: the bake ends")
        return [bpy.data.objects[name] for name in self.things[skin.name]]

    def _points(self, skin: bpy.types.Object) -> list[bpy.types.Object]:
        return [obj for obj in self._things(skin) if obj.vrtm_carry.kind == "POINTS"]

    def begin(self) -> None:
        # Things do not show an earlier bake any more, and are bound where they are seen now.
        for skin in self.objects():
            live_again(skin)
            if any(map(carry.is_moved, self._things(skin))):
                solve.run(skin, bpy.context.evaluated_depsgraph_get())
            for obj in self._points(skin):
                values = texels(len(carry.own_places(obj)))
                geometry.write(obj.data, carry_nodes.TEXEL, carry.domain_of(obj), "FLOAT_VECTOR", values)
        points = [obj for skin in self.objects() for obj in self._points(skin)]
        outputs = [(str(self._path(obj, frame)), obj.name) for obj in points for frame in self.frames]
        if len({path.casefold() for path, _ in outputs}) < len(outputs):
            raise Problem("two carried objects have names that make the same file names: rename one")
        check_free(outputs, self.overwrite)

    def bake(self, skin: bpy.types.Object, pose: np.ndarray, frame: int) -> list[Path]:
        state = states.state_of(skin)
        solve.prepare(skin, state)
        state.asset.solve(pose, **solve.options_of(skin))
        moved, written = state.prepared.carriers.fetch(), []
        for obj in self._things(skin):
            own = moved.get(obj.session_uid)
            if own is None:
                continue
            if obj.vrtm_carry.kind == "OBJECT":
                _key(obj, own, frame)
                continue
            written.append(self._path(obj, frame))
            save(picture(own.places, own.turns), written[-1], skin, KIND, frame, {})
        return written


def _key(obj: bpy.types.Object, moved: Moved, frame: int) -> None:
    """Keys of an object as a whole. Of the ways to write a rotation it is the one next to that of the frame before."""
    before_euler, before_quaternion = obj.rotation_euler.copy(), obj.rotation_quaternion.copy()
    matrix = obj.matrix_basis = carry.basis(obj, moved)
    channel = "rotation_euler"
    if obj.rotation_mode == "QUATERNION":
        channel = "rotation_quaternion"
        obj.rotation_quaternion.make_compatible(before_quaternion)
    elif obj.rotation_mode == "AXIS_ANGLE":
        channel = "rotation_axis_angle"
    else:
        obj.rotation_euler = matrix.to_euler(obj.rotation_mode, before_euler)
    for name in ("location", channel, "scale"):
        obj.keyframe_insert(name, frame=frame)
    obj.animation_data.action[carry.BAKED] = True


def live_again(skin: bpy.types.Object) -> None:
    """Has the things that an object carries follow it again, in place of a bake."""
    skin.vrtm.carried_baked = False
    for obj in carry.carried_by(skin):
        carry.clear_baked(obj)
    states.state_of(skin).rewrite = True
