"""Faces, names, frames and values per vertex: what does not depend on the kind of file."""

import math
import os
import re
import unicodedata
from collections import Counter
from collections.abc import Iterable, Sequence
from fnmatch import fnmatchcase

import numpy as np

from vrtm.bake.frames import MOST
from vrtm.bake.left_out import LeftOut
from vrtm.bake.scene.timing import CLOSE
from vrtm.bake.scene.types import SceneError

TILES = (10, 900)
"""Up to where in u and v tiles have numbers."""


def check_faces(
    where: str, counts: np.ndarray, indices: np.ndarray, expected_counts: np.ndarray, expected_indices: np.ndarray
) -> None:
    """Raises SceneError unless faces are the expected ones; a face may start at another of its corners.

    `where` begins the message; it names the file and the prim. Faces are counted from 1 in it.
    """
    if np.array_equal(counts, expected_counts) and np.array_equal(indices, expected_indices):
        return
    if int(counts.sum()) != len(indices):
        raise SceneError(f"{where}: the faces have {int(counts.sum())} corners, but {len(indices)} vertices are listed")
    starts, expected_starts = corner_starts(counts), corner_starts(expected_counts)
    for face in range(min(len(counts), len(expected_counts))):
        got = indices[starts[face] : starts[face] + counts[face]]
        want = expected_indices[expected_starts[face] : expected_starts[face] + expected_counts[face]]
        turns = range(max(len(want), 1))
        if len(got) != len(want) or not any(np.array_equal(np.roll(got, turn), want) for turn in turns):
            raise SceneError(
                f"{where}: face {face + 1} has the vertices {_listed(got)}, but that of the rest mesh has "
                f"{_listed(want)} (counted from 0): faces and the order of vertices must be the same"
            )
    if len(counts) != len(expected_counts):
        raise SceneError(f"{where}: {len(counts)} faces, but the rest mesh has {len(expected_counts)}")


def _listed(vertices: np.ndarray) -> str:
    return " ".join(str(int(vertex)) for vertex in vertices[:12]) + (" ..." if len(vertices) > 12 else "")


def corner_starts(counts: np.ndarray) -> np.ndarray:
    """(faces,): the first corner of each face."""
    return np.cumsum(counts, dtype=np.int64) - counts


def next_corners(counts: np.ndarray) -> np.ndarray:
    """(corners,): the corner after each, around its face."""
    after = np.arange(int(counts.sum())) + 1
    filled = counts > 0
    after[(corner_starts(counts) + counts - 1)[filled]] = corner_starts(counts)[filled]
    return after


def fans(counts: np.ndarray) -> np.ndarray:
    """(triangles, 3): the corners of faces with these numbers of them, split as fans."""
    triangles = np.maximum(counts.astype(np.int64) - 2, 0)
    first = np.repeat(corner_starts(counts), triangles)
    step = np.arange(len(first)) - np.repeat(corner_starts(triangles), triangles)
    return np.stack([first, first + step + 1, first + step + 2], -1)


def check_mesh(where: str, counts: np.ndarray, indices: np.ndarray, points: int) -> None:
    """Raises SceneError for faces that no mesh of so many points can have."""
    if len(counts) == 0:
        raise SceneError(f"{where}: no faces")
    if (counts < 0).any() or int(counts.sum(dtype=np.int64)) != len(indices):
        total = int(counts.sum(dtype=np.int64))
        raise SceneError(f"{where}: the faces have {total} corners, but {len(indices)} vertices are listed")
    outside = np.flatnonzero((indices < 0) | (indices >= points))
    if len(outside):
        corner = int(outside[0])
        raise SceneError(f"{where}: corner {corner} names the vertex {int(indices[corner])}, but there are {points}")


def without_uvs(counts: np.ndarray, uv_indices: np.ndarray, faces: Iterable[int] = ()) -> np.ndarray:
    """UV indices with -1 at all corners of `faces`, and of faces that have a corner with -1."""
    face_of_corner = np.repeat(np.arange(len(counts)), counts)
    bare = np.zeros(len(counts), bool)
    bare[np.asarray(list(faces), np.int64)] = True
    bare[face_of_corner[uv_indices < 0]] = True
    return np.where(bare[face_of_corner], -1, uv_indices).astype(np.int32)


def bare_faces(counts: np.ndarray, uv_indices: np.ndarray) -> str:
    """The end of a warning about faces without UVs; empty if all have some."""
    bare = np.count_nonzero(uv_indices[corner_starts(counts)[counts > 0]] < 0)
    return f"{bare} of its {len(counts)} faces are without UVs: nothing is baked there" if bare else ""


def per_vertex(
    values: np.ndarray, interpolation: str, counts: np.ndarray, indices: np.ndarray, points: int
) -> np.ndarray:
    """(points,) f32 of values that are constant, uniform (per face), per vertex or faceVarying (per corner).

    A vertex gets the mean of its faces or corners; one without faces gets 0. Raises ValueError on a wrong count.
    """
    of_corner = corner_elements(interpolation, counts, indices, points, np.arange(len(values)))
    values = np.asarray(values, np.float64)
    if values.ndim == 2:
        values = luminance(values)
    if interpolation == "constant":
        return np.full(points, values[0], np.float32)
    if interpolation in ("vertex", "varying"):
        return values.astype(np.float32)
    share = np.maximum(np.bincount(indices, minlength=points), 1)
    return (np.bincount(indices, weights=values[of_corner], minlength=points) / share).astype(np.float32)


