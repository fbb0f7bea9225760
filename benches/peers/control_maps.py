"""Distortion control maps on a rectangle: C. Koniaris, D. Cosker, X. Yang, K. Mitchell and I. Matthews, "Real-time
content-aware texturing for deformable surfaces", CVMP 2013.

What we could read is its abstract, and what the paper that followed says of it: a map tells where distortion is to be
kept away; the parameter space of a rectangular area is warped, in one version along its axes only, in the other
freely; a non-linear measure of distortion is minimised. Here W warps the rectangle onto itself, f is the surface in
the pose, f0 at rest, and p, q are neighbours, diagonal ones too, of a grid of samples of the rectangle with the map's
values R:

    sum over p, q of max(R_p, R_q) (|f(W_q) - f(W_p)| / |f0(q) - f0(p)| - 1)^2
      + e sum over neighbours k, l of a lattice of |(d_l - d_k) / h|^2

with the displacement d of the lattice's nodes and its spacing h. Along the axes: all nodes of a column of the lattice
have one displacement in u, all of a row one in v, so that the borders slide along themselves. Freely: each inner node
has a displacement of its own, and borders stay.

Assumed: the measure (that of the later paper, its equation 1, made relative), the number of columns and rows (128; 64
freely), the second term and its weight e (0.001; 0.003 freely: what did best here), Levenberg-Marquardt as the
minimiser, and steps limited so that no part of the lattice folds (it may be pressed flat). A chart
counts as a rectangle if it fills its bounding box to 98 %.
"""

import numpy as np
from case import Case
from geometry import areas, factor, find, grid_nodes, grid_triangles
from scipy.sparse import bmat, coo_matrix, csr_matrix, diags, identity, kron
from skin import first_flip
from surface import differences, sample

SAMPLES = 128
# Per version: columns and rows of the lattice, and values of e: each is solved for from the result of the one before,
# which gets further than the last alone.
ALONG_AXES, FREE = (128, (1e-1, 3e-2, 1e-2, 3e-3, 1e-3)), (64, (1e-1, 3e-2, 1e-2, 3e-3))
ITERATIONS = 60


def solve(case: Case, along_axes: bool):
    """New UVs, the warp at the case's nodes, and the iterations; None if no chart is a rectangle."""
    uv, warp, total, any_chart = case.uv.copy(), np.zeros((len(case.rigidity), 2)), 0, False
    of_face = case.chart[case.faces[:, 0]]
    for chart in np.unique(of_face):
        faces = case.faces[of_face == chart]
        low, high = case.uv[faces].min(axis=(0, 1)), case.uv[faces].max(axis=(0, 1))
        if np.abs(areas(case.uv, faces)).sum() < 0.98 * np.prod(high - low):
            continue
        any_chart = True
        rectangle = Rectangle(case, faces, low, high)
        if not (rectangle.stiffness > 0.25).any():
            continue
        displacement, iterations = rectangle.minimise(along_axes)
        total += iterations
        size = (high - low) / SAMPLES
        nodes = grid_nodes(case.grid)
        inside = ((nodes >= low - 1e-6) & (nodes <= high + 1e-6)).all(axis=1)
        warp[inside] = sample(displacement, SAMPLES, (nodes[inside] - low) / size)[0] * size
        vertices = np.unique(faces)
        at, triangles = grid_nodes(SAMPLES), grid_triangles(SAMPLES)
        found, weights, least = find(at + displacement, triangles, (case.uv[vertices] - low) / size)
        back = (weights[:, :, None] * at[triangles[found]]).sum(axis=1) * size + low
        uv[vertices] = np.where((least > -1e-3)[:, None], back, case.uv[vertices])
    return (uv, warp, total) if any_chart else None


