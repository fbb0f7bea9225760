"""A mesh of an Alembic archive: its faces, UVs, rest and poses, refined if that is asked for."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from vrtm.bake.scene.refine import Cage, Refined
from vrtm.bake.scene.rest import rest_from_file
from vrtm.bake.scene.timing import Clock
from vrtm.bake.scene.topology import check_mesh, corner_elements, per_vertex, without_uvs
from vrtm.bake.scene.types import SceneError, SceneOptions, Shape, frame_number
from vrtm.bake.scene.world import placed, uneven_scale

if TYPE_CHECKING:
    from vrtm.bake.scene.alembic import AlembicMesh


class AlembicShape:
    """A mesh of an archive as the library takes it, and its poses."""

    def __init__(self, mesh: AlembicMesh, uvs: Any, options: SceneOptions, first: int, clock: Clock) -> None:
        self._mesh, self._options, self._first, self._clock = mesh, options, first, clock
        self._faces = mesh.faces(0)
        self._points = len(mesh.sample(0))
        self._refined: Refined | None = None
        check_mesh(mesh.where, *self._faces, self._points)
        values, elements, self._interpolation, self._uv_name = uvs
        try:
            corners = corner_elements(self._interpolation, *self._faces, self._points, elements)
        except ValueError as error:
            raise SceneError(f"{mesh.where}: the UV set {self._uv_name} has {error}") from error
        if corners.max(initial=-1) >= len(values):
            raise SceneError(f"{mesh.where}: the UV set {self._uv_name} names a UV that it does not have")
        holes = self._subd("Holes", np.int64)
        if ((holes < 0) | (holes >= len(self._faces[0]))).any():
            raise SceneError(f"{mesh.where}: a hole names a face that the mesh does not have")
        self._uvs, self._uv_indices = values.reshape(-1, 2), without_uvs(self._faces[0], corners, holes)
        self._holes, self._with_holes = holes, without_uvs(self._faces[0], corners)

    def shape(self, name: str, instances: tuple[str, ...]) -> Shape:
        counts, indices = self._faces
        rigidity, mask = (self._values(n) for n in (self._options.rigidity_primvar, self._options.mask_primvar))
        rest, rest_from = self._rest()
        uvs, uv_indices, corners = self._uvs, self._uv_indices, None
        if self._options.subdivide and hasattr(self._mesh.schema, "getCreaseIndicesProperty"):
            refined = Refined(self._cage(), uvs, self._with_holes, self._options.subdivide, self._holes)
            counts, indices, uvs, uv_indices = refined.counts, refined.indices, refined.uvs, refined.uv_indices
            corners, rest = refined.cage_corners, refined.points(rest)
            rigidity, mask = (None if values is None else refined.points(values) for values in (rigidity, mask))
            self._refined = refined
        path = self._mesh.path
        return Shape(
            name,
            path,
            rest,
            counts,
            indices,
            uvs,
            uv_indices,
            self._uv_name,
            vertex_rigidity=rigidity,
            vertex_mask=mask,
            instances=instances,
            rest_from=rest_from,
            still=self._mesh.is_still(self._options),
            cage_corners=corners,
        )

    def positions(self, frame: float) -> np.ndarray:
        cage = self._placed(self._posed(frame), frame)
        return self._refined.points(cage) if self._refined else cage

    def uneven_scale(self, frames: Sequence[int]) -> str | None:
        """What to warn of where transforms that are not applied stretch the mesh over time."""
        return uneven_scale(self._linear, frames) if self._mesh.is_moved and not self._options.world else None

    def _linear(self, frame: float) -> np.ndarray:
        return self._mesh.linear(self._clock.time(frame))

    def _placed(self, points: np.ndarray, frame: float) -> np.ndarray:
        return placed(points, self._linear(frame)) if self._options.world else points

    def _posed(self, frame: float) -> np.ndarray:
        points = self._mesh.at(self._clock.time(frame), self._faces)
        if len(points) != self._points:
            raise SceneError(
                f"{self._mesh.where}: frame {frame:g} has {len(points)} vertices, the first {self._points}"
            )
        return points

    def _rest(self) -> tuple[np.ndarray, str]:
        """(points, 3) of the cage at rest, and where it is from."""
        wanted, frame = self._options.rest, float(self._first)
        if wanted is not None and wanted.startswith("frame:"):
            frame = frame_number(wanted)
        points, rest_from = self._found_rest(wanted)
        return self._placed(points, frame), rest_from

    def _found_rest(self, wanted: str | None) -> tuple[np.ndarray, str]:
        if wanted in (None, "pref"):
            found = self._mesh.param("Pref", ("P3f", "V3f", "P3d", "V3d"))
            if found is not None and len(found[1]) == self._points:
                return found[0][found[1]], "Pref"
            if wanted == "pref":
                raise SceneError(f"{self._mesh.where}: no parameter Pref holds a rest position per vertex")
        if wanted == "bind":
            raise SceneError(f"{self._mesh.where}: Alembic has no skeletons, so that there is no bind pose")
        if wanted in (None, "first"):
            return self._posed(self._first), f"first frame {self._first}"
        if wanted.startswith("frame:"):
            return self._posed(frame_number(wanted)), wanted
        # Alembic has no units, to which those of the rest could be compared.
        return rest_from_file(wanted, self._mesh.path, *self._faces, self._points)[0], wanted

    def _values(self, name: str | None) -> np.ndarray | None:
        found = name and self._mesh.param(name, ("Float", "Half", "Double", "C3f", "C4f", "V3f"))
        if not found:
            return None
        values, elements, interpolation = found
        try:
            return per_vertex(values[elements], interpolation, *self._faces, self._points)
        except ValueError as error:
            raise SceneError(f"{self._mesh.where}: {name} has {error}") from error

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
            where=self._mesh.where,
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
