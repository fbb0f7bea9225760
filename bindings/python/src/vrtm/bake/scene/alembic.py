"""Alembic: the meshes of an archive, and their faces, UVs, rest and poses.

Frame N is at N / fps seconds, in the file's own rate by default; between two samples, positions are interpolated.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator
from typing import Any

import numpy as np

from vrtm.bake.left_out import LeftOut
from vrtm.bake.scene.alembic_file import UV_KINDS, AlembicFile, AlembicMesh
from vrtm.bake.scene.axes import Axes
from vrtm.bake.scene.obj import rest_from_file
from vrtm.bake.scene.posed import PosedMesh, PosedSource
from vrtm.bake.scene.refine import Cage
from vrtm.bake.scene.timing import FILE, Clock, is_between, is_whole
from vrtm.bake.scene.topology import check_mesh, corner_elements, per_vertex, whole_frames
from vrtm.bake.scene.types import SceneError, SceneOptions, Shape, frame_number


class AlembicSource(PosedSource["AlembicShape"]):
    """The meshes of an archive. See `vrtm.bake.scene.Scene`."""

    def __init__(self, path: str, options: SceneOptions) -> None:
        super().__init__(path, options)
        self.codes, self.axes = 1.0, Axes()
        if isinstance(options.fps, (int, float)) and not options.fps > 0:
            raise SceneError(f"{path}: {options.fps} frames per second")
        self.files = (path,)
        self._file = AlembicFile(path)
        self._others: list[AlembicMesh] = []
        chosen = self._chosen()
        moving = [mesh for mesh, _ in chosen if mesh.times(options.world)]
        self.clock = self._clocked(moving)
        by_file = options.fps in (None, FILE)
        odd = self._beside_frames(moving)
        self.warnings += odd if by_file else []
        told = [", as the file has"] if by_file else [f"; {line}" for line in odd[:1]]
        self.rate = f"{self.clock.frames:.6g} per second{''.join(told)}"
        seconds = [mesh.times(options.world) for mesh in moving]
        times = [time for own in seconds for time in (own[0], own[-1])] or [self.clock.time(1)]
        frame = self.clock.frame
        self.frames = whole_frames(frame(min(times)), frame(max(times)), path, self.warnings, self.left_out)
        groups: dict[tuple[str, ...], list[AlembicShape]] = {}
        for mesh, uvs in chosen:
            posed = AlembicShape(mesh, uvs, self)
            # As long as they are scaled alike.
            identity = (mesh.origin, posed.scaled_alike() if options.world else "")
            groups.setdefault(identity, []).append(posed)
        self._take(list(groups.values()))

    def _clocked(self, meshes: list[AlembicMesh]) -> Clock:
        """The clock of the samples of meshes."""
        world = self.options.world
        rates = [(mesh, *mesh.rate(world)) for mesh in meshes]
        own = Counter(found for _, found, _ in rates if found)
        fps = self.options.fps
        if not isinstance(fps, (int, float)):
            hint = self._file.rate
            fits = hint is not None and all(is_whole(max(hint / found, found / hint)) for found in own)
            # The slower of two equally frequent rates: the samples of the other lie between its frames.
            fps = hint if fits else min(own, key=lambda found: (-own[found], found), default=24.0)
            guessed = None if fits else next((mesh for mesh, found, guess in rates if guess and found == fps), None)
            if guessed is not None:
                start, end = guessed.times(world)[:2]
                told = f"its {1 / (end - start):.4g} samples per second are taken for {fps:g} frames"
                self.warnings.append(f"{guessed.path}: {told}: --fps says otherwise")
        return Clock(1.0, fps)

    def _beside_frames(self, meshes: list[AlembicMesh]) -> list[str]:
        """A sentence for each mesh whose samples lie between frames."""
        told, fps, world = [], self.clock.frames, self.options.world
        for mesh in meshes:
            found, frames = mesh.rate(world)[0], [second * fps for second in mesh.times(world)]
            if found is not None and not is_whole(max(found / fps, fps / found)):
                told.append(f"{mesh.path}: it has {found:.4g} samples per second, but there are {fps:g} frames")
            elif is_between(frames):
                odd = next(frame for frame in frames if not is_whole(frame))
                told.append(f"{mesh.path}: at {fps:g} per second, samples lie between frames, such as at {odd:.6g}")
        return told

    def _chosen(self) -> list[tuple[AlembicMesh, Any]]:
        options, chosen = self.options, []
        for mesh in self._file.meshes():
            if not self._takes(mesh.path):
                self._others.append(mesh)
                continue
            if mesh.hidden:
                self._leave_out(mesh.path, "is hidden", True)
                continue
            sets = (mesh.uvs(name) for name in options.uv or (None,))
            uvs = next((found for found in sets if found is not None), None)
            if uvs is None:
                self._others.append(mesh)
                there = ", ".join(name for name in mesh.params() if mesh.param(name, UV_KINDS))
                reason = f"has no UVs{options.uv_text}{f', but {there}' if there else ''}"
                self._leave_out(mesh.path, reason, mesh.is_still(options))
            else:
                chosen.append((mesh, uvs))
        unread = (path for path in self._file.unread if not self._why_not(path))
        self.left_out += [LeftOut("is a NURBS surface, which is not read", path) for path in unread]
        self._check_chosen(chosen)
        return chosen

    def _unbaked(self) -> Iterator[AlembicShape]:
        shown = (mesh for mesh in self._others if not mesh.hidden)
        return (AlembicShape(mesh, (None,) * 4, self) for mesh in shown)

    def close(self) -> None:
        self._meshes.clear()
        self._file = None


class AlembicShape(PosedMesh):
    """A mesh of an archive as the library takes it, and its poses."""

    def __init__(self, mesh: AlembicMesh, uvs: Any, source: AlembicSource) -> None:
        super().__init__(mesh.path, source)
        self._mesh = mesh
        self._uvs, self._elements, self._interpolation, self._uv_name = uvs

    def shape(self, name: str, instances: tuple[str, ...]) -> Shape:
        self.read_faces()
        with self._naming(f"the UV set {self._uv_name}"):
            corners = corner_elements(self._interpolation, *self._faces, self._points, self._elements)
        if corners.max(initial=-1) >= len(self._uvs):
            raise SceneError(f"{self.where}: the UV set {self._uv_name} names a UV that it does not have")
        return self._shape(
            name,
            instances,
            self._faces,
            (self._uvs, corners),
            self._subd("Holes", np.int64),
            [self._values(primvar) for primvar in (self._options.rigidity_primvar, self._options.mask_primvar)],
            self._cage if hasattr(self._mesh.schema, "getCreaseIndicesProperty") else None,
            uv_name=self._uv_name,
            # As RenderMan has them.
            left_handed=True,
        )

    def read_faces(self) -> None:
        self._faces = self._mesh.faces(0)
        self._points = len(self._mesh.sample(0))
        check_mesh(self.where, *self._faces, self._points)

    @property
    def deforms(self) -> bool:
        return not self._mesh.is_still(self._options)

    @property
    def is_moved(self) -> bool:
        return self._mesh.is_moved

    def primvars(self) -> list[str]:
        return self._mesh.params()

    def _matrix(self, frame: float) -> np.ndarray:
        return self._mesh.to_world(self._clock.time(frame))

    def _posed(self, frame: float) -> np.ndarray:
        points = self._mesh.at(self._clock.time(frame), self._faces)
        if len(points) != self._points:
            raise SceneError(f"{self.where}: frame {frame:g} has {len(points)} vertices, the first {self._points}")
        return points

    def _found_rest(self, wanted: str | None) -> tuple[np.ndarray, str]:
        if wanted in (None, "pref"):
            found = self._parameter("Pref", ("P3f", "V3f", "P3d", "V3d"))
            if found is not None and len(found[0]) == self._points:
                return found[0], "Pref"
            if wanted == "pref":
                raise SceneError(f"{self.where}: no parameter Pref holds a rest position per vertex")
        if wanted == "bind":
            raise SceneError(f"{self.where}: Alembic has no skeletons, so that there is no bind pose")
        if wanted in (None, "first"):
            return self._posed(self._frames[0]), f"first frame {self._frames[0]}"
        if wanted.startswith("frame:"):
            return self._posed(frame_number(wanted)), wanted
        # Alembic has no units, to which those of the rest could be compared.
        return rest_from_file(wanted, self.path, *self._faces, self._points)[0], wanted

    def _values(self, name: str | None) -> np.ndarray | None:
        found = name and self._parameter(name, ("Float", "Half", "Double", "C3f", "C4f", "V3f"))
        if not found:
            return None
        with self._naming(name):
            return per_vertex(*found, *self._faces, self._points)

    def _parameter(self, name: str, kinds: tuple[str, ...]) -> tuple[np.ndarray, str] | None:
        """A geometry parameter's values, and their interpolation; None if there is none of one of these types."""
        found = self._mesh.param(name, kinds)
        if found is not None and found[1].max(initial=-1) >= len(found[0]):
            raise SceneError(f"{self.where}: {name} names a value that it does not have")
        return None if found is None else (found[0][found[1]], found[2])

    def _subd(self, what: str, kind: type) -> np.ndarray:
        """Values of a property that subdivision surfaces alone have; empty where it is absent."""
        get = getattr(self._mesh.schema, f"get{what}Property", None)
        found = get() if get else None
        return np.array(found.getValue(), kind) if found is not None and found.valid() else np.zeros(0, kind)

    def _cage(self) -> Cage:
        def number(what: str) -> int:
            found = getattr(self._mesh.schema, f"get{what}Property")()
            return int(found.getValue()) if found.valid() and found.getNumSamples() else 1

        scheme = self._mesh.schema.getSubdivisionSchemeProperty()
        name = str(scheme.getValue()) if scheme.valid() and scheme.getNumSamples() else "catmull-clark"
        counts, indices = self._faces
        return Cage(
            where=self.where,
            scheme={"catmull-clark": "catmullClark"}.get(name, name),
            counts=counts,
            indices=indices,
            points=self._points,
            boundary={0: "none", 2: "edgeOnly"}.get(number("InterpolateBoundary"), "edgeAndCorner"),
            face_varying={0: "all", 2: "none", 3: "boundaries"}.get(
                number("FaceVaryingInterpolateBoundary"), "cornersPlus1"
            ),
            crease_lengths=self._subd("CreaseLengths", np.int64),
            crease_indices=self._subd("CreaseIndices", np.int64),
            crease_sharpnesses=self._subd("CreaseSharpnesses", np.float64),
            corner_indices=self._subd("CornerIndices", np.int64),
            corner_sharpnesses=self._subd("CornerSharpnesses", np.float64),
            uv_per_vertex=self._interpolation == "vertex",
        )
