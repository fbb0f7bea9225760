"""A mesh of an Alembic archive: its faces, UVs, rest and poses, refined if that is asked for."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from vrtm.bake.scene.alembic_file import AlembicMesh
from vrtm.bake.scene.posed import PosedMesh
from vrtm.bake.scene.refine import Cage
from vrtm.bake.scene.rest import rest_from_file
from vrtm.bake.scene.timing import Clock
from vrtm.bake.scene.topology import check_mesh, corner_elements, per_vertex
from vrtm.bake.scene.types import SceneError, SceneOptions, Shape, frame_number


class AlembicShape(PosedMesh):
    """A mesh of an archive as the library takes it, and its poses."""

    def __init__(self, mesh: AlembicMesh, uvs: Any, options: SceneOptions, frames: Sequence[int], clock: Clock) -> None:
        super().__init__(mesh.where, mesh.path, frames, options)
        self._mesh, self._clock = mesh, clock
        self._uvs, self._elements, self._interpolation, self._uv_name = uvs

    def shape(self, name: str, instances: tuple[str, ...]) -> Shape:
        self._faces = self._mesh.faces(0)
        self._points = len(self._mesh.sample(0))
        check_mesh(self.where, *self._faces, self._points)
        try:
            corners = corner_elements(self._interpolation, *self._faces, self._points, self._elements)
        except ValueError as error:
            raise SceneError(f"{self.where}: the UV set {self._uv_name} has {error}") from error
        if corners.max(initial=-1) >= len(self._uvs):
            raise SceneError(f"{self.where}: the UV set {self._uv_name} names a UV that it does not have")
        return self._shape(
            name,
            instances,
            self._faces,
            (self._uvs.reshape(-1, 2), corners),
            self._subd("Holes", np.int64),
            [self._values(primvar) for primvar in (self._options.rigidity_primvar, self._options.mask_primvar)],
            self._cage if hasattr(self._mesh.schema, "getCreaseIndicesProperty") else None,
            uv_name=self._uv_name,
        )

    @property
    def deforms(self) -> bool:
        return not self._mesh.is_still(self._options)

    @property
    def is_moved(self) -> bool:
        return self._mesh.is_moved

    def primvars(self) -> list[str]:
        return self._mesh.params()

    def to_world(self, frame: float) -> np.ndarray:
        """(4, 4) f64, by which rows of positions of a frame are multiplied to lie in the world."""
        matrix = self._mesh.to_world(self._clock.time(frame))
        if self._options.world:
            # They have the linear part.
            matrix[:3, :3] = np.eye(3)
        return matrix

    def _linear(self, frame: float) -> np.ndarray:
        return self._mesh.to_world(self._clock.time(frame))[:3, :3]

    def _posed(self, frame: float) -> np.ndarray:
        points = self._mesh.at(self._clock.time(frame), self._faces)
        if len(points) != self._points:
            raise SceneError(f"{self.where}: frame {frame:g} has {len(points)} vertices, the first {self._points}")
        return points

    def _found_rest(self, wanted: str | None) -> tuple[np.ndarray, str]:
        if wanted in (None, "pref"):
            found = self._mesh.param("Pref", ("P3f", "V3f", "P3d", "V3d"))
            if found is not None and len(found[1]) == self._points:
                return found[0][found[1]], "Pref"
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
        found = name and self._mesh.param(name, ("Float", "Half", "Double", "C3f", "C4f", "V3f"))
        if not found:
            return None
        values, elements, interpolation = found
        try:
            return per_vertex(values[elements], interpolation, *self._faces, self._points)
        except ValueError as error:
            raise SceneError(f"{self.where}: {name} has {error}") from error

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
