"""What meshes of USD and Alembic share: how a shape is made of what their files hold, and of which meshes."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from typing import TypeVar

import numpy as np

from vrtm.bake.left_out import LeftOut
from vrtm.bake.scene.refine import Cage, Refined
from vrtm.bake.scene.topology import unique_names, without_uvs
from vrtm.bake.scene.types import SceneError, SceneOptions, Shape, frame_number
from vrtm.bake.scene.world import placed, uneven_scale
from vrtm.bake.words import near


class PosedMesh:
    """A mesh with poses over time, in a space that transforms lie above. Frames are those of the scene."""

    deforms: bool
    """Whether the scene has more than one pose of it."""
    is_moved: bool
    """Whether the transforms above it change over time."""
    shape: Callable[[str, tuple[str, ...]], Shape]
    """Reads all that does not change with time, by a name and the paths that the mesh stands for. Raises SceneError."""
    primvars: Callable[[], list[str]]
    """The names of its values per vertex."""
    _linear: Callable[[float], np.ndarray]
    """(3, 3) of a frame: the linear part of these transforms, by which rows of points are multiplied."""
    _posed: Callable[[float], np.ndarray]
    """(points, 3) of the cage at a frame, without these transforms."""
    _found_rest: Callable[[str | None], tuple[np.ndarray, str]]
    """The same of the rest that the options ask for, and where it is from."""

    def __init__(self, where: str, path: str, frames: Sequence[int], options: SceneOptions) -> None:
        self.where, self.path = where, path
        self._frames, self._options = frames, options
        self._refined: Refined | None = None

    def positions(self, frame: float) -> np.ndarray:
        """(vertices, 3) at a frame. Raises SceneError where the topology is another than at first."""
        cage = self._placed(self._posed(frame), frame)
        return self._refined.points(cage) if self._refined else cage

    def uneven_scale(self) -> str | None:
        """What to warn of where transforms that are not applied stretch the mesh over time."""
        return uneven_scale(self._linear, self._frames) if self.is_moved and not self._options.world else None

    def scaled_alike(self) -> str:
        """Equal for instances of one mesh that the transforms above them scale alike in all frames."""
        linear = self._linear(self._frames[0])
        return self.path if self.is_moved else str(np.round(linear @ linear.T, 6).tolist())

    def _placed(self, points: np.ndarray, frame: float) -> np.ndarray:
        return placed(points, self._linear(frame)) if self._options.world else points

    def _rest(self) -> tuple[np.ndarray, str]:
        """(points, 3) of the cage at rest, in the space of the poses, and where it is from."""
        points, rest_from = self._found_rest(self._options.rest)
        return self._placed(points, self.rest_frame), rest_from

    @property
    def rest_frame(self) -> float:
        """The frame whose transforms lie above the rest."""
        wanted = self._options.rest
        return frame_number(wanted) if wanted is not None and wanted.startswith("frame:") else self._frames[0]

    def _shape(
        self,
        name: str,
        instances: tuple[str, ...],
        faces: tuple[np.ndarray, np.ndarray],
        uvs: tuple[np.ndarray, np.ndarray],
        holes: np.ndarray,
        values: Iterable[np.ndarray | None],
        cage: Callable[[], Cage] | None,
        **further: object,
    ) -> Shape:
        """`faces`, `uvs`: of the cage. `values`: rigidity and mask of its vertices. `cage`: None if it is none."""
        counts, indices = faces
        points, uv_indices = uvs
        if ((holes < 0) | (holes >= len(counts))).any():
            raise SceneError(f"{self.where}: a hole names a face that the mesh does not have")
        with_holes = without_uvs(counts, uv_indices)
        uv_indices = without_uvs(counts, uv_indices, holes)
        if (uv_indices < 0).all():
            raise SceneError(f"{self.where}: no face has UVs")
        rest, rest_from = self._rest()
        rigidity, mask = values
        corners = None
        if self._options.subdivide and cage is not None:
            refined = self._refined = Refined(cage(), points, with_holes, self._options.subdivide, holes)
            counts, indices, points, uv_indices = refined.counts, refined.indices, refined.uvs, refined.uv_indices
            corners, rest = refined.cage_corners, refined.points(rest)
            rigidity, mask = (None if of is None else refined.points(of) for of in (rigidity, mask))
        return Shape(
            name,
            self.path,
            rest,
            counts,
            indices,
            points,
            uv_indices,
            vertex_rigidity=rigidity,
            vertex_mask=mask,
            instances=instances,
            rest_from=rest_from,
            still=not self.deforms,
            cage_corners=corners,
            **further,
        )


Mesh = TypeVar("Mesh", bound=PosedMesh)


def shapes(
    file: str,
    groups: Sequence[tuple[Mesh, tuple[str, ...]]],
    options: SceneOptions,
    warnings: list[str],
    left_out: list[LeftOut],
) -> tuple[tuple[Shape, ...], dict[str, Mesh]]:
    """The shapes of meshes that stand for some paths each, and the meshes by their names. One that need not be baked
    may be one that cannot be read. Raises SceneError."""
    found: list[Shape] = []
    meshes: dict[str, Mesh] = {}
    for name, (mesh, paths) in zip(unique_names([paths[0] for _, paths in groups], warnings), groups):
        try:
            found.append(mesh.shape(name, paths))
        except SceneError as error:
            if mesh.deforms or not options.skip_still or len(groups) == 1 or options.names(paths[0]):
                raise
            why = str(error).removeprefix(f"{mesh.where}: ")
            left_out.append(LeftOut(f"the scene has one pose of it, and it cannot be read: {why}", paths[0]))
        else:
            meshes[name] = mesh
    if not found:
        raise SceneError(f"{file}: no mesh to bake: {left_out[-1].line()}")
    warnings += [f"{shape.path}: {uneven}" for shape in found if (uneven := meshes[shape.name].uneven_scale())]
    for what, name in (("rigidity", options.rigidity_primvar), ("mask", options.mask_primvar)):
        if name is not None and all(getattr(shape, f"vertex_{what}") is None for shape in found):
            there = {primvar for mesh in meshes.values() for primvar in mesh.primvars()}
            raise SceneError(f"{file}: no mesh has the primvar '{name}' for the {what}{near(name, there)}")
    return tuple(found), meshes


def unknown(file: str, pattern: str, paths: Sequence[str], what: str = "no mesh of the scene") -> SceneError:
    """A mesh that is asked for is not there; `paths`: those that are."""
    hint = near(pattern, [*paths, *(path.rsplit("/", 1)[-1] for path in paths)])
    return SceneError(f"{file}: '{pattern}' is {what}{hint}")
