"""Subdivision surfaces refined: the rules of Catmull and Clark (1978) with the creases of DeRose, Kass and Truong
(1998), as UsdGeomMesh describes them, or bilinear.

There is no wheel of OpenSubdiv that is kept up. Where refined points lie depends on the topology alone, so that all
frames share the weights. Points lie where the refinement puts them, near the limit surface and not on it. Boundaries of
interpolateBoundary `none` are refined as those of `edgeOnly`.
"""

from dataclasses import dataclass

import numpy as np

from vrtm.bake.scene.topology import corner_starts, next_corners, without_uvs
from vrtm.bake.scene.types import SceneError


@dataclass(frozen=True)
class Cage:
    """A control cage; the fields mean what the attributes of UsdGeomMesh mean."""

    where: str
    """File and prim, for messages."""
    scheme: str
    counts: np.ndarray
    indices: np.ndarray
    points: int
    boundary: str
    face_varying: str
    crease_lengths: np.ndarray
    crease_indices: np.ndarray
    crease_sharpnesses: np.ndarray
    corner_indices: np.ndarray
    corner_sharpnesses: np.ndarray
    uv_per_vertex: bool = False
    """UVs follow the points' rules (interpolation `vertex`)."""


class Refined:
    """A refined mesh: `counts`, `indices`, `uvs`, `uv_indices`, and `cage_corners`, which says for each corner of the
    cage which refined corner lies there. Raises SceneError for what cannot be refined."""

    def __init__(self, cage: Cage, uvs: np.ndarray, uv_indices: np.ndarray, levels: int, holes: np.ndarray) -> None:
        if cage.scheme not in ("catmullClark", "bilinear"):
            raise SceneError(f"{cage.where}: the subdivision scheme '{cage.scheme}' cannot be refined; bake its cage")
        if not 0 < levels <= 6:
            raise SceneError(f"{cage.where}: {levels} levels of refinement are not in 1 to 6")
        linear = cage.scheme == "bilinear"
        edges, corners = _sharpness(cage)
        mesh = _Mesh(cage.counts, cage.indices, cage.points, edges, corners)
        if cage.boundary == "edgeAndCorner":
            mesh.sharpen(mesh.single_faces())
        self._steps = [mesh.refine(linear) for _ in range(levels)]
        self.counts, self.indices = mesh.counts, mesh.indices
        self.cage_corners = (np.arange(len(cage.indices)) * 4**levels).astype(np.int32)
        painted = uv_indices >= 0
        flat = np.zeros((len(cage.indices), 2))
        flat[painted] = uvs[uv_indices[painted]]
        self.uv_indices = np.full(len(mesh.indices), -1, np.int32)
        refined = np.repeat(painted, 4**levels)
        if cage.uv_per_vertex:
            of_vertex = np.zeros((cage.points, 2))
            of_vertex[cage.indices[painted]] = flat[painted]
            self.uvs = self.points(of_vertex).astype(uvs.dtype)
            self.uv_indices[refined] = mesh.indices[refined]
        else:
            charts, values = _uv_mesh(cage, flat, painted, edges, corners)
            for _ in range(levels):
                values = charts.refine(linear or cage.face_varying == "all").apply(values)
            self.uvs = values.astype(uvs.dtype)
            self.uv_indices[refined] = charts.indices
        # Holes take part in what is smooth around them.
        hole = np.zeros(len(cage.counts), bool)
        hole[holes] = True
        self.uv_indices[np.repeat(np.repeat(hole, cage.counts), 4**levels)] = -1
        self.uv_indices = without_uvs(self.counts, self.uv_indices)

    def points(self, cage: np.ndarray) -> np.ndarray:
        """(refined vertices, ...) of values at the cage's vertices: positions, or one number each."""
        values = np.asarray(cage, np.float64)
        for step in self._steps:
            values = step.apply(values)
        return values.astype(cage.dtype)


@dataclass(frozen=True)
class _Step:
    """One level: face points are means, all other points sums of weights times points and face points."""

    faces: np.ndarray
    counts: np.ndarray
    starts: np.ndarray
    columns: np.ndarray
    weights: np.ndarray

    def apply(self, values: np.ndarray) -> np.ndarray:
        wide = (slice(None),) + (None,) * (values.ndim - 1)
        centres = np.add.reduceat(values[self.faces], corner_starts(self.counts)) / self.counts[wide]
        terms = np.concatenate([values, centres])[self.columns] * self.weights[wide]
        return np.concatenate([np.add.reduceat(terms, self.starts), centres])


