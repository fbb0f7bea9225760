"""Types that all readers of scenes share: options, shapes, the error, and the interface of a reader."""

from collections.abc import Callable, Iterable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, field

import numpy as np

import vrtm
from vrtm.bake.left_out import LeftOut
from vrtm.bake.scene.axes import Axes
from vrtm.bake.scene.timing import Clock
from vrtm.bake.words import cause


class SceneError(Exception):
    """Bad input. The message names the file and the prim, and says what is wrong with it."""


def not_loaded(error: Exception, what: str, package: str, extra: str, module: str) -> SceneError:
    """The error of files that cannot be read, since their package is missing or cannot be loaded."""
    if isinstance(error, ModuleNotFoundError) and (error.name or "").partition(".")[0] == module:
        return SceneError(f"{what} need the package {package}: pip install 'vrtm[{extra}]'")
    return SceneError(f"{what} need the package {package}, which cannot be loaded: {type(error).__name__}: {error}")


@contextmanager
def reading(path: str) -> Iterator[None]:
    """Turns exceptions of libraries, which damaged files may cause anywhere, into SceneError."""
    try:
        yield
    except (RuntimeError, UnicodeDecodeError) as error:
        raise SceneError(f"{path}: cannot be read: {cause(error)}") from error


def frame_number(rest: str) -> float:
    """N of `frame:N`. Raises SceneError."""
    try:
        return float(rest.removeprefix("frame:"))
    except ValueError:
        raise SceneError(f"rest '{rest}': what follows 'frame:' is not a number") from None


@dataclass(frozen=True)
class SceneOptions:
    """Options of reading a scene. Picklable: worker processes open the scene again with the same options.
    The help of `vrtm bake` has their meaning."""

    meshes: tuple[str, ...] = ()
    """Names or paths of meshes, or paths of what they lie below; `*`, `?` and `[...]` are wildcards. Empty: all meshes
    that have UVs."""
    exclude: tuple[str, ...] = ()
    """Names or paths of meshes that are left out, with the same wildcards."""
    uv: tuple[str, ...] = ()
    """Names of UV sets: of these each mesh takes the first that it has. Empty: the scene's default (`st`, or the only
    one, in USD, the mesh's own in Alembic, the only one in OBJ)."""
    rest: str | None = None
    """`bind`, `pref`, `first`, `frame:N`, or a file with the same faces. None: the scene's own rest, which is Pref
    where there is one, else the bind pose of a skeleton, else the first frame; for OBJ the scene file itself."""
    texture_uv: str | None = None
    """None: textures are looked up by the UV set above."""
    rigidity_primvar: str | None = None
    mask_primvar: str | None = None
    subdivide: int = 0
    variants: tuple[tuple[str, str, str], ...] = ()
    """USD: (prim path, variant set, variant) to select."""
    poses: tuple[str, ...] = ()
    fps: float | str | None = None
    lenient: bool = False
    """True if a mesh that is not named is left out if it cannot be read, or does not deform and has several UV sets to
    choose from."""
    world: bool = False
    """True if the transforms above a mesh are applied, less their translation: to the poses those of their frames, to
    the rest those of the frame that it is taken from, or of the first."""

    def names(self, path: str) -> bool:
        """True if a mesh is asked for by its own name or path."""
        return path in self.meshes or path.rsplit("/", 1)[-1] in self.meshes

    @property
    def uv_text(self) -> str:
        """End of the sentence `has no UVs`, if UV sets are asked for."""
        return f" {' or '.join(map(repr, self.uv))}" if self.uv else ""


