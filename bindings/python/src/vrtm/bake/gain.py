"""Maps that would be the identity in all frames: those of surfaces that move rigidly, or have nothing rigid on them.

A chart, or all that hangs together, moves rigidly if all of its edges and the diagonals of its faces keep their
lengths: then nothing on it is strained. That is looked at for all frames of the scene and not for those of one task, so
that a sequence has either all of its files or none. All tiles of a layer have files or none: renderers look all of them
up by one name.
"""

from collections.abc import Callable, Iterator, Sequence

import numpy as np

from vrtm.bake.frames import Frame
from vrtm.bake.part import Part, TileWork
from vrtm.bake.scene import SceneError, Shape
from vrtm.bake.scene.topology import corner_starts
from vrtm.borders import connected, hashes

Group = tuple[str, int]
"""The name of a part, and one of its layers."""
RIGIDLY = "nothing gained: all parts move rigidly"
NOTHING = "nothing gained: nothing is rigid there"

_STRAIN = 1e-4
"""Relative change of length up to which an edge keeps it: less than a hundredth of a texel on features of a hundred
texels."""
_ROUNDING, _MOST_ROUNDING = 4, 1e-2
"""Rounding that a length may have: units in the last place of the largest coordinate, and a share of the length."""
_CELLS = 512
"""Cells of a tile: UVs of one vertex that are less than half a cell apart are one, as for the library, which is
stricter."""
_SAMPLE = 100_000
"""Number of lengths among which most deforming surfaces are found."""


def groups(parts: Sequence[Part]) -> list[Group]:
    return list(dict.fromkeys((part.subset, tile.layer) for part in parts for tile in part.all_tiles))


def without_gain(
    shape: Shape,
    parts: Sequence[Part],
    frames: Sequence[Frame],
    pose: Callable[[Frame], np.ndarray],
    stop: Callable[[], None],
) -> dict[Group, str]:
    """The parts and layers that gain nothing in any of the frames, and why. `stop` is called per frame, and may raise.
    A pose that cannot be read counts as one that deforms."""
    settings = parts[0].settings
    # Charts do not see what lies beyond their seams, and sorting them takes time.
    shells = _shells(shape, settings.weld, charts=settings.seams != "continue" and len(groups(parts)) > 1)
    wanted = _rigid_shells(shape, parts, shells)
    found = {group: NOTHING for group in groups(parts) if not wanted.get(group)}
    left = {group: shells for group, shells in wanted.items() if shells}
    # One frame alone does not tell that others are not different: its sequence may be baked frame by frame.
    if len(frames) < 2 or not left:
        return found
    lengths = _Lengths(shape, shells, set().union(*left.values()))
    try:
        for frame in _spread(frames):
            stop()
            for deforming in lengths.deforming(pose(frame)):
                left = {group: own for group, own in left.items() if not own & deforming}
                if not left:
                    return found
    except SceneError:
        return found
    return found | dict.fromkeys(left, RIGIDLY)


def _spread(frames: Sequence[Frame]) -> Iterator[Frame]:
    """The last frame, which is hardly ever at rest, then the others, far from one another at first."""
    ordered = sorted(frames, reverse=True)
    digits = len(f"{len(ordered) - 1:b}")
    yield from (ordered[k] for k in sorted(range(len(ordered)), key=lambda k: f"{k:0{digits}b}"[::-1]))


def _shells(shape: Shape, weld: str, charts: bool = False) -> np.ndarray:
    """(faces,): a number per connected surface, the same for all of its faces; `charts`: per chart of it, where faces
    hang together only if they do in UV, too."""
    vertices = shape.indices.astype(np.int64)
    if weld != "index":
        vertices = np.unique(shape.rest, axis=0, return_inverse=True)[1].reshape(-1)[vertices]
    nodes, links = vertices, [np.zeros((2, 0), np.int64)]
    if charts:
        uvs = shape.uvs[shape.uv_indices].astype(np.float64) + 0.0
        places, nodes = _distinct(vertices, *uvs.T.copy().view(np.int64))
        # UVs of a vertex that are close together are one.
        several = np.flatnonzero(np.bincount(vertices[places])[vertices[places]] > 1)
        places, uvs = places[several], np.nan_to_num(uvs[places[several]])
        for shift in ((0, 0), (0, 0.5), (0.5, 0), (0.5, 0.5)):
            # One of these grids has both of two in the same cell.
            cells = np.floor(uvs * _CELLS + shift).astype(np.int64)
            same, of = _distinct(vertices[places], *cells.T)
            links.append(np.stack([several[same[of]], several]))
    counts = shape.face_counts
    filled = counts > 0
    first = np.zeros(len(counts), np.int64)
    first[filled] = nodes[corner_starts(counts)[filled]]
    one, other = np.concatenate([np.stack([np.repeat(first, counts), nodes]), *links], axis=1)
    return connected(nodes.max(initial=0) + 1, one, other)[first]


