"""Feature-aware texturing: R. Gal, O. Sorkine and D. Cohen-Or, "Feature-aware texturing", Eurographics Symposium on
Rendering 2006; on surfaces as S. Grabli, K. Sprout and Y. Ye use it in "Feature-based texture stretch compensation
for 3D meshes", SIGGRAPH 2015 Talks.

Gal et al. warp an image by a grid over it: a binary mask tells the features, each feature gets a similarity of its
own, and the rest is warped as smoothly as possible, all by least squares. Here the image is the texture, W takes its
nodes to where they lie on the deformed surface, and the similarity is one on the surface: with the metrics G0 at rest
and G in the pose (what a step in the plane is on the surface: f'^T f'), over neighbours p, q, diagonal ones too,

    sum over features F, p, q in F of |G(W)^(1/2) (W_q - W_p) - S_F G0^(1/2) (q - p)|^2 / |G0^(1/2) (q - p)|^2
      + e sum over all p, q of |(W_q - W_p) - (q - p)|^2 / |q - p|^2,       S_F = [a_F, -b_F; b_F, a_F],

over W and all a_F, b_F. It is linear if G(W) is known: it is solved with G at the last W until W stands still. With
`rigid`, S_F is a rotation (Grabli et al.: rigid features in the deformed frame), the nearest one to the last W.

Assumed, for what we could read of both is their abstracts: the smoothness is that of first differences (Gal et al.
edit Laplacians), with e = 0.02, inside features 0.0005; the frame of the symmetric square root of the metric turns
little within a feature; features are connected sets of nodes with a rigidity over 0.5; nodes whose cells touch a
chart's border are fixed. Nothing prevents folds.
"""

import numpy as np
from case import Case
from geometry import factor, invert
from scipy.sparse import bmat, coo_matrix, diags
from scipy.sparse.csgraph import connected_components
from scipy.sparse.linalg import LinearOperator, cg
from surface import Surface, differences, sample

CELLS = 256
WEIGHT, FLOOR = 0.02, 0.0005
ITERATIONS = 12
STILL = 0.01  # RMS, in cells of the grid


def solve(case: Case, rigid: bool):
    """New UVs, the warp at the case's nodes, the iterations, and the last one's RMS move in cells of the grid."""
    surface = Surface(case, min(CELLS, case.grid))
    displacement, iterations, moved = warp(surface, rigid)
    uv, inner = case.uv.copy(), case.inner()
    uv[inner] = invert(displacement, surface.cells, case.uv[inner] / surface.scale) * surface.scale
    return uv, surface.to_case(displacement, case.grid), iterations, moved


