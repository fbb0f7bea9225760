"""The overlay grid: A. Sheffer and E. de Sturler, "Smoothing an overlay grid to minimize linear distortion in texture
mapping", ACM Transactions on Graphics 21(4), 2002.

A Cartesian grid covers the plane of the map that is to be improved. Weighted Laplacian smoothing moves its nodes M_p
so that the moved grid stretches lengths as the map from the surface does; its inverse, applied to the map, then makes
lengths even. Here the map is that of the deformed surface f by the original UVs, and each free node satisfies

    sum over the four neighbours q of w_pq (M_q - M_p) = 0,    w_pq = |f(M_q) - f(M_p)| / |M_q - M_p|,

that is, M minimises sum w_pq |M_q - M_p|^2 for these weights: along a line of the grid all edges get the same length on
the surface. New UVs of the mesh's vertices are M^-1 of the original ones. Rigidity is not used.

Assumed, for what we could read of the paper is its abstract: the weights (the ratio of an edge's length on the
surface to that in the plane), and that they are computed again at the moved nodes until these stand still (a single
smoothing is the first step of this). Nodes whose cells touch a chart's border are fixed, so that borders stay as with
the other methods; in the paper they move. Where the weights stay positive the map is one-to-one only if the outline
is convex.

The variant `relative` divides each weight by the edge's length on the surface at rest, |f0(q) - f0(p)|: along a line
all edges then get the same ratio of lengths, and the rest pose is left as it is if its map is.
"""

import numpy as np
from case import Case
from geometry import factor, invert
from scipy.sparse import diags
from surface import Surface, differences, sample

CELLS = 256
ITERATIONS = 40
STILL = 0.01  # in cells of the overlay grid


def solve(case: Case, relative: bool = False) -> tuple[np.ndarray, int, float]:
    """New UVs, the number of smoothings, and the largest move of the last one in cells of the overlay grid."""
    surface = Surface(case, min(CELLS, case.grid))
    displacement, iterations, moved = warp(surface, relative)
    uv = case.uv.copy()
    inner = case.inner()
    uv[inner] = invert(displacement, surface.cells, case.uv[inner] / surface.scale) * surface.scale
    return uv, iterations, moved


def warp(surface: Surface, relative: bool) -> tuple[np.ndarray, int, float]:
    pairs = surface.edges()
    gradient = differences(pairs, len(surface.nodes))
    free = np.flatnonzero(surface.free)
    inside, outside = gradient[:, free], gradient[:, np.flatnonzero(~surface.free)]
    rim = outside @ surface.nodes[~surface.free]
    at_rest = np.linalg.norm(gradient @ surface.rest, axis=1) if relative else 1.0
    at, moved, change = surface.nodes.copy(), np.inf, 1.0
    iteration = 0
    while iteration < ITERATIONS:
        iteration += 1
        on_surface = np.linalg.norm(gradient @ sample(surface.pose, surface.cells, at)[0], axis=1)
        weight = on_surface / np.maximum(np.linalg.norm(gradient @ at, axis=1), 1e-9)
        weight = weight / np.maximum(at_rest, 1e-12)
        weight = weight.clip(1e-3 * np.median(weight), 1e3 * np.median(weight))
        matrix = inside.T @ diags(weight) @ inside
        goal = -factor(matrix).solve(inside.T @ (weight[:, None] * rim))
        before, moved = moved, float(np.abs(goal - at[free]).max())
        if moved < STILL:
            break
        # The iteration overshoots where stretch varies within a few cells.
        change = max(change / 2, 0.1) if moved > 0.9 * before else change
        at[free] += change * (goal - at[free])
    return at - surface.nodes, iteration, moved
