"""A homogeneous hyperelastic skin that slides: after D. Li, S. Sueda, D. R. Neog and D. K. Pai, "Thin skin
elastodynamics", ACM Transactions on Graphics 32(4), 2013.

As there, the skin is a membrane on the surface of the body, and the discretisation is Eulerian: the mesh is the
body's, and the unknown at vertex i is the material point u_i, a UV, that lies there. The material's rest shape is the
rest surface X(u). A triangle of the deformed mesh with edges e = (x_1 - x_0, x_2 - x_0) carries the material triangle
with edges E = (X(u_1) - X(u_0), X(u_2) - X(u_0)). With C = (E^T E)^-1 (e^T e), J = sqrt(det C), and A the area of the
material triangle, the energy is that of a neo-Hookean membrane, the same everywhere:

    sum over triangles of A (mu/2 (tr C - 2 - 2 ln J) + lambda/2 (ln J)^2).

Assumed, for what we could read of the paper is its abstract: the law, mu = 1 and lambda = 1 (a Poisson's ratio of 1/3
in the plane; 0 or 5 change the strain here by -2 to +8 %), the border fixed, and that the skin is at rest: the
minimum is what dynamics come to if the body stands still. No gravity and no friction. X(u) passes through the rest
vertices; between them it blends their tangent planes, so that its derivative is continuous at the vertices, where the
minimisation starts.

Solved chart by chart by L-BFGS with the stiffness matrix of the membrane as first Hessian (factorised again now and
then) and a line search that lets no triangle flip.
"""

from collections import deque

import numpy as np
from case import Case
from geometry import areas, cross, factor
from scipy.sparse import bmat, coo_matrix, diags

MU, LAMBDA = 1.0, 1.0
ITERATIONS = 300
# Converged: the predicted gain of a step is less than this fraction of the energy at the start.
GAIN = 1e-8
REFACTOR, MEMORY = 25, 8


def solve(case: Case, start: np.ndarray | None = None) -> tuple[np.ndarray, int, bool]:
    """New UVs, the iterations of all charts together, and whether all charts converged."""
    uv, total, all_converged = case.uv.copy(), 0, True
    inner = case.inner()
    for vertices, faces in case.charts():
        chart = Chart(case.rest[vertices], case.pose[vertices], case.uv[vertices], faces, inner[vertices])
        first = None if start is None else start[vertices]
        uv[vertices], iterations, converged = chart.minimise(first)
        total, all_converged = total + iterations, all_converged and converged
    return uv, total, all_converged


class Material:
    """The rest surface over the UV plane, with point location that walks from the last triangle."""

    def __init__(self, rest: np.ndarray, uv: np.ndarray, faces: np.ndarray):
        self.rest, self.uv, self.faces = rest, uv, faces
        corners = uv[faces]
        side = np.stack([corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]], axis=-1)
        self.slope = np.linalg.inv(side)  # rows: derivatives of the second and third barycentric coordinate
        space = np.stack([rest[faces[:, 1]] - rest[faces[:, 0]], rest[faces[:, 2]] - rest[faces[:, 0]]], axis=-1)
        jacobian = space @ self.slope
        # A tangent map per vertex: the mean of its triangles' by their areas in UV.
        area = np.abs(areas(uv, faces))
        self.tangent = np.zeros((len(uv), 3, 2))
        for k in range(3):
            np.add.at(self.tangent, faces[:, k], area[:, None, None] * jacobian)
        weight = np.bincount(faces.ravel(), np.repeat(area, 3), len(uv))
        self.tangent /= np.maximum(weight, 1e-30)[:, None, None]
        self.neighbour = neighbours(faces)
        self.last = np.zeros(len(uv), int)
        self.last[faces.ravel()] = np.repeat(np.arange(len(faces)), 3)

    def weights(self, points: np.ndarray) -> np.ndarray:
        """Barycentric coordinates of each point in its triangle, found by walking."""
        for _ in range(len(self.faces)):
            away = points - self.uv[self.faces[self.last, 0]]
            tail = np.einsum("nij,nj->ni", self.slope[self.last], away)
            weights = np.concatenate([1 - tail.sum(axis=1, keepdims=True), tail], axis=1)
            worst = weights.argmin(axis=1)
            beyond = self.neighbour[self.last, worst]
            go = (weights.min(axis=1) < -1e-9) & (beyond >= 0)
            if not go.any():
                break
            self.last[go] = beyond[go]
        return weights

    def __call__(self, points: np.ndarray):
        """Positions (n, 3) and their derivatives (n, 3, 2)."""
        weights = self.weights(points).clip(0, 1)
        corner = self.faces[self.last]
        # Blending weights whose derivatives vanish at the corners.
        blend, steep = weights**2 * (3 - 2 * weights), 6 * weights * (1 - weights)
        whole = blend.sum(axis=1, keepdims=True)
        blend /= whole
        slope = np.concatenate([-self.slope[self.last].sum(axis=1, keepdims=True), self.slope[self.last]], axis=1)
        steep = steep[:, :, None] * slope
        steep = (steep - blend[:, :, None] * steep.sum(axis=1, keepdims=True)) / whole[:, :, None]
        tangent = self.tangent[corner]
        plane = self.rest[corner] + np.einsum("nkij,nkj->nki", tangent, points[:, None] - self.uv[corner])
        position = (blend[:, :, None] * plane).sum(axis=1)
        return position, np.einsum("nki,nkj->nij", plane, steep) + np.einsum("nk,nkij->nij", blend, tangent)