@dataclass(frozen=True, eq=False)
class Shape:
    """A mesh as the library takes it. Corners stand in the order of the file; faces without UVs have -1."""

    name: str
    """Unique in the scene, and safe in file names."""
    path: str
    """Prim path, or file."""
    rest: np.ndarray
    """(vertices, 3), f32 or f64."""
    face_counts: np.ndarray
    """(faces,) int32: corners of each face."""
    indices: np.ndarray
    """(corners,) int32: vertex of each corner."""
    uvs: np.ndarray
    """(uvs, 2) f32 or f64, v up."""
    uv_indices: np.ndarray
    """(corners,) int32: UV of each corner, -1 in faces without UVs."""
    uv_name: str
    """Name of the UV set."""
    texture_uv_name: str = ""
    """Name of the UV set that textures are looked up by, if that is another one."""
    texture_uvs: tuple[np.ndarray, np.ndarray] | None = None
    """Its UVs and the UV of each corner, as above."""
    vertex_rigidity: np.ndarray | None = None
    """(vertices,) f32, 0 elastic to 1 rigid."""
    vertex_mask: np.ndarray | None = None
    """(vertices,) f32; where it is dark nothing moves."""
    instances: tuple[str, ...] = ()
    """Paths of all prims that this shape stands for, `path` first: instances in the same pose are one shape."""
    rest_from: str = ""
    """Origin of the rest, in words: `Pref`, `first frame 1001`."""
    rest_unit: float = 1.0
    """Units of the poses in one of the rest, as far as the files say (metersPerUnit)."""
    still: bool = False
    """True if the scene has one pose of it alone."""
    scheme: str = ""
    """The kind of subdivision surface which renderers show, where its control cage is baked in its place."""
    subsets: dict[str, np.ndarray] = field(default_factory=dict)
    """The faces of the subsets that materials are bound to, by their names."""
    left_handed: bool = False
    """True if the front of a face is where its corners go round clockwise."""
    cage_corners: np.ndarray | None = None
    """(corners of the control cage,) int32: the refined corner that lies at each; None where nothing was refined."""

    @property
    def arrays(self) -> tuple[np.ndarray, ...]:
        """Arrays that a solve without maps depends on, poses excepted."""
        return self.rest, self.face_counts, self.indices, self.uvs, self.uv_indices

    @property
    def textured(self) -> np.ndarray:
        """(faces,): true for faces with UVs."""
        if len(self.uv_indices) == 0:
            return np.zeros(len(self.face_counts), bool)
        first = np.cumsum(self.face_counts, dtype=np.int64) - self.face_counts
        return (self.face_counts > 0) & (self.uv_indices[np.minimum(first, len(self.uv_indices) - 1)] >= 0)

    def asset(self, device: vrtm.Device, weld: str, max_layers: int = 0, faces: np.ndarray | None = None) -> vrtm.Asset:
        """The library's asset of the mesh, without maps; `faces`: those that are baked. Raises vrtm.Error."""
        return vrtm.Asset(
            device,
            self.rest,
            self.indices,
            face_counts=self.face_counts,
            uvs=self.uvs,
            uv_indices=self.uv_indices,
            uv_sets=() if self.texture_uvs is None else (self.texture_uvs,),
            textured_faces=faces,
            weld=weld,
            max_layers=max_layers,
        )


class Source:
    """A reader of one kind of file, by default of files without transforms. `Scene` is built on it."""

    shapes: tuple[Shape, ...]
    frames: Sequence[int]
    files: tuple[str, ...]
    """The files that are read, and the textures that materials name."""
    has_subframes: bool
    """True if there are positions between two frames."""
    clock: Clock
    codes: float
    """Units of the clock's times per second: time codes, or 1."""
    rate: str
    """The rate of frames in words; empty if there is nothing to choose."""
    axes: Axes
    positions: Callable[[Shape, float], np.ndarray]
    """(vertices, 3) of a shape at a frame, in the shape's own topology."""

    def __init__(self, path: str, options: SceneOptions) -> None:
        self.path, self.options = path, options
        self.warnings: list[str] = []
        self.left_out: list[LeftOut] = []

    def to_world(self, shape: Shape, frame: float | None) -> np.ndarray:
        """(4, 4) by which rows of the shape's positions at a frame, or of its rest, are multiplied to lie in the
        world."""
        return np.eye(4)

    def places(self, shape: Shape) -> list[np.ndarray]:
        """See `Scene`, also for the next one."""
        return [self.to_world(shape, None)]

    def bystanders(self) -> Iterable[tuple[np.ndarray, np.ndarray]]:
        return ()

    def close(self) -> None:
        """By default nothing stays open."""
