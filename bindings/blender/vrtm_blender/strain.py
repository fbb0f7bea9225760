"""Stretch and squeeze of the texture on the surface, as colours of vertices. All of it on arrays."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from . import session
from .geometry import Topology

# The logarithms of a length's ratio at which colours are full: a quarter longer, or a fifth shorter; of skin, twice as
# long, or half as long.
FULL, FULL_SKIN = np.log(1.25), np.log(2)

_STRETCHED, _NOTHING, _SQUEEZED = np.array([[0.85, 0.10, 0.05], [0.80, 0.80, 0.80], [0.05, 0.25, 0.85]])

Jacobians = Callable[[np.ndarray], np.ndarray]


def edges(points: np.ndarray) -> np.ndarray:
    """Two edges of each triangle in a frame of its own plane: (n, 2, 2), an edge per column. points (n, 3, 3)."""
    one, two = points[:, 1] - points[:, 0], points[:, 2] - points[:, 0]
    length = np.linalg.norm(one, axis=-1)
    x = one / np.maximum(length, 1e-30)[:, None]
    along = (two * x).sum(-1)
    across = np.linalg.norm(two - along[:, None] * x, axis=-1)
    return np.stack([np.stack([length, along], -1), np.stack([np.zeros_like(length), across], -1)], -2)


def _edges(vertices: np.ndarray, rest: np.ndarray, pose: np.ndarray) -> tuple[np.ndarray, ...]:
    """Of triangles of vertices (n, 3): the vertices, the edges at rest and in the pose, the areas at rest (twice), and
    True for those that have one."""
    vertices = vertices.astype(np.int64)
    at_rest, posed = edges(rest[vertices].astype(np.float64)), edges(pose[vertices].astype(np.float64))
    area = np.abs(_determinant(at_rest))
    return vertices, at_rest, posed, area, area > 1e-12 * max(float(area.max(initial=0.0)), 1e-300)


def of_vertices(topology: Topology, rest: np.ndarray, pose: np.ndarray, jacobians: Jacobians | None) -> np.ndarray:
    """The logarithm of posed length by rest length of the texture, in the direction in which it differs most from 0:
    (vertices,), a mean over the triangles around a vertex by their areas.

    `jacobians` gives the redirection's derivatives at UVs (n, 2), as (n, 2, 2); None: the texture is looked up at the
    mesh's own UVs. With M the posed, R the resting and U the UV edges of a triangle and J the derivative, what is
    painted around a point is deformed by M U^-1 J^-1 U R^-1.
    """
    corners = topology.triangles
    vertices, at_rest, posed, area, whole = _edges(topology.corner_vertices[corners], rest, pose)
    if jacobians is None:
        middle = np.broadcast_to(np.eye(2), at_rest.shape)
    else:
        uv = topology.uvs[corners].astype(np.float64)
        sides = _sides(uv)
        whole &= np.abs(_determinant(sides)) > 1e-14
        sides[~whole] = np.eye(2)
        derivative = jacobians(uv.mean(1))
        derivative[np.abs(_determinant(derivative)) < 1e-6] = np.eye(2)
        middle = _inverse(sides) @ _inverse(derivative) @ sides
    at_rest[~whole] = np.eye(2)
    largest, smallest = logarithms(posed @ middle @ _inverse(at_rest))
    values = np.where(np.abs(largest) >= np.abs(smallest), largest, smallest)
    return _means(vertices, area * whole, values, len(rest))


def of_surface(topology: Topology, rest: np.ndarray, pose: np.ndarray) -> np.ndarray:
    """Largest stretch and largest squash of the surface itself at each vertex, as shares of its length at rest; and 0:
    (vertices, 3) float32."""
    vertices, at_rest, posed, area, whole = _edges(topology.corner_vertices[topology.triangles], rest, pose)
    at_rest[~whole] = np.eye(2)
    largest, smallest = logarithms(posed @ _inverse(at_rest))
    shares = (np.maximum(np.expm1(largest), 0), np.maximum(-np.expm1(smallest), 0))
    found = [_means(vertices, area * whole, share, len(rest)) for share in shares]
    return np.stack([*found, np.zeros(len(rest))], -1).astype(np.float32)


def _means(vertices: np.ndarray, weights: np.ndarray, values: np.ndarray, count: int) -> np.ndarray:
    """Of values of triangles, around each vertex."""
    around, each = vertices.ravel(), np.repeat(weights, 3)
    return np.bincount(around, each * np.repeat(values, 3), count) / np.maximum(
        np.bincount(around, each, count), 1e-300
    )


# The rigidity of UVs (n, 2), which lie in triangles' corners (n, 3) with weights (n, 3).
Rigidity = Callable[[np.ndarray, np.ndarray, np.ndarray], np.ndarray]


def whole_share(topology: Topology, rigidity: Rigidity) -> float:
    """The share of the rigid part of the UV map in triangles that are rigid as a whole; 1 without any."""
    corners = topology.triangles
    rigid = rigid_samples(corners, topology.uvs, rigidity)
    area = areas(topology.uvs[corners])
    total = (area * rigid.mean(1)).sum()
    return float((area * rigid.all(1)).sum() / total) if total else 1.0


def of_features(topology: Topology, rest: np.ndarray, pose: np.ndarray, shown: np.ndarray, rigidity: Rigidity) -> float:
    """The RMS strain of rigid parts along u and v, with the UVs `shown`, (corners, 2), which are linear on each
    triangle."""
    corners = topology.triangles
    _, at_rest, posed, own, _ = _edges(topology.corner_vertices[corners], rest, pose)
    sides, moved = (_sides(of[corners].astype(np.float64)) for of in (topology.uvs, shown))
    area = np.abs(_determinant(sides))
    whole = (area > 1e-14) & (own > 0) & (np.abs(_determinant(moved)) > 1e-14)
    sides[~whole] = moved[~whole] = np.eye(2)
    before, after = (np.linalg.norm(m @ _inverse(n), axis=-2) for m, n in ((at_rest, sides), (posed, moved)))
    strained = ((after / np.where(whole[:, None], before, 1) - 1) ** 2).mean(-1)
    weights = area * whole * rigid_samples(corners, shown, rigidity).mean(1)
    return float((weights * strained).sum() / max(weights.sum(), 1e-300)) ** 0.5


def areas(uvs: np.ndarray) -> np.ndarray:
    """Of triangles in the UV map, (n, 3, 2)."""
    return np.abs(_determinant(_sides(uvs.astype(np.float64)))) / 2


def located(uvs: np.ndarray, at: np.ndarray) -> tuple[int, np.ndarray]:
    """The triangle of UVs (n, 3, 2), all with an area, that has a UV, or else comes nearest to it; and the weights of
    its corners there, (3,)."""
    weights = session.library("vrtm.bake.raster").weights_at(uvs.astype(np.float64), at)
    found = int((weights.min(-1) * np.sqrt(areas(uvs))).argmax())
    nearest = weights[found].clip(0)
    return found, nearest / nearest.sum()


def rigid_samples(corners: np.ndarray, uvs: np.ndarray, rigidity: Rigidity) -> np.ndarray:
    """Rigidity of fifteen points of each triangle, (triangles, 15) bool: features may be smaller than a triangle."""
    lattice = (np.array([(i, j, 4 - i - j) for i in range(5) for j in range(5 - i)]) + 1 / 3) / 5
    each, weights = np.repeat(corners, len(lattice), 0), np.tile(lattice, (len(corners), 1))
    at = (uvs[each] * weights[..., None]).sum(1)
    return (rigidity(at, each, weights) > 0.5).reshape(len(corners), -1)


def _sides(uv: np.ndarray) -> np.ndarray:
    """Two sides of each triangle in the UV map: (n, 2, 2), a side per column."""
    return np.stack([uv[:, 1] - uv[:, 0], uv[:, 2] - uv[:, 0]], -1)


def _determinant(m: np.ndarray) -> np.ndarray:
    return m[..., 0, 0] * m[..., 1, 1] - m[..., 0, 1] * m[..., 1, 0]


def _inverse(m: np.ndarray) -> np.ndarray:
    swapped = np.stack([np.stack([m[..., 1, 1], -m[..., 0, 1]], -1), np.stack([-m[..., 1, 0], m[..., 0, 0]], -1)], -2)
    return swapped / _determinant(m)[..., None, None]


def logarithms(m: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Of the larger and the smaller singular value."""
    half = (m * m).sum((-2, -1)) / 2
    product = np.abs(_determinant(m))
    root = np.sqrt(np.maximum(half * half - product * product, 0))
    largest = np.log(np.maximum(half + root, 1e-12)) / 2
    return largest, np.log(np.maximum(product, 1e-12)) - largest


def colours(values: np.ndarray, full: float = FULL) -> np.ndarray:
    """Red where stretched, blue where squeezed, grey where as at rest: (n, 4) float32."""
    amount = np.clip(values / full, -1, 1)[:, None]
    ends = np.where(amount > 0, _STRETCHED, _SQUEEZED)
    mixed = _NOTHING + np.abs(amount) * (ends - _NOTHING)
    return np.concatenate([mixed, np.ones((len(values), 1))], -1).astype(np.float32)