def corner_elements(
    interpolation: str, counts: np.ndarray, indices: np.ndarray, points: int, elements: np.ndarray
) -> np.ndarray:
    """(corners,) int32: which of the values each corner has; `elements` has one entry per corner, vertex, face or mesh,
    as the interpolation says. Raises ValueError on a wrong count."""
    of_corner = {
        "faceVarying": (len(indices), np.arange(len(indices))),
        "vertex": (points, indices),
        "varying": (points, indices),
        "uniform": (len(counts), np.repeat(np.arange(len(counts)), counts)),
        "constant": (1, np.zeros(len(indices), np.int64)),
    }
    if interpolation not in of_corner:
        raise ValueError(f"the interpolation {interpolation!r}, which is not known")
    wanted, order = of_corner[interpolation]
    if len(elements) != wanted:
        raise ValueError(f"{len(elements)} values of interpolation {interpolation}, not {wanted}")
    return elements[order].astype(np.int32)


def outside(uvs: np.ndarray, uv_indices: np.ndarray) -> str:
    """Bounds of the UVs of a mesh that lie in no UDIM tile, and of all tiles, in words."""
    uvs = uvs[np.unique(uv_indices[uv_indices >= 0])].astype(np.float64)
    beyond = uvs[np.isfinite(uvs).all(axis=-1) & ((uvs < 0) | (uvs > TILES)).any(axis=-1)]
    bounds = (f"{axis} from {of.min():.4g} to {of.max():.4g}" for axis, of in zip("uv", beyond.T) if len(of))
    return "; ".join([*bounds, f"tiles have numbers where u is 0 to {TILES[0]} and v is 0 to {TILES[1]}"])


def luminance(colours: np.ndarray) -> np.ndarray:
    """(..., ) of linear colours (..., 3 or more); exactly the value of grey ones."""
    red, green, blue = colours[..., 0], colours[..., 1], colours[..., 2]
    grey = (red == green) & (green == blue)
    return np.where(grey, red, 0.2126 * red + 0.7152 * green + 0.0722 * blue)


_LONGEST = 160
"""Bytes of a mesh's name in file names, which have 255 and say more than that."""
FARTHEST = 2**53
"""Up to this number each whole frame is a number of its own in f64."""


def whole_frames(first: float, last: float, where: str, warnings: list[str], left_out: list[LeftOut]) -> Sequence[int]:
    """The whole frames of a range, also those that miss it by rounding; of one without any, its first frame, rounded,
    which is warned of. Very many are not listed. Ends of the range that are none go to `left_out`. Raises
    SceneError."""
    for frame in (first, last):
        # No comparison holds for what is no number.
        if not abs(frame) < FARTHEST:
            raise SceneError(f"{where}: its frames go from {first:g} to {last:g}: {frame:g} is no frame")
    frames = range(math.ceil(first - CLOSE), math.floor(last + CLOSE) + 1)
    if not frames:
        frames = range(round(first), round(first) + 1)
        warnings.append(f"{where}: no frame from {first:g} to {last:g} is whole: frame {frames[0]} alone is baked")
    ends = {end for end, nearest in ((first, frames[0]), (last, frames[-1])) if abs(end - nearest) > CLOSE}
    if ends:
        between = tuple(round(end, 6) for end in sorted(ends))
        left_out.append(LeftOut("an end of the range, no whole frame; --frames can name it", "", between, meant=True))
    return frames if len(frames) > MOST else tuple(frames)


def unique_names(paths: Sequence[str], warnings: list[str] | None = None) -> list[str]:
    """A name per path that is safe in file names and unique whatever the case of its letters: the last part of the path
    where that is enough, else all parts, and a number where these are not; of a long one its end. Both are told."""
    short = [_safe(path.rsplit("/", 1)[-1]) for path in paths]
    count = Counter(map(_folded, short))
    names: list[str] = []
    taken: dict[str, str] = {}
    for path, name in zip(paths, short):
        if count[_folded(name)] > 1:
            name = _safe(path.strip("/").replace("/", "_"))
        whole, name = name, name.encode()[-_LONGEST:].decode(errors="ignore")
        unique, number = name, 2
        while _folded(unique) in taken:
            unique, number = f"{name}_{number}", number + 1
        if unique != whole and warnings is not None:
            since = f"it stands for {name} of {taken[_folded(name)]}" if unique != name else "its name is too long"
            warnings.append(f"{path}: <mesh> stands for {unique}, since {since}")
        taken[_folded(unique)] = path
        names.append(unique)
    return names


def _safe(name: str) -> str:
    """With letters, marks and digits of all scripts, as far as file names may have them."""
    kept = "".join(c if c in "_-" or unicodedata.category(c)[0] in "LMN" else "_" for c in name)
    try:
        os.fsencode(kept)
    except UnicodeEncodeError:
        kept = re.sub(r"[^\x00-\x7f]", "_", kept)
    return kept or "mesh"


def _folded(name: str) -> str:
    """Key of a name, equal for names that a file system may take for one."""
    return unicodedata.normalize("NFC", name).casefold()


def matches(pattern: str, path: str) -> bool:
    """True if a pattern means the mesh at a path: by its name, its path, or a path above it."""
    parts = path.split("/")
    above = ["/".join(parts[:end]) for end in range(2, len(parts) + 1)]
    return fnmatchcase(parts[-1], pattern) or any(fnmatchcase(prefix, pattern.rstrip("/")) for prefix in above)
