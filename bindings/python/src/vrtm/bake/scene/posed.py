"""Meshes of USD and Alembic: the choice of meshes, their shapes, and the transforms above them. Translations do not
count: they stretch nothing, and far away they cost digits."""

from __future__ import annotations

from collections.abc import Callable, Collection, Iterable, Iterator, Sequence
from contextlib import contextmanager, suppress
from typing import Generic, TypeVar

import numpy as np

from vrtm.bake.left_out import LeftOut
from vrtm.bake.scene.refine import Cage, Refined
from vrtm.bake.scene.topology import bare_faces, matches, unique_names, without_uvs
from vrtm.bake.scene.types import SceneError, SceneOptions, Shape, Source, frame_number
from vrtm.bake.words import near

_LOOKED_AT = 10_000
_EVEN = 1.001
"""Ratio up to which a scale is the same along all axes."""


class PosedMesh:
    """A mesh with poses over time, in a space that transforms lie above. Frames are those of the scene."""

    deforms: bool
    """True if the scene has more than one pose of it."""
    is_moved: bool
    """True if the transforms above it change over time."""
    shape: Callable[[str, tuple[str, ...]], Shape]
    """Reads all that does not change with time, by a name and the paths that the mesh stands for. Raises SceneError."""
    read_faces: Callable[[], object]
    """Reads its faces, before its rest. Raises SceneError."""
    primvars: Callable[[], list[str]]
    """The names of its values per vertex."""
    _matrix: Callable[[float], np.ndarray]
    """(4, 4) of a frame: these transforms, by which rows of points are multiplied."""
    _posed: Callable[[float], np.ndarray]
    """(points, 3) of the cage at a frame, without these transforms."""
    _found_rest: Callable[[str | None], tuple[np.ndarray, str]]
    """The same of the rest that the options ask for, and where it is from."""

    def __init__(self, path: str, source: PosedSource) -> None:
        self.where, self.path = f"{source.path} {path}", path
        self._frames, self._clock = source.frames, source.clock
        self._options, self._warnings = source.options, source.warnings
        self._refined: Refined | None = None

    def positions(self, frame: float) -> np.ndarray:
        """(vertices, 3) at a frame. Raises SceneError where the topology is another than at first."""
        cage = self._placed(self._posed(frame), frame)
        return self._refined.points(cage) if self._refined else cage

    def uneven_scale(self) -> str | None:
        """A warning where transforms that are not applied stretch the mesh over time, by more along one axis than along
        another; the end of a sentence. Of very many frames some are looked at."""
        if not self.is_moved or self._options.world:
            return None
        frames = self._frames[:: -(-len(self._frames) // _LOOKED_AT)]
        first = self._linear(frames[0])
        if abs(np.linalg.det(first)) == 0:
            return None
        ratios = [1.0]
        for frame in frames[1:]:
            scales = np.linalg.svd(np.linalg.solve(first, self._linear(frame)), compute_uv=False)
            ratios.append(scales[0] / max(scales[2], 1e-9 * scales[0], 1e-300))
        worst = int(np.argmax(ratios))
        if ratios[worst] <= _EVEN:
            return None
        return (
            f"the transforms above it scale it {ratios[worst]:.3g} times as much along one axis as along another "
            f"(frame {frames[worst]}, against frame {frames[0]}), which is not taken for a stretch: --world does"
        )

    def to_world(self, frame: float) -> np.ndarray:
        """(4, 4) f64, by which rows of positions of a frame are multiplied to lie in the world."""
        matrix = self._matrix(frame)
        if self._options.world:
            # They have the linear part.
            matrix[:3, :3] = np.eye(3)
        return matrix

    def to_place(self, first: PosedMesh) -> np.ndarray:
        """(4, 4) f64, by which rows of the rest of `first`, an instance of the same mesh, are multiplied to lie in the
        world where this one is."""
        matrix = self._matrix(first.rest_frame)
        matrix[:3, :3] = np.linalg.pinv(first._placed(np.eye(3), first.rest_frame)) @ matrix[:3, :3]
        return matrix

    def _linear(self, frame: float) -> np.ndarray:
        """(3, 3), the linear part."""
        return self._matrix(frame)[:3, :3]

    def scaled_alike(self) -> str:
        """Equal for instances of one mesh that the transforms above them scale alike in all frames."""
        linear = self._linear(self._frames[0])
        return self.path if self.is_moved else str(np.round(linear @ linear.T, 6).tolist())

    def _placed(self, points: np.ndarray, frame: float) -> np.ndarray:
        return points.astype(np.float64) @ self._linear(frame) if self._options.world else points

    def _rest(self) -> tuple[np.ndarray, str]:
        """(points, 3) of the cage at rest, in the space of the poses, and where it is from."""
        points, rest_from = self._found_rest(self._options.rest)
        return self._placed(points, self.rest_frame), rest_from

    @property
    def rest_frame(self) -> float:
        """The frame whose transforms lie above the rest."""
        wanted = self._options.rest
        return frame_number(wanted) if wanted is not None and wanted.startswith("frame:") else self._frames[0]

    @contextmanager
    def _naming(self, what: str) -> Iterator[None]:
        """Names what has a wrong count in the block, which raises ValueError."""
        try:
            yield
        except ValueError as error:
            raise SceneError(f"{self.where}: {what} has {error}") from error

    def _pairs(self, uvs: np.ndarray) -> np.ndarray:
        """(uvs, 2), f32 or f64: the first two of their numbers."""
        if uvs.shape[1] > 2 and np.ptp(uvs[:, 2]) > 0:
            self._warnings.append(f"{self.path}: its UVs have three numbers, the third of which is left out")
        return uvs[:, :2].astype(uvs.dtype if uvs.dtype == np.float64 else np.float32)

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
        points = self._pairs(points)
        if ((holes < 0) | (holes >= len(counts))).any():
            raise SceneError(f"{self.where}: a hole names a face that the mesh does not have")
        with_holes = without_uvs(counts, uv_indices)
        uv_indices = without_uvs(counts, uv_indices, holes)
        if (uv_indices < 0).all():
            raise SceneError(f"{self.where}: no face has UVs")
        bare = bare_faces(counts, with_holes)
        self._warnings += [f"{self.path}: {bare}"] if bare else []
        rest, rest_from = self._rest()
        rigidity, mask = values
        corners, scheme = None, ""
        if cage is not None and not self._options.subdivide:
            scheme = cage().scheme
        elif cage is not None:
            refined = self._refined = Refined(cage(), points, with_holes, self._options.subdivide, holes)
            counts, indices, points, uv_indices = refined.counts, refined.indices, refined.uvs, refined.uv_indices
            corners, rest = refined.cage_corners, refined.points(rest)
            rigidity, mask = (None if of is None else refined.points(of) for of in (rigidity, mask))
        further |= {"vertex_rigidity": rigidity, "vertex_mask": mask, "cage_corners": corners, "instances": instances}
        further |= {"rest_from": rest_from, "still": not self.deforms, "scheme": scheme if scheme != "bilinear" else ""}
        return Shape(name, self.path, rest, counts, indices, points, uv_indices, **further)


Mesh = TypeVar("Mesh", bound=PosedMesh)


class PosedSource(Source, Generic[Mesh]):
    """The meshes of a scene of USD or Alembic. See `vrtm.bake.scene.Scene`."""

    has_subframes = True

    def __init__(self, path: str, options: SceneOptions) -> None:
        super().__init__(path, options)
        self._paths: list[str] = []
        self._named: set[str] = set()

    def _takes(self, path: str) -> bool:
        """True unless --meshes names other meshes, or --exclude names this one."""
        self._paths.append(path)
        options, why = self.options, self._why_not(path)
        self._named.update(p for p in (*options.meshes, *options.exclude) if matches(p, path))
        if why:
            self.left_out.append(LeftOut(why, path, meant=True))
        return not why

    def _why_not(self, path: str) -> str:
        """The option that leaves a mesh out, in words; empty if none does."""
        if any(matches(pattern, path) for pattern in self.options.exclude):
            return "named by --exclude"
        named = not self.options.meshes or any(matches(pattern, path) for pattern in self.options.meshes)
        return "" if named else "not named by --meshes"

    def _leave_out(self, path: str, why: str, meant: bool) -> None:
        """Raises SceneError for a mesh that --meshes names by itself."""
        self.left_out.append(LeftOut(why, path, meant=meant))
        if self.options.names(path):
            raise SceneError(f"{self.path} {path}: {why}")

    def _check_chosen(self, chosen: Collection[object]) -> None:
        """Raises SceneError for names of --meshes without a mesh, and if no mesh is chosen."""
        for name in (name for name in (*self.options.meshes, *self.options.exclude) if name not in self._named):
            kind = self._kind(name)
            hint = near(name, [*self._paths, *(path.rsplit("/", 1)[-1] for path in self._paths)])
            told = f"{self.path}: '{name}' is {f'a {kind}, not a mesh' if kind else f'no mesh of the scene{hint}'}"
            if name in self.options.meshes:
                raise SceneError(told)
            self.warnings.append(f"--exclude: {told}")
        if not chosen:
            why = "; ".join(f"{entry.mesh} {entry.why}" for entry in self.left_out[:5] if entry.mesh)
            raise SceneError(f"{self.path}: no mesh to bake ({why or 'the scene has none'})")

    def _unbaked(self) -> Iterable[Mesh]:
        """The meshes that are shown, and not baked."""
        raise NotImplementedError

    def _kind(self, path: str) -> str:
        """The kind of another object that is there; empty without one."""
        return ""

    def _take(self, groups: Sequence[Sequence[Mesh]]) -> None:
        """Reads meshes, the first of each group for all of it. One that is not named may be one that cannot be read,
        unless it is the last one and there is no other. Raises SceneError."""
        options, found = self.options, list[Shape]()
        self._meshes: dict[str, Mesh] = {}
        self._instances: dict[str, Sequence[Mesh]] = {}
        for name, group in zip(unique_names([group[0].path for group in groups], self.warnings), groups):
            mesh, paths = group[0], tuple(instance.path for instance in group)
            try:
                found.append(mesh.shape(name, paths))
            except SceneError as error:
                is_last = mesh is groups[-1][0] and not found
                if not options.lenient or is_last or options.names(paths[0]):
                    raise
                why = str(error).removeprefix(f"{mesh.where}: ")
                self.left_out.append(LeftOut(f"cannot be read: {why}", paths[0]))
            else:
                self._meshes[name], self._instances[name] = mesh, group
        self.warnings += [f"{mesh.path}: {uneven}" for mesh in self._meshes.values() if (uneven := mesh.uneven_scale())]
        for what, name in (("rigidity", options.rigidity_primvar), ("mask", options.mask_primvar)):
            if name is not None and all(getattr(shape, f"vertex_{what}") is None for shape in found):
                there = {primvar for mesh in self._meshes.values() for primvar in mesh.primvars()}
                raise SceneError(f"{self.path}: no mesh has the primvar '{name}' for the {what}{near(name, there)}")
        self.shapes = tuple(found)

    def positions(self, shape: Shape, frame: float) -> np.ndarray:
        return self._meshes[shape.name].positions(frame)

    def to_world(self, shape: Shape, frame: float | None) -> np.ndarray:
        mesh = self._meshes[shape.name]
        return mesh.to_world(mesh.rest_frame if frame is None else frame)

    def places(self, shape: Shape) -> list[np.ndarray]:
        return [mesh.to_place(self._meshes[shape.name]) for mesh in self._instances[shape.name]]

    def bystanders(self) -> Iterator[tuple[np.ndarray, np.ndarray]]:
        for mesh in self._unbaked():
            # One that cannot be read has no place.
            with suppress(SceneError):
                mesh.read_faces()
                yield mesh._rest()[0], mesh.to_place(mesh)

    def rest_frame(self, shape: Shape) -> float:
        """The frame whose transforms lie above the rest."""
        return self._meshes[shape.name].rest_frame