class Chart:
    def __init__(self, rest, pose, uv, faces, inner):
        self.material, self.uv, self.free = Material(rest, uv, faces), uv, np.flatnonzero(inner)
        # Triangles without area, in UV, at rest or in the pose, have no strain.
        edges = edge_vectors(pose, faces)
        self.metric = np.einsum("nik,nil->nkl", edges, edges)
        flat = (np.linalg.det(self.metric) <= 1e-20 * np.trace(self.metric, axis1=1, axis2=2) ** 2) | (
            np.linalg.norm(np.cross(*edge_vectors(rest, faces).transpose(2, 0, 1)), axis=1) <= 0
        )
        self.faces, self.metric = faces[~flat], self.metric[~flat]
        self.turn = np.sign(areas(uv, self.faces))

    def energy(self, uv: np.ndarray):
        """The energy, and its gradient at all vertices."""
        position, tangent = self.material(uv)
        edges = edge_vectors(position, self.faces)
        material = np.einsum("nik,nil->nkl", edges, edges)
        det = material[:, 0, 0] * material[:, 1, 1] - material[:, 0, 1] ** 2
        if (det <= 0).any():
            return np.inf, None
        inverse = np.empty_like(material)
        inverse[:, 0, 0], inverse[:, 1, 1] = material[:, 1, 1] / det, material[:, 0, 0] / det
        inverse[:, 0, 1] = inverse[:, 1, 0] = -material[:, 0, 1] / det
        log = 0.5 * np.log(np.linalg.det(self.metric) / det)
        trace = (inverse * self.metric).sum(axis=(1, 2))
        density = MU / 2 * (trace - 2) - MU * log + LAMBDA / 2 * log**2
        area = 0.5 * np.sqrt(det)
        # By E^T E: that of the area, of the trace, and of ln J.
        slope = (0.5 * density - 0.5 * (LAMBDA * log - MU))[:, None, None] * inverse
        slope -= MU / 2 * inverse @ self.metric @ inverse
        force = 2 * area[:, None, None] * (edges @ slope)
        on_vertex = np.zeros_like(position)
        for k, f in enumerate((-force.sum(axis=2), force[:, :, 0], force[:, :, 1])):
            for axis in range(3):
                on_vertex[:, axis] += np.bincount(self.faces[:, k], f[:, axis], len(position))
        return float((area * density).sum()), np.einsum("ni,nij->nj", on_vertex, tangent)

    def stiffness(self, uv: np.ndarray):
        """The factorised stiffness of the free vertices: the Laplacian of the material displacements, by cotangents."""
        position, tangent = self.material(uv)
        rows, columns, values = [], [], []
        for k in range(3):
            i, j, tip = (self.faces[:, (k + m) % 3] for m in range(3))
            a, b = position[i] - position[tip], position[j] - position[tip]
            cotangent = (a * b).sum(axis=1) / np.maximum(np.linalg.norm(np.cross(a, b), axis=1), 1e-30)
            rows.append(i)
            columns.append(j)
            values.append(MU * cotangent.clip(0.05, 20))
        count = len(uv)
        weight = coo_matrix((np.concatenate(values), (np.concatenate(rows), np.concatenate(columns))), (count, count))
        weight = (weight + weight.T).tocsr()[self.free][:, self.free]
        whole = coo_matrix((np.concatenate(values * 2), (np.concatenate(rows + columns),) * 2), (count, count)).tocsr()
        laplacian = whole[self.free][:, self.free] - weight
        t = [[diags(tangent[self.free, axis, k]) for k in range(2)] for axis in range(3)]
        block = [[sum(t[a][k] @ laplacian @ t[a][m] for a in range(3)) for m in range(2)] for k in range(2)]
        matrix = bmat(block, format="csc")
        return factor(matrix + 1e-9 * diags(matrix.diagonal()))

    def minimise(self, start: np.ndarray | None):
        uv = self.uv.copy()
        if start is not None and (areas(start, self.faces) * self.turn > 0).all():
            uv[self.free] = start[self.free]
        energy, slope = self.energy(uv)
        goal = GAIN * max(energy, 1e-12)
        gradient = slope[self.free].T.ravel()
        small, steps, converged = 0, deque(maxlen=MEMORY), False
        for iteration in range(ITERATIONS):
            if iteration % REFACTOR == 0:
                stiffness = self.stiffness(uv)
                steps.clear()
            direction = -two_loop(gradient, steps, stiffness)
            gain = -float(direction @ gradient)
            if gain <= goal:
                converged = True
                break
            move = np.zeros_like(uv)
            move[self.free] = direction.reshape(2, -1).T
            length = min(1.0, 0.9 * first_flip(uv, move, self.faces, self.turn))
            for _ in range(30):
                new = uv + length * move
                new_energy, new_slope = self.energy(new)
                if new_energy <= energy - 1e-4 * length * gain and (areas(new, self.faces) * self.turn > 0).all():
                    break
                length /= 2
            else:
                # No step lowers the energy along this direction: at a kink, or at the minimum by rounding.
                if not steps:
                    converged = gain <= 100 * goal
                    break
                steps.clear()
                continue
            new_gradient = new_slope[self.free].T.ravel()
            step, change = length * direction, new_gradient - gradient
            if step @ change > 1e-12 * np.linalg.norm(step) * np.linalg.norm(change):
                steps.append((step, change))
            small = small + 1 if energy - new_energy <= goal else 0
            uv, energy, gradient = new, new_energy, new_gradient
            if small >= 5:
                converged = True
                break
        return uv, iteration, converged