def _distinct(*numbers: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """The first place of each combination, and the number of each one's combination. Two that are taken for one only
    join surfaces."""
    _, places, of = np.unique(hashes(*numbers), return_index=True, return_inverse=True)
    return places, of.reshape(-1)


def _rigid_shells(shape: Shape, parts: Sequence[Part], shells: np.ndarray) -> dict[Group, set[int]]:
    """The surfaces of each part and layer on which something is rigid."""
    found: dict[Group, set[int]] = {}
    for part in parts:
        faces = _textured(part)
        rigid = _rigid(shape, part, faces)
        layers = part.asset.face_layers()[faces]
        for layer in {tile.layer for tile in part.all_tiles}:
            own = layers == layer
            if part.settings.seams == "continue":
                # Rigid texels beyond a seam count, too.
                found[part.subset, layer] = set(shells[faces[own]].tolist()) & set(shells[faces[rigid]].tolist())
            else:
                found[part.subset, layer] = set(shells[faces[own & rigid]].tolist())
    return found


def is_painted(tile: TileWork) -> bool:
    """True if anything of a tile may be rigid."""
    part, shape = tile.part, tile.part.shape
    faces = _textured(part)
    faces = faces[part.asset.face_layers()[faces] == tile.layer]
    three = np.minimum(np.arange(3), shape.face_counts[faces, None] - 1)
    corners = corner_starts(shape.face_counts)[faces, None] + three
    u, v = np.floor(shape.uvs[shape.uv_indices[corners]].mean(axis=1)).T
    return bool(_rigid(shape, part, faces[1001 + u + 10 * v == tile.udim]).any())


def _textured(part: Part) -> np.ndarray:
    """The faces of a part that have UVs."""
    textured = part.shape.textured
    return np.flatnonzero(textured) if part.faces is None else part.faces[textured[part.faces]]


def _rigid(shape: Shape, part: Part, faces: np.ndarray) -> np.ndarray:
    """True for each face that may have anything rigid: in the texels around it, or its vertices."""
    counts, starts = shape.face_counts[faces], corner_starts(shape.face_counts)[faces]
    # Corners of the faces, one after another.
    corners = np.arange(counts.sum()) - np.repeat(corner_starts(counts) - starts, counts)
    cuts = corner_starts(counts)
    # Before there are maps, anything may become rigid.
    found = np.full(len(faces), part.settings.is_unpainted)
    if len(faces) == 0:
        return found
    if shape.vertex_rigidity is not None:
        found |= np.maximum.reduceat(shape.vertex_rigidity[shape.indices[corners]], cuts) > 0
    uvs = shape.uvs[shape.uv_indices[corners]]
    low, high = (f.reduceat(uvs, cuts, axis=0) for f in (np.minimum, np.maximum))
    # Faces without a tile's number count as rigid, without a closer look.
    found |= ((low < 0).any(axis=1) | (high[:, 0] > 10)) & bool(part.rigid_sums)
    for udim, sums in part.rigid_sums.items():
        corner = np.array([(udim - 1001) % 10, (udim - 1001) // 10])
        height, width = (n - 1 for n in sums.shape)
        size = np.array([width, height])
        # A texel more on each side, since the map is interpolated.
        first = np.clip(np.floor((low - corner) * size) - 1, 0, size).astype(np.int64)
        last = np.clip(np.ceil((high - corner) * size) + 1, 0, size).astype(np.int64)
        outside = ((high - corner < 0) | (low - corner > 1)).any(axis=1)
        (x0, y0), (x1, y1) = first.T, last.T
        found |= ~outside & (sums[y1, x1] - sums[y0, x1] - sums[y1, x0] + sums[y0, x0] > 0)
    return found


class _Lengths:
    """The edges and diagonals of the faces of some surfaces."""

    def __init__(self, shape: Shape, shells: np.ndarray, wanted: set[int]) -> None:
        faces = np.flatnonzero(shape.textured & np.isin(shells, list(wanted)))
        pairs = list(_pairs(shape, faces))
        self._a, self._b = (np.concatenate([pair[k] for pair in pairs]) for k in (0, 1))
        self._shells = np.concatenate([shells[pair[2]] for pair in pairs])
        # Edges are those of two faces.
        low, high = np.minimum(self._a, self._b).astype(np.int64), np.maximum(self._a, self._b)
        once = np.unique(low * len(shape.rest) + high, return_index=True)[1]
        self._a, self._b, self._shells = self._a[once], self._b[once], self._shells[once]
        self._rest = shape.rest
        self._lengths = _distances(shape.rest, self._a, self._b)
        step = max(1, len(self._a) // _SAMPLE)
        self._looks = [slice(None, None, step), slice(None)][step == 1 :]

    def deforming(self, positions: np.ndarray) -> Iterator[set[int]]:
        """The surfaces that a pose deforms: some that are quickly found, then all."""
        unit = max(
            np.finfo(array.dtype).eps * np.abs(array).max(initial=0, where=np.isfinite(array))
            for array in (self._rest, positions)
        )
        for look in self._looks:
            rest, now = self._lengths[look], _distances(positions, self._a[look], self._b[look])
            allowed = _STRAIN * rest + np.minimum(_ROUNDING * unit, _MOST_ROUNDING * rest)
            # NaN counts as a deformation.
            with np.errstate(invalid="ignore"):
                kept = np.abs(now - rest) <= allowed
            yield set(np.unique(self._shells[look][~kept]).tolist())


def _distances(positions: np.ndarray, a: np.ndarray, b: np.ndarray) -> np.ndarray:
    points = positions.astype(np.float64)
    with np.errstate(invalid="ignore", over="ignore"):
        apart = points[a] - points[b]
        return np.sqrt(np.einsum("ij,ij->i", apart, apart))


def _pairs(shape: Shape, faces: np.ndarray) -> Iterator[tuple[np.ndarray, np.ndarray, np.ndarray]]:
    """(vertices, other vertices, faces) whose distances leave a face no freedom: from each corner to the next one, and
    to the first three."""
    starts = corner_starts(shape.face_counts)
    for count in np.unique(shape.face_counts[faces]):
        own = faces[shape.face_counts[faces] == count]
        corners = shape.indices[starts[own][:, None] + np.arange(count)]
        ends = {(k, (k + 1) % count) for k in range(count)} | {
            (j, k) for j in range(min(3, count)) for k in range(count)
        }
        for j, k in sorted({(min(pair), max(pair)) for pair in ends if pair[0] != pair[1]}):
            yield corners[:, j], corners[:, k], own