class Rectangle:
    """Samples of a rectangle; coordinates are in samples."""

    def __init__(self, case: Case, faces: np.ndarray, low: np.ndarray, high: np.ndarray):
        self.nodes = grid_nodes(SAMPLES)
        at = low + self.nodes * (high - low) / SAMPLES
        middle = (low + high) / 2
        found, weights, _ = find(case.uv, faces, middle + (at - middle) * (1 - 1e-9))
        weights = weights.clip(0, 1)[:, :, None]
        rest, self.pose = ((weights * x[faces[found]]).sum(axis=1) for x in (case.rest, case.pose))
        rigidity = sample(case.rigidity.reshape(-1, 1), case.grid, at)[0][:, 0]
        width = SAMPLES + 1
        n = np.arange(width * width).reshape(width, width)
        pairs = [
            (n[:, :-1], n[:, 1:]),
            (n[:-1], n[1:]),
            (n[:-1, :-1], n[1:, 1:]),
            (n[:-1, 1:], n[1:, :-1]),
        ]
        pairs = np.concatenate([np.stack([a.ravel(), b.ravel()]) for a, b in pairs], axis=1)
        length = np.linalg.norm(rest[pairs[1]] - rest[pairs[0]], axis=1)
        stiffness = rigidity[pairs].max(axis=0)
        keep = (length > 0) & (stiffness > 0)
        self.pairs, self.length, self.stiffness = pairs[:, keep], length[keep], stiffness[keep]

    def residuals(self, at: np.ndarray, slopes: bool = False):
        """Weighted distortion of each pair, and its derivatives by the samples' coordinates (all u, then all v)."""
        position, tangent = sample(self.pose, SAMPLES, at)
        a, b = self.pairs
        chord = position[b] - position[a]
        length = np.linalg.norm(chord, axis=1)
        scale = np.sqrt(self.stiffness) / self.length
        value = scale * (length - self.length)
        if not slopes:
            return value
        unit = (scale / np.maximum(length, 1e-30))[:, None] * chord
        rows, count = np.arange(len(a)), len(at)
        parts = []
        for axis in range(2):
            on_a, on_b = (-(unit * tangent[a, :, axis]).sum(axis=1), (unit * tangent[b, :, axis]).sum(axis=1))
            entries = (np.concatenate([on_a, on_b]), (np.concatenate([rows, rows]), np.concatenate([a, b])))
            parts.append(coo_matrix(entries, (len(a), count)))
        return value, bmat([parts], format="csr")

    def minimise(self, along_axes: bool):
        """The displacements of the samples, in samples, and the iterations."""
        count, weights = ALONG_AXES if along_axes else FREE
        spacing, to_lattice = SAMPLES / count, lattice(count, along_axes)
        to_samples = kron(identity(2), interpolation(count), format="csr") @ to_lattice * spacing
        n = np.arange((count + 1) ** 2).reshape(count + 1, count + 1)
        near = [(n[:, :-1], n[:, 1:]), (n[:-1], n[1:])]
        near = np.concatenate([np.stack([a.ravel(), b.ravel()]) for a, b in near], axis=1)
        smooth = np.sqrt(SAMPLES**2 / count**2) * kron(identity(2), differences(near, n.size)) @ to_lattice
        corners, triangles = grid_nodes(count), grid_triangles(count)

        def energy(q, stiff):
            at = self.nodes + (to_samples @ q).reshape(2, -1).T
            return float((self.residuals(at) ** 2).sum() + q @ (stiff @ q))

        q, total = np.zeros(to_lattice.shape[1]), 0
        for weight in weights:
            stiff, damping = weight * (smooth.T @ smooth).tocsc(), 1e-4
            now = first = energy(q, stiff)
            iteration = 0
            while iteration < ITERATIONS:
                iteration += 1
                value, slope = self.residuals(self.nodes + (to_samples @ q).reshape(2, -1).T, True)
                jacobian = (slope @ to_samples).tocsr()
                hessian, gradient = (jacobian.T @ jacobian + stiff).tocsc(), jacobian.T @ value + stiff @ q
                for _ in range(12):
                    step = -factor(hessian + damping * diags(hessian.diagonal() + 1e-12)).solve(gradient)
                    at = corners + (to_lattice @ q).reshape(2, -1).T
                    move = (to_lattice @ step).reshape(2, -1).T
                    step *= min(1.0, 0.9 * first_flip(at, move, triangles, 1.0))
                    new = energy(q + step, stiff)
                    if new < now:
                        break
                    damping = max(10 * damping, 1e-6)
                else:
                    break
                damping /= 10
                gain, now, q = now - new, new, q + step
                if gain < 1e-6 * first:
                    break
            total += iteration
        return (to_samples @ q).reshape(2, -1).T, total


def lattice(count: int, along_axes: bool) -> csr_matrix:
    """From the unknowns, in spacings, to the displacements of the lattice's nodes (all u, then all v)."""
    inner = identity(count + 1, format="csr")[:, 1:-1]
    ones = csr_matrix(np.ones((count + 1, 1)))
    if along_axes:
        u, v = kron(ones, inner), kron(inner, ones)
        return bmat([[u, None], [None, v]], format="csr")
    return kron(identity(2), kron(inner, inner), format="csr")


def interpolation(count: int) -> csr_matrix:
    """Bilinear values at the samples from those at the lattice's nodes."""
    at = np.arange(SAMPLES + 1) * count / SAMPLES
    cell = np.minimum(at.astype(int), count - 1)
    rows = np.arange(SAMPLES + 1)
    part = at - cell
    entries = (np.concatenate([1 - part, part]), (np.concatenate([rows, rows]), np.concatenate([cell, cell + 1])))
    along = coo_matrix(entries, (SAMPLES + 1, count + 1)).tocsr()
    return kron(along, along, format="csr")
