"""Mean value coordinates: M. S. Floater, "Mean value coordinates", Computer Aided Geometric Design 20(1), 2003.

The border stays. Each inner vertex i becomes the mean of its neighbours,

    sum over neighbours j of w_ij (u_j - u_i) = 0,    w_ij = (tan(a/2) + tan(b/2)) / |x_j - x_i|,

where a and b are the angles at i, on the deformed surface x, of the two triangles at the edge ij: the weights of that
paper with the angles of the triangles in space. A linear system per chart; no energy, since w_ij and w_ji differ.
Weights are positive: with a convex border the map is one-to-one, with others it may fold.

Against the rest pose: the plain method makes a map of the deformed surface as if there were no original one, and
changes the UVs of a mesh that does not deform at all. The variant `relative` adds to the original UVs the difference
of the maps of the pose and of the rest pose.
"""

import numpy as np
from case import Case
from scipy.sparse import coo_matrix
from scipy.sparse.linalg import splu


def solve(case: Case, relative: bool = False) -> np.ndarray:
    uv = case.uv.copy()
    inner = case.inner()
    for vertices, faces in case.charts():
        free = np.flatnonzero(inner[vertices])
        image = harmonic(weights(case.pose[vertices], faces), case.uv[vertices], free)
        if relative:
            image = image - harmonic(weights(case.rest[vertices], faces), case.uv[vertices], free) + case.uv[vertices]
        uv[vertices] = image
    return uv


def weights(positions: np.ndarray, faces: np.ndarray):
    """The matrix of w_ij."""
    rows, columns, values = [], [], []
    for k in range(3):
        i, j, other = (faces[:, (k + m) % 3] for m in range(3))
        to_j, to_other = positions[j] - positions[i], positions[other] - positions[i]
        # tan(a/2) = sin(a) / (1 + cos(a)); triangles without area have no angle.
        twice = np.linalg.norm(np.cross(to_j, to_other), axis=1)
        length_j, length_o = (np.maximum(np.linalg.norm(v, axis=1), 1e-30) for v in (to_j, to_other))
        product = length_j * length_o
        half = twice / np.maximum(product + (to_j * to_other).sum(axis=1), 1e-12 * product)
        rows += [i, i]
        columns += [j, other]
        values += [half / length_j, half / length_o]
    count = len(positions)
    return coo_matrix((np.concatenate(values), (np.concatenate(rows), np.concatenate(columns))), (count, count)).tocsr()


def harmonic(weight, uv: np.ndarray, free: np.ndarray) -> np.ndarray:
    """Positions in which each free vertex is the mean of its neighbours by the weights; the others stay."""
    total = np.asarray(weight.sum(axis=1)).ravel()[free]
    fixed = np.setdiff1d(np.arange(len(uv)), free)
    rows = weight[free]
    matrix = coo_matrix((total, (np.arange(len(free)),) * 2)).tocsr() - rows[:, free]
    image = uv.copy()
    image[free] = splu(matrix.tocsc()).solve(rows[:, fixed] @ uv[fixed])
    return image