def edge_vectors(positions: np.ndarray, faces: np.ndarray) -> np.ndarray:
    a, b, c = (positions[faces[:, k]] for k in range(3))
    return np.stack([b - a, c - a], axis=-1)


def neighbours(faces: np.ndarray) -> np.ndarray:
    """The triangle beyond the edge opposite of each corner, or -1."""
    ends = np.sort(np.concatenate([faces[:, [1, 2]], faces[:, [2, 0]], faces[:, [0, 1]]]), axis=1)
    key = ends[:, 0].astype(np.int64) * (faces.max() + 1) + ends[:, 1]
    order = np.argsort(key, kind="stable")
    pair = np.flatnonzero(key[order][1:] == key[order][:-1])
    a, b = order[pair], order[pair + 1]
    result = np.full(3 * len(faces), -1)
    result[a], result[b] = b % len(faces), a % len(faces)
    return result.reshape(3, -1).T


def first_flip(uv, move, faces, turn) -> float:
    """The step at which the first triangle loses its area."""
    sides, moves = edge_vectors(uv, faces), edge_vectors(move, faces)
    c = turn * cross(sides[:, :, 0], sides[:, :, 1])
    b = turn * (cross(sides[:, :, 0], moves[:, :, 1]) + cross(moves[:, :, 0], sides[:, :, 1]))
    a = turn * cross(moves[:, :, 0], moves[:, :, 1])
    inside = b * b - 4 * a * c
    root = np.where(b < 0, -b + np.sqrt(np.maximum(inside, 0)), -b - np.sqrt(np.maximum(inside, 0)))
    with np.errstate(divide="ignore", invalid="ignore"):
        steps = np.concatenate([root / (2 * a), 2 * c / root])
    steps = steps[np.concatenate([inside >= 0] * 2) & np.isfinite(steps) & (steps > 0)]
    return float(steps.min(initial=np.inf))


def two_loop(gradient: np.ndarray, steps, stiffness) -> np.ndarray:
    """The L-BFGS approximation of the inverse Hessian times the gradient."""
    q, kept = gradient.copy(), []
    for step, change in reversed(steps):
        a = step @ q / (step @ change)
        q -= a * change
        kept.append(a)
    q = stiffness.solve(q)
    for (step, change), a in zip(steps, reversed(kept)):
        q += (a - change @ q / (step @ change)) * step
    return q
