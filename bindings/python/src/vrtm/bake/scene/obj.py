"""Wavefront OBJ: a mesh at rest from one file, and a file for each pose."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from vrtm.bake.left_out import LeftOut
from vrtm.bake.scene.obj_file import read_obj
from vrtm.bake.scene.poses import find_poses
from vrtm.bake.scene.rest import rest_from_file
from vrtm.bake.scene.timing import Clock
from vrtm.bake.scene.topology import check_faces, luminance, unique_names
from vrtm.bake.scene.types import SceneError, SceneOptions, Shape, frame_number


class ObjSource:
    """One shape. See `vrtm.bake.scene.Scene`."""

    def __init__(self, path: str, options: SceneOptions) -> None:
        self.warnings: list[str] = []
        self.left_out: list[LeftOut] = []
        self.has_subframes = False
        self.clock, self.rate = Clock(), ""
        self._mesh = read_obj(path)
        self._last: dict[str, np.ndarray] = {}
        if len(self._mesh.counts) == 0:
            raise SceneError(f"{path}: no faces")
        for name in options.meshes:
            self.warnings.append(f"{path}: an OBJ file is taken as one mesh, whatever --meshes says ({name})")
        if options.world:
            raise SceneError(f"{path}: an OBJ file has no transforms above its mesh, which --world asks for")
        if options.fps is not None:
            raise SceneError(f"{path}: poses from OBJ files have numbers and no times, which --fps asks for")
        if options.uv_names:
            raise SceneError(
                f"{path}: an OBJ file has one UV set without a name, so that '{options.uv_names[0]}' cannot be chosen"
            )
        if (self._mesh.uv_indices < 0).all():
            raise SceneError(f"{path}: no faces with UVs (vt)")
        if options.subdivide:
            raise SceneError(
                f"{path}: an OBJ file does not say that it is a subdivision surface: it cannot be subdivided"
            )
        if not options.poses:
            self.warnings.append(f"{path}: without --poses, its own shape is the only pose")
        self._poses = find_poses(options.poses, self.warnings, self.left_out) if options.poses else {1: path}
        self.frames = tuple(sorted(self._poses))
        self.files = (path, *self._poses.values())
        self._path = path
        name = unique_names([Path(path).stem])[0]
        rest, rest_from = self._mesh.positions, path
        if options.rest is not None:
            rest_from = options.rest
        if options.rest == "first":
            rest, rest_from = self._read(self.frames[0]), f"first frame {self.frames[0]}"
        elif options.rest is not None and options.rest.startswith("frame:"):
            rest = self._read(frame_number(options.rest))
        elif options.rest in ("bind", "pref"):
            raise SceneError(f"{path}: an OBJ file has no rest pose of the kind '{options.rest}'")
        elif options.rest is not None:
            rest, _ = rest_from_file(options.rest, path, self._mesh.counts, self._mesh.indices, len(rest))
        self.shapes = (
            Shape(
                name=name,
                path=path,
                rest=rest,
                face_counts=self._mesh.counts,
                indices=self._mesh.indices,
                uvs=self._mesh.uvs,
                uv_indices=self._mesh.uv_indices,
                uv_name="vt",
                vertex_rigidity=self._colours(options.rigidity_primvar),
                vertex_mask=self._colours(options.mask_primvar),
                instances=(path,),
                rest_from=rest_from,
            ),
        )

    def _colours(self, name: str | None) -> np.ndarray | None:
        if name is None:
            return None
        if name != "colors":
            raise SceneError(f"{self._path}: an OBJ file has no values per vertex but 'colors', not '{name}'")
        if self._mesh.colours is None:
            raise SceneError(f"{self._path}: not all vertices have a colour (v x y z r g b)")
        return luminance(self._mesh.colours).astype(np.float32)

    def _read(self, frame: float) -> np.ndarray:
        if frame not in self._poses:
            raise SceneError(f"{self._path}: there is no pose {frame:g}, only {self.frames[0]} to {self.frames[-1]}")
        path = self._poses[int(frame)]
        if path not in self._last:
            # One of them, which is asked for several times before the next: text takes long to read.
            self._last = {path: self._read_file(path)}
        return self._last[path]

    def _read_file(self, path: str) -> np.ndarray:
        pose = self._mesh if path == self._path else read_obj(path)
        if len(pose.positions) != len(self._mesh.positions):
            raise SceneError(
                f"{path}: {len(pose.positions)} vertices, but the rest mesh has {len(self._mesh.positions)}"
            )
        if len(pose.counts):
            check_faces(path, pose.counts, pose.indices, self._mesh.counts, self._mesh.indices)
        return pose.positions

    def positions(self, shape: Shape, frame: float) -> np.ndarray:
        """(vertices, 3) f64 of the pose's file; its faces, where it has some, must be those of the rest mesh."""
        return self._read(frame)

    def close(self) -> None:
        """Nothing stays open."""
