"""Alembic: which meshes of an archive are shapes, and where they are frame by frame.

Frame N is at N / fps seconds, in the file's own rate by default; between two samples, positions are interpolated.
"""

from __future__ import annotations

from collections import Counter
from typing import Any

import numpy as np

from vrtm.bake.left_out import LeftOut
from vrtm.bake.scene.alembic_file import AlembicFile, AlembicMesh
from vrtm.bake.scene.alembic_shape import AlembicShape
from vrtm.bake.scene.posed import shapes, unknown
from vrtm.bake.scene.timing import FILE, Clock, is_between, is_whole
from vrtm.bake.scene.topology import matches, whole_frames
from vrtm.bake.scene.types import SceneError, SceneOptions, Shape


class AlembicSource:
    """The meshes of an archive. See `vrtm.bake.scene.Scene`."""

    def __init__(self, path: str, options: SceneOptions) -> None:
        self.warnings: list[str] = []
        self.left_out: list[LeftOut] = []
        self.has_subframes = True
        if isinstance(options.fps, (int, float)) and not options.fps > 0:
            raise SceneError(f"{path}: {options.fps} frames per second")
        self._path, self._options = path, options
        self.files = (path,)
        self._file = AlembicFile(path)
        chosen = self._chosen()
        moving = [mesh for mesh, _ in chosen if mesh.times(options.world)]
        self.clock = self._clocked(moving)
        self.rate = f"{self.clock.frames:.6g} per second{', as the file has' if options.fps in (None, FILE) else ''}"
        seconds = [mesh.times(options.world) for mesh in moving]
        times = [time for own in seconds for time in (own[0], own[-1])] or [self.clock.time(1)]
        # Times are stored as whole numbers of 1 / fps only nearly.
        frame = self.clock.frame
        self.frames = whole_frames(frame(min(times)), frame(max(times)), path, self.warnings, self.left_out, 1e-3)
        groups: dict[tuple[str, ...], list[AlembicShape]] = {}
        for mesh, uvs in chosen:
            posed = AlembicShape(mesh, uvs, options, self.frames, self.clock)
            # As long as they are scaled alike.
            identity = (mesh.origin, posed.scaled_alike() if options.world else "")
            groups.setdefault(identity, []).append(posed)
        found = [(group[0], tuple(instance.path for instance in group)) for group in groups.values()]
        self.shapes, self._meshes = shapes(path, found, options, self.warnings, self.left_out)

    def _clocked(self, meshes: list[AlembicMesh]) -> Clock:
        """The clock of the samples of meshes, with warnings of those that it does not fit."""
        world = self._options.world
        rates = [(mesh, *mesh.rate(world)) for mesh in meshes]
        own = Counter(found for _, found, _ in rates if found)
        fps = self._options.fps
        if not isinstance(fps, (int, float)):
            hint = self._file.rate
            fits = hint is not None and all(is_whole(max(hint / found, found / hint)) for found in own)
            # Of equally many the slower ones: samples of the others lie between their frames.
            fps = hint if fits else min(own, key=lambda found: (-own[found], found), default=24.0)
            guessed = None if fits else next((mesh for mesh, found, guess in rates if guess and found == fps), None)
            if guessed is not None:
                start, end = guessed.times(world)[:2]
                told = f"its {1 / (end - start):.4g} samples per second are taken for {fps:g} frames"
                self.warnings.append(f"{guessed.path}: {told}: --fps says otherwise")
        for mesh, found, _ in rates:
            path, frames = mesh.path, [second * fps for second in mesh.times(world)]
            if found is not None and not is_whole(max(found / fps, fps / found)):
                self.warnings.append(f"{path}: it has {found:.4g} samples per second, but there are {fps:g} frames")
            elif is_between(frames):
                odd = next(frame for frame in frames if not is_whole(frame))
                self.warnings.append(f"{path}: at {fps:g} per second, samples lie between frames, such as at {odd:.6g}")
        return Clock(1.0, fps)

    def _chosen(self) -> list[tuple[AlembicMesh, Any]]:
        options, met, chosen = self._options, set(), []
        for mesh in self._file.meshes():
            patterns = [pattern for pattern in options.meshes if matches(pattern, mesh.path)]
            if options.meshes and not patterns:
                self.left_out.append(LeftOut("not named by --meshes", mesh.path, meant=True))
                continue
            met.update(patterns)
            if mesh.hidden:
                self.left_out.append(LeftOut("is hidden", mesh.path, meant=True))
                if options.names(mesh.path):
                    raise SceneError(f"{mesh.where}: is hidden")
                continue
            sets = (mesh.uvs(name) for name in options.uv_names or (None,))
            uvs = next((found for found in sets if found is not None), None)
            if uvs is None:
                why = f"has no UVs{options.uv_text}"
                self.left_out.append(LeftOut(why, mesh.path, meant=mesh.is_still(options)))
                if options.names(mesh.path):
                    raise SceneError(f"{mesh.where}: {why}")
            else:
                chosen.append((mesh, uvs))
        self.left_out += [
            LeftOut("is a NURBS surface, which is not read", path)
            for path in self._file.unread
            if not options.meshes or any(matches(pattern, path) for pattern in options.meshes)
        ]
        for pattern in options.meshes:
            if pattern not in met:
                raise unknown(self._path, pattern, [mesh.path for mesh in self._file.meshes()])
        if not chosen:
            why = "; ".join(f"{entry.mesh} {entry.why}" for entry in self.left_out[:5])
            raise SceneError(f"{self._path}: no mesh to bake ({why or 'the scene has none'})")
        return chosen

    def positions(self, shape: Shape, frame: float) -> np.ndarray:
        """(vertices, 3) f32 of the shape at a frame."""
        return self._meshes[shape.name].positions(frame)

    def to_world(self, shape: Shape, frame: float | None) -> np.ndarray:
        """(4, 4) by which rows of the shape's positions at a frame, or of its rest, are multiplied to lie in the
        world."""
        mesh = self._meshes[shape.name]
        return mesh.to_world(mesh.rest_frame if frame is None else frame)

    def rest_frame(self, shape: Shape) -> float:
        """The frame whose transforms lie above the rest."""
        return self._meshes[shape.name].rest_frame

    def close(self) -> None:
        """Lets go of the archive."""
        self._meshes.clear()
        self._file = None
