"""Geometry on the surface as arrays: its points at rest, and their places in a pose."""

from abc import ABC, abstractmethod
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass

import numpy as np

from vrtm.bake.failure import INPUT, Failure
from vrtm.bake.frames import Frame
from vrtm.bake.left_out import LeftOut
from vrtm.bake.scene.axes import placed
from vrtm.bake.words import near


@dataclass(frozen=True, eq=False)
class CarriedPrim:
    """A prim or object with its values at rest, in its own space."""

    path: str
    kind: str
    """`instances`, `points`, `curves` or `mesh`."""
    points: np.ndarray
    """(points, 3) f64: places of instances, or points."""
    roots: np.ndarray
    """(roots, 3) f64: places by which it is bound: first points of curves, feet of connected parts, all points."""
    of: np.ndarray
    """(points,): the index of each point's root in `roots`."""
    turns: np.ndarray | None = None
    """(points, 3, 3): the rotations of instances."""
    faces: tuple[np.ndarray, np.ndarray] | None = None
    """Face counts and indices of a mesh that is to be carried by its connected parts."""

    @property
    def places(self) -> str:
        """One of the roots, in words."""
        return "place" if self.faces is None else "connected part"

    def moved(
        self, roots: np.ndarray, turns: np.ndarray, bound: np.ndarray, to_mesh: np.ndarray, from_mesh: np.ndarray
    ) -> tuple[np.ndarray, np.ndarray | None]:
        """Points, and quaternions x, y, z, w of instances, in a pose. `roots`: (roots, 3), places in the pose, in the
        mesh's space; `turns`: (roots, 3, 3); `bound`: (roots,), those that are not too far. `to_mesh`: (4, 4) from the
        prim's space to the mesh's at rest, `from_mesh`: back in the pose."""
        rest = placed(self.points, to_mesh)
        offsets = rest - placed(self.roots, to_mesh)[self.of]
        posed = roots[self.of] + np.einsum("nij,nj->ni", turns[self.of], offsets)
        stays = ~bound[self.of]
        points = placed(posed, from_mesh)
        points[stays] = self.points[stays]
        if self.turns is None:
            return points, None
        turned = from_mesh[:3, :3].T @ turns @ to_mesh[:3, :3].T @ self.turns
        turned[stays] = self.turns[stays]
        return points, quaternions(turned)


@dataclass(frozen=True, eq=False)
class Pose:
    """A prim in a frame, as the written file has to say it."""

    frame: Frame
    time: float
    """The file's own."""
    points: np.ndarray
    """(points, 3), in the prim's space."""
    turns: np.ndarray | None
    """(points, 4) quaternions x, y, z, w of instances."""
    world: np.ndarray
    """(points, 3), in the scene's world."""

    def differs(self, points: np.ndarray, to_world: np.ndarray) -> str | None:
        """The difference of what is found in the file, as the end of a sentence; `to_world`: (4, 4)."""
        if len(points) != len(self.points):
            return f"has {len(points)} points, not {len(self.points)}"
        for where, found, meant in (("", points, self.points), (" in the world", placed(points, to_world), self.world)):
            off = np.linalg.norm(found - meant, axis=1).max()
            # Files hold f32.
            if not off <= 1e-5 * max(np.abs(meant).max(), np.ptp(meant, axis=0).max(), 1e-30):
                return f"a point is off by {off:.3g}{where}"
        return None