def warp(surface: Surface, rigid: bool):
    count = len(surface.nodes)
    pairs = surface.edges(diagonals=True)
    step = surface.nodes[pairs[1]] - surface.nodes[pairs[0]]
    length = np.linalg.norm(step, axis=1)
    rigid_ends, same = surface.rigidity[pairs] > 0.5, surface.chart[pairs[0]] == surface.chart[pairs[1]]
    core = pairs[:, rigid_ends.all(axis=0) & same]
    label = connected_components(coo_matrix((np.ones(core.shape[1]), core), (count, count)), directed=False)[1]
    # A feature has the edges at its rim, too: the mask's edge lies somewhere within their cells.
    label = np.where(surface.rigidity > 0.5, label, -1)
    of_pair = label[pairs].max(axis=0)
    solid = rigid_ends.any(axis=0) & same & ((label[pairs] == of_pair) | (label[pairs] < 0)).all(axis=0)
    stiff = pairs[:, solid]
    feature = np.unique(of_pair[solid], return_inverse=True)[1]
    features = feature.max(initial=-1) + 1
    # What an edge is on the surface at rest, in the plane of the metric's square root.
    goal = np.einsum("nij,nj->ni", root(surface, surface.rest, middle(surface.nodes, stiff)), step[solid])
    scale = 1 / np.maximum(np.linalg.norm(goal, axis=1), 1e-30)
    goal = goal * scale[:, None]
    free = np.flatnonzero(surface.free)
    smooth = diags(np.sqrt(np.where(solid, FLOOR, WEIGHT)) / length) @ differences(pairs, count)[:, free]
    whole = differences(stiff, count)
    inside, rim = whole[:, free], whole[:, ~surface.free] @ surface.nodes[~surface.free]
    # The smoothness acts on displacements, which are 0 at fixed nodes; a difference of nodes is the step.
    laplacian = (smooth.T @ smooth).tocsr()
    laplacian = bmat([[laplacian, None], [None, laplacian]])
    pull = laplacian @ surface.nodes[free].T.ravel()
    rows = np.arange(len(feature))
    at, moved, change = surface.nodes.copy(), np.inf, 1.0
    iteration = 0
    while iteration < ITERATIONS:
        iteration += 1
        metric = root(surface, surface.pose, middle(at, stiff)) * scale[:, None, None]
        apply = [[diags(metric[:, i, j]) @ inside for j in range(2)] for i in range(2)]
        known = np.einsum("nij,nj->ni", metric, rim)
        if rigid:
            there = np.einsum("nij,nj->ni", metric, at[stiff[1]] - at[stiff[0]])
            turn = np.bincount(feature, (goal * there).sum(axis=1), features) + 1j * np.bincount(
                feature, goal[:, 0] * there[:, 1] - goal[:, 1] * there[:, 0], features
            )
            turned = (goal[:, 0] + 1j * goal[:, 1]) * (turn / np.maximum(np.abs(turn), 1e-30))[feature]
            known = known - np.stack([turned.real, turned.imag], axis=1)
            matrix, extra = bmat(apply), 0
        else:
            a, b = (coo_matrix((-x, (rows, feature)), (len(rows), features)) for x in goal.T)
            matrix, extra = bmat([[*apply[0], a, -b], [*apply[1], b, a]]), 2 * features
        normal = matrix.T @ matrix
        right = -(matrix.T @ known.T.ravel())
        hold = bmat([[laplacian, None], [None, 1e-12 * diags(np.ones(extra))]]) if extra else laplacian
        right[: 2 * len(free)] += pull
        matrix = (normal + hold).tocsr()
        # The matrix changes little from one iteration to the next: the first factors precondition the later ones.
        if iteration == 1:
            factors, solution = factor(matrix), None
        solution = solve_by(factors, matrix, right, solution)
        new = solution[: 2 * len(free)].reshape(2, -1).T
        before, moved = moved, float(np.sqrt(((new - at[free]) ** 2).sum(axis=1).mean()))
        if moved < STILL:
            at[free] = new
            break
        change = max(change / 2, 0.1) if moved > 0.7 * before else change
        at[free] += change * (new - at[free])
    return at - surface.nodes, iteration, moved


def solve_by(factors, matrix, right: np.ndarray, start: np.ndarray | None) -> np.ndarray:
    """Solves by conjugate gradients, preconditioned by the factors of a matrix near to this one."""
    if start is None:
        return factors.solve(right)
    size = matrix.shape
    return cg(matrix, right, x0=start, rtol=1e-6, maxiter=40, M=LinearOperator(size, factors.solve))[0]


def middle(at: np.ndarray, pairs: np.ndarray) -> np.ndarray:
    return 0.5 * (at[pairs[0]] + at[pairs[1]])


def root(surface: Surface, positions: np.ndarray, points: np.ndarray) -> np.ndarray:
    """The symmetric square root of the metric f'^T f' at points."""
    tangent = sample(positions, surface.cells, points)[1]
    metric = np.einsum("nki,nkj->nij", tangent, tangent)
    det = np.sqrt(np.maximum(metric[:, 0, 0] * metric[:, 1, 1] - metric[:, 0, 1] ** 2, 0))
    trace = metric[:, 0, 0] + metric[:, 1, 1]
    metric[:, 0, 0] += det
    metric[:, 1, 1] += det
    return metric / np.sqrt(np.maximum(trace + 2 * det, 1e-30))[:, None, None]