class _Mesh:
    """Faces, and the sharpness of each corner's edge (from it to the next corner) and of each vertex."""

    def __init__(
        self, counts: np.ndarray, indices: np.ndarray, points: int, edges: np.ndarray, corners: np.ndarray
    ) -> None:
        self.counts, self.indices, self.points = counts, indices.astype(np.int64), points
        self.edge_sharpness, self.vertex_sharpness = edges, corners

    def single_faces(self) -> np.ndarray:
        """(points,) true at vertices of one face alone."""
        return np.bincount(self.indices, minlength=self.points) == 1

    def sharpen(self, vertices: np.ndarray) -> None:
        """Holds vertices where they are."""
        self.vertex_sharpness = np.where(vertices, np.inf, self.vertex_sharpness)

    def edges(self) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
        """Ends (edges, 2), the edge of each corner, how many faces an edge has, and its sharpness: no end where these
        are not two."""
        ends = np.sort(np.stack([self.indices, self.indices[next_corners(self.counts)]], axis=1), axis=1)
        keys, edge = np.unique(ends[:, 0] * self.points + ends[:, 1], return_inverse=True)
        faces = np.bincount(edge)
        sharpness = np.zeros(len(keys))
        np.maximum.at(sharpness, edge, self.edge_sharpness)
        sharpness[faces != 2] = np.inf
        return np.stack([keys // self.points, keys % self.points], axis=1), edge, faces, sharpness

    def refine(self, linear: bool) -> _Step:
        """Splits each face into one quad per corner, which begins there."""
        ends, edge, _, sharpness = self.edges()
        face = np.repeat(np.arange(len(self.counts)), self.counts)
        centre = self.points + face  # the column of a corner's face point
        hold = np.ones(len(ends)) if linear else np.minimum(sharpness, 1)
        rows, columns, weights = self._vertex_rows(ends, sharpness, centre, linear)
        of_edge = np.arange(len(ends)) + self.points
        half = 0.25 + 0.25 * hold
        rows += [of_edge, of_edge, edge + self.points]
        columns += [ends[:, 0], ends[:, 1], centre]
        weights += [half, half, (0.25 * (1 - hold))[edge]]
        row, column, weight = (np.concatenate(parts) for parts in (rows, columns, weights))
        order = np.flatnonzero(weight)
        order = order[np.argsort(row[order], kind="stable")]
        starts = np.searchsorted(row[order], np.arange(self.points + len(ends)))
        step = _Step(self.indices, self.counts, starts, column[order], weight[order])
        last = np.argsort(next_corners(self.counts))  # the corner before each
        edge_point, face_point = edge + self.points, face + self.points + len(ends)
        softer = np.maximum(self.edge_sharpness - 1, 0)
        none = np.zeros(len(edge))
        corners = np.maximum(self.vertex_sharpness - 1, 0)
        self.indices = np.stack([self.indices, edge_point, face_point, edge_point[last]], axis=1).ravel()
        self.edge_sharpness = np.stack([softer, none, none, softer[last]], axis=1).ravel()
        self.vertex_sharpness = np.concatenate([corners, np.zeros(len(ends) + len(self.counts))])
        self.points += len(ends) + len(self.counts)
        self.counts = np.full(len(edge), 4, np.int32)
        return step

    def _vertex_rows(
        self, ends: np.ndarray, sharpness: np.ndarray, centre: np.ndarray, linear: bool
    ) -> tuple[list[np.ndarray], list[np.ndarray], list[np.ndarray]]:
        """Weights of the vertices' new places: those of this level's rule, or, where a crease ends within the level, a
        mean of this one's and the next one's, by how sharp it still is."""
        n = self.points
        if linear:
            return [np.arange(n)], [np.arange(n)], [np.ones(n)]
        ending = (sharpness > 0) & (sharpness <= 1)
        both = ends.ravel()
        share = np.bincount(both, np.repeat(np.where(ending, sharpness, 0), 2), n)
        number = np.bincount(both, np.repeat(ending, 2), n)
        softening = (self.vertex_sharpness > 0) & (self.vertex_sharpness <= 1)
        share, number = share + np.where(softening, self.vertex_sharpness, 0), number + softening
        now = np.where(number > 0, share / np.maximum(number, 1), 1)
        kept, along, around = (
            now_weight * part_now + (1 - now_weight) * part_next
            for now_weight, part_now, part_next in zip(
                (now, now[both], now[self.indices]),
                self._rule(ends, sharpness, self.vertex_sharpness),
                self._rule(ends, np.maximum(sharpness - 1, 0), np.maximum(self.vertex_sharpness - 1, 0)),
            )
        )
        other = ends[:, ::-1].ravel()
        return [np.arange(n), both, self.indices], [np.arange(n), other, centre], [kept, along, around]

    def _rule(
        self, ends: np.ndarray, edges: np.ndarray, corners: np.ndarray
    ) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Weights of a vertex itself, of the other end of each of its edges, and of the face point of each corner."""
        both = ends.ravel()
        valence = np.bincount(both, minlength=self.points)
        sharp = np.bincount(both, np.repeat(edges > 0, 2), self.points)
        faces = np.bincount(self.indices, minlength=self.points)
        corner = (corners > 0) | (sharp > 2) | (sharp < 2) & (faces != valence) | (valence == 0)
        crease = ~corner & (sharp == 2)
        smooth = ~corner & ~crease
        count = np.maximum(valence, 1)
        kept = np.where(corner, 1, np.where(crease, 0.75, (count - 2) / count))
        spread = np.where(smooth, 1 / count**2, 0)
        along = spread[both] + np.where(crease[both] & np.repeat(edges > 0, 2), 0.125, 0)
        return kept, along, spread[self.indices]


def _sharpness(cage: Cage) -> tuple[np.ndarray, np.ndarray]:
    """Of the edge of each corner, and of each vertex. Sharpness has one value per crease, or one per edge."""
    lengths, per_edge = cage.crease_lengths, cage.crease_lengths - 1
    sharpnesses = cage.crease_sharpnesses
    if len(sharpnesses) == len(lengths):
        sharpnesses = np.repeat(sharpnesses, np.maximum(per_edge, 0))
    inside = [cage.crease_indices, cage.corner_indices]
    if (
        int(lengths.sum()) != len(cage.crease_indices)
        or (lengths < 2).any()
        or len(sharpnesses) != int(per_edge.sum())
        or len(cage.corner_indices) != len(cage.corner_sharpnesses)
        or any(((vertices < 0) | (vertices >= cage.points)).any() for vertices in inside)
    ):
        raise SceneError(f"{cage.where}: its creases or corners do not fit each other, or the mesh")
    ends_of_creases = np.zeros(len(cage.crease_indices), bool)
    ends_of_creases[np.cumsum(lengths) - 1] = True
    first = np.flatnonzero(~ends_of_creases)
    pairs = np.sort(np.stack([cage.crease_indices[first], cage.crease_indices[first + 1]]), axis=0)
    table = dict(zip(zip(*pairs.tolist()), sharpnesses.tolist()))
    indices = cage.indices.astype(np.int64)
    edges = np.zeros(len(indices))
    if table:
        corners = np.sort(np.stack([indices, indices[next_corners(cage.counts)]]), axis=0).tolist()
        edges[:] = [table.get(pair, 0.0) for pair in zip(*corners)]
    vertices = np.zeros(cage.points)
    vertices[cage.corner_indices] = cage.corner_sharpnesses
    # From 10 on, USD takes an edge or vertex for one that stays sharp at all levels.
    return np.where(edges >= 10, np.inf, edges), np.where(vertices >= 10, np.inf, vertices)


def _uv_mesh(
    cage: Cage, flat: np.ndarray, painted: np.ndarray, edges: np.ndarray, corners: np.ndarray
) -> tuple[_Mesh, np.ndarray]:
    """The faces with UVs as a mesh in the plane, cut where corners at a vertex differ, with what its boundary does by
    faceVaryingLinearInterpolation (of which cornersPlus2 is taken for cornersPlus1); and its points."""
    vertex = cage.indices[painted].astype(np.float64)
    points, indices = np.unique(np.column_stack([vertex, flat[painted]]), axis=0, return_inverse=True)
    counts = cage.counts[painted[np.minimum(corner_starts(cage.counts), len(painted) - 1)] & (cage.counts > 0)]
    of_vertex = points[:, 0].astype(np.int64)
    mesh = _Mesh(counts, indices.reshape(-1), len(points), edges[painted], corners[of_vertex])
    ends, _, faces, _ = mesh.edges()
    border = np.zeros(len(points), bool)
    border[ends[faces != 2].ravel()] = True
    regions = np.bincount(of_vertex, minlength=cage.points)[of_vertex]
    alone = mesh.single_faces()
    rule = cage.face_varying
    if rule == "boundaries":
        mesh.sharpen(border)
    if rule in ("cornersOnly", "cornersPlus1", "cornersPlus2"):
        mesh.sharpen(alone)
    if rule in ("cornersPlus1", "cornersPlus2"):
        mesh.sharpen(regions > 2)
    return mesh, points[:, 1:]