class Scatter(ABC):
    """A file with geometry on the surface, and the file that it becomes. `time` is the file's own."""

    def __init__(self, path: str, files: tuple[str, ...], noun: str, kinds: Iterable[str]) -> None:
        """`files`: those that are read, less those that vrtm wrote. `noun`: one of its objects; `kinds`: the kinds of
        them that can be carried."""
        self._file, self.files, self._noun, self._kinds = path, files, noun, ", ".join(kinds)
        self.warnings: list[str] = []
        self.left_out: list[LeftOut] = []

    def prims(self, path: str, frame: float, baked: Sequence[str], in_parts: bool) -> list[CarriedPrim]:
        """A prim and those below it that can be carried, as they are at a frame; none of the meshes `baked`. Those that
        cannot are left out. `in_parts`: meshes with their faces. Raises Failure."""
        where = f"--carry-prims {path}"
        there = self._there(path)
        if there is not None:
            raise Failure(INPUT, f"{where}: {self._file} has no such {self._noun}{near(path, there)}")
        found = [name for name in self._below(path) if name not in baked]
        if not found:
            reason = f"it is none of {self._kinds} that is not baked, nor has one below"
            raise Failure(INPUT, f"{where}: in {self._file} {reason}")
        read = (self._read(name, self.time(frame), in_parts) for name in found)
        prims = [prim if isinstance(prim, str) else wrong_faces(prim) or prim for prim in read]
        self.left_out += [
            LeftOut(f"not carried: {prim}", name) for name, prim in zip(found, prims) if isinstance(prim, str)
        ]
        return [prim for prim in prims if not isinstance(prim, str)]

    @abstractmethod
    def time(self, frame: float) -> float:
        """The file's time at a frame of the scene."""

    @abstractmethod
    def _there(self, path: str) -> Iterable[str] | None:
        """All paths, if a path is none of them."""

    @abstractmethod
    def _below(self, path: str) -> list[str]:
        """The paths of the objects at and below a path that can be carried."""

    @abstractmethod
    def _read(self, path: str, time: float, in_parts: bool) -> CarriedPrim | str:
        """An object at a time, or why it cannot be carried, as the end of a sentence."""

    @abstractmethod
    def to_world(self, prim: CarriedPrim, frame: float) -> np.ndarray:
        """(4, 4) by which rows of points are multiplied to lie in the scene's world, in its units."""

    @abstractmethod
    def add(self, prim: CarriedPrim, time: float, points: np.ndarray, turns: np.ndarray | None) -> None:
        """Adds a pose of a prim."""

    def digest(self) -> str:
        """A hash of the written file's content besides the poses."""
        return ""

    @abstractmethod
    def write(self, path: str, inputs: str, told: str) -> list[str]:
        """Writes all poses to a file that keeps the two texts; returns warnings. Raises OSError."""

    @abstractmethod
    def known(self, path: str, inputs: str) -> str | None:
        """The text `told` of a file that is as it was written, of these inputs; None if there is no such file."""

    @abstractmethod
    def differences(self, path: str, prim: CarriedPrim, times: Sequence[float], poses: Sequence[Pose]) -> Iterator[str]:
        """The differences of a written file, opened as its readers do, from what was meant for a prim: samples at
        `times`, and some `poses`."""


def wrong(points: np.ndarray, counts: np.ndarray | None = None) -> str | None:
    """The reason that points at rest cannot be carried, as the end of a sentence. `counts`: points of each curve."""
    if not len(points):
        return "has no points at rest"
    if not np.isfinite(points).all():
        return f"has a point that is not finite: {int(np.argmin(np.isfinite(points).all(1)))}"
    if counts is not None and ((counts < 0).any() or counts.sum() != len(points)):
        return f"has {len(points)} points, and curves with {int(counts.sum())}"
    return None


def wrong_faces(prim: CarriedPrim) -> str | None:
    """The reason that a mesh has no connected parts, as the end of a sentence."""
    if prim.faces is None:
        return None
    counts, indices = prim.faces
    if (counts < 0).any() or counts.sum() != len(indices):
        return f"has {len(indices)} corners, and faces with {int(counts.sum())}"
    beyond = (indices < 0) | (indices >= len(prim.points))
    return f"has {len(prim.points)} points, and a face with point {indices[beyond][0]}" if beyond.any() else None


def made(
    path: str,
    kind: str,
    points: np.ndarray,
    counts: np.ndarray | None = None,
    turns: np.ndarray | None = None,
    faces: tuple[np.ndarray, np.ndarray] | None = None,
) -> CarriedPrim:
    """A prim whose curves are bound by their first points, and all else by each point."""
    roots, of = points, np.arange(len(points))
    if counts is not None:
        # A curve of no points is nowhere.
        counts = counts[counts > 0]
        roots, of = points[np.cumsum(counts) - counts], np.repeat(np.arange(len(counts)), counts)
    return CarriedPrim(path, kind, points, roots, of, turns, faces)


def matrices(quaternions: np.ndarray) -> np.ndarray:
    """(n, 3, 3), whose columns are the axes, of quaternions x, y, z, w of any length; the identity of length 0."""
    length = np.linalg.norm(quaternions, axis=1, keepdims=True)
    q = np.where(length > 0, quaternions / np.where(length > 0, length, 1), [0.0, 0.0, 0.0, 1.0])
    v, w = q[:, :3], q[:, 3, None, None]
    cross = np.cross(np.eye(3)[None], v[:, None, :])
    return np.eye(3) * (2 * w**2 - 1) + 2 * v[:, :, None] * v[:, None, :] + 2 * w * cross


def quaternions(turned: np.ndarray) -> np.ndarray:
    """(n, 4), x, y, z, w, of the rotations that are nearest to matrices: largest eigenvectors (Horn)."""
    m = turned
    k = np.empty((len(m), 4, 4))
    k[:, :3, :3] = m + m.transpose(0, 2, 1) - np.trace(m, axis1=1, axis2=2)[:, None, None] * np.eye(3)
    k[:, :3, 3] = k[:, 3, :3] = np.stack(
        [m[:, 2, 1] - m[:, 1, 2], m[:, 0, 2] - m[:, 2, 0], m[:, 1, 0] - m[:, 0, 1]], axis=1
    )
    k[:, 3, 3] = np.trace(m, axis1=1, axis2=2)
    return np.linalg.eigh(k)[1][..., -1]
