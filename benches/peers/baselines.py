"""The baselines under one interface: METHODS[name].solve(case) returns a Solution, or raises NotApplicable.

Each method's module has the derivation; here are its energy and what had to be assumed, for tables and captions.
"""

import time
from collections.abc import Callable
from dataclasses import dataclass

import control_maps
import feature_aware
import mvc
import numpy as np
import overlay
import skin
import solvers
from case import Case


class NotApplicable(ValueError):
    """The method is not made for this case."""


@dataclass
class Solution:
    uv: np.ndarray  # new UVs per UV vertex, in cells: what the deformed mesh is textured with
    seconds: float  # of CPU, of all threads, of the solver alone
    iterations: int
    note: str = ""
    # For a method whose result is a warp of the texture: displacement per node of the case's grid, in cells, as vrtm's.
    # `uv` is then its inverse at the mesh's vertices, which is less than it knows; measure the warp.
    warp: np.ndarray | None = None

    def map(self) -> dict:
        """The parameterisation as the functions of measure.py take it."""
        return {"uv": self.uv} if self.warp is None else {"warp": self.warp}


@dataclass(frozen=True)
class Method:
    name: str
    energy: str
    source: str
    assumed: str
    run: Callable[[Case, np.ndarray | None], Solution]
    # Whether `start`, the UVs of the frame before, is used.
    warm: bool = False

    def solve(self, case: Case, start: np.ndarray | None = None) -> Solution:
        """New UVs for the case's pose. `start` is ignored by methods that are not `warm`."""
        begin = time.process_time()
        solution = self.run(case, start)
        if not solution.seconds:
            solution.seconds = time.process_time() - begin
        return solution


def run_original(case, start):
    return Solution(case.uv.copy(), 0.0, 0)


def run_mvc(relative):
    return lambda case, start: Solution(mvc.solve(case, relative), 0.0, 1)


def run_overlay(relative):
    def run(case, start):
        uv, iterations, moved = overlay.solve(case, relative)
        still = moved < overlay.STILL
        return Solution(uv, 0.0, iterations, "" if still else f"still moves by {moved:.2f} cells of its grid")

    return run


def run_skin(case, start):
    uv, iterations, converged = skin.solve(case, start)
    return Solution(uv, 0.0, iterations, "" if converged else "not converged")


def run_control_maps(along_axes):
    def run(case, start):
        begin = time.process_time()
        result = control_maps.solve(case, along_axes)
        if result is None:
            raise NotApplicable("no chart is a rectangle along the axes")
        uv, warp, iterations = result
        return Solution(uv, time.process_time() - begin, iterations, warp=warp)

    return run


def run_features(rigid):
    def run(case, start):
        uv, warp, iterations, moved = feature_aware.solve(case, rigid)
        still = moved < feature_aware.STILL
        note = "" if still else f"still moves by {moved:.2f} cells of its grid (RMS)"
        return Solution(uv, 0.0, iterations, note, warp)

    return run


def run_timed(solver, iterations):
    def run(case, start):
        uv, seconds = solver(case, iterations)
        moved = np.abs(uv - case.uv)[case.border].max(initial=0)
        note = f"border moved by {moved:.2f} cells" if moved > 0.05 else ""
        return Solution(uv, seconds, iterations, note)

    return run


FLOATER = "M. S. Floater, Mean value coordinates, Computer Aided Geometric Design 20(1), 2003"
SHEFFER = (
    "A. Sheffer, E. de Sturler, Smoothing an overlay grid to minimize linear distortion in texture mapping, "
    "ACM TOG 21(4), 2002"
)
OVERLAY = "sum over grid edges of w_pq |M_q - M_p|^2, w_pq = |f(M_q) - f(M_p)| / |M_q - M_p|"
OVERLAY_ASSUMED = (
    "weights are an edge's length on the surface over that in the plane, computed again until the grid stands still; "
    "nodes at borders are fixed"
)
KONIARIS = (
    "after C. Koniaris, D. Cosker, X. Yang, K. Mitchell, I. Matthews, Real-time content-aware texturing for deformable "
    "surfaces, CVMP 2013"
)
CONTROL = "sum over edges of a grid of max(R_p, R_q) (|f(W_q) - f(W_p)| / |f0(q) - f0(p)| - 1)^2 +"
FEATURES_ASSUMED = (
    "metrics by their symmetric square roots, taken again at the moved nodes; e = 0.02, inside features 0.0005; "
    "256 x 256 cells; nodes at borders are fixed"
)
DIRICHLET = "sum over triangles of A (|J|^2 + |J^-1|^2), J the map from the deformed surface to the plane"

METHODS: dict[str, Method] = {
    "original": Method("original UVs", "none", "-", "nothing", run_original),
    "mvc": Method(
        "mean value coordinates",
        "none; u_i = sum_j w_ij u_j / sum_j w_ij, w_ij = (tan(a/2) + tan(b/2)) / |x_j - x_i| on the deformed surface",
        FLOATER,
        "border fixed at the original UVs",
        run_mvc(False),
    ),
    "mvc_relative": Method(
        "mean value coordinates, relative to rest",
        "none; original UVs + map of the deformed surface - map of the rest surface, both as above",
        FLOATER,
        "the comparison with the rest pose is ours",
        run_mvc(True),
    ),
    "overlay": Method("overlay grid", OVERLAY, SHEFFER, OVERLAY_ASSUMED, run_overlay(False)),
    "overlay_relative": Method(
        "overlay grid, relative to rest",
        OVERLAY + ", divided by the edge's length at rest",
        SHEFFER,
        OVERLAY_ASSUMED + "; the comparison with the rest pose is ours",
        run_overlay(True),
    ),
    "skin": Method(
        "homogeneous sliding skin",
        "sum over triangles of A (mu/2 (tr C - 2 - 2 ln J) + lambda/2 (ln J)^2), from the rest surface at the new UVs "
        "to the deformed one",
        "after D. Li, S. Sueda, D. R. Neog, D. K. Pai, Thin skin elastodynamics, ACM TOG 32(4), 2013",
        "neo-Hookean, mu = lambda = 1, at rest (no dynamics, gravity or friction), border fixed",
        run_skin,
        warm=True,
    ),
    "control_axes": Method(
        "control maps along the axes",
        CONTROL + " sum over columns and rows of e |d_l - d_k|^2 / h^2",
        KONIARIS,
        "the measure is that of the later paper, made relative; 128 columns and rows, e = 0.001; rectangular charts "
        "only; their borders slide along themselves",
        run_control_maps(True),
    ),
    "control_free": Method(
        "control maps, free",
        CONTROL + " sum over neighbours of a lattice of e |d_l - d_k|^2 / h^2",
        KONIARIS,
        "the measure is that of the later paper, made relative; a lattice of 64 x 64, e = 0.003; rectangular charts",
        run_control_maps(False),
    ),
    "features_similar": Method(
        "feature-aware, similarities",
        "sum over features F and edges in F of |G(W)^(1/2) (W_q - W_p) - S_F G0^(1/2) (q - p)|^2 / "
        "|G0^(1/2) (q - p)|^2 + e sum over edges of |d_q - d_p|^2, S_F a similarity",
        "after R. Gal, O. Sorkine, D. Cohen-Or, Feature-aware texturing, EGSR 2006",
        FEATURES_ASSUMED,
        run_features(False),
    ),
    "features_rigid": Method(
        "feature-aware, rotations",
        "the same, with a rotation S_F",
        "after S. Grabli, K. Sprout, Y. Ye, Feature-based texture stretch compensation for 3D meshes, SIGGRAPH 2015 "
        "Talks, and Gal et al.",
        FEATURES_ASSUMED,
        run_features(True),
    ),
    "slim": Method(
        "SLIM, libigl, 50 iterations",
        DIRICHLET,
        "M. Rabinovich, R. Poranne, D. Panozzo, O. Sorkine-Hornung, Scalable locally injective mappings, ACM TOG "
        "36(2), 2017",
        "starts from the original UVs; borders held by a soft constraint of weight 1e5",
        run_timed(solvers.slim, 50),
    ),
    "blender": Method(
        "minimum stretch, Blender, 50 iterations",
        DIRICHLET,
        "Blender 5.0, unwrap with the method MINIMUM_STRETCH (SLIM)",
        "borders pinned; it starts from a map of its own",
        run_timed(solvers.blender, 50),
    ),
}
