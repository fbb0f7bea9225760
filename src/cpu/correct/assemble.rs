//! The Gauss-Newton system of a level: for each pair of neighbours, the sum of w/l² g_p g_nᵀ over what depends on
//! both; the right-hand side is minus the gradient (halves of the derivatives on both sides).

use std::marker::PhantomData;

use super::super::energy::BlockEnergy;
use super::super::lanes::{Kernel, LANES, V, each, wide};
use super::super::patch::{NEIGHBOURS, Patch, QUADRANTS, Weights};
use super::super::relax::MIN_JACOBIAN;
use super::super::surface::Slopes;
use super::*;
use crate::tile::blocks::SIDE;
use crate::tile::halo::{Window, place};

/// Assembles `system`; gives the energy per chart.
pub struct Assemble<'a> {
    pub system: &'a mut System,
    pub level: usize,
}

impl SurfaceFn<Vec<f64>> for Assemble<'_> {
    fn call<S: Surface>(self, run: &mut Run, state: State, surface: S) -> Vec<f64> {
        let level = &run.grid.levels[self.level];
        let blocks = &run.work[self.level].active;
        let mut sums = vec![0.0f64; blocks.len()];
        let shared = Shared::new(&mut sums);
        let (rows, r) = (Shared::new(&mut self.system.rows), Shared::new(&mut self.system.r));
        run.team.run(blocks.len(), |k| {
            let b = blocks[k] as usize;
            let sum = run.patches.with(|patch| {
                // SAFETY: nothing writes the state now, and each item has its own rows.
                let (rows, r) = unsafe {
                    patch.load(level, state, surface, b);
                    (rows.get_mut(b), r.get_mut(b))
                };
                wide(BlockRows { patch, surface, weights: &run.weights, rows, r });
                wide(BlockEnergy { patch, weights: &run.weights, as_is: false, surface: PhantomData::<S> })
            });
            // SAFETY: each item has its own sum.
            unsafe { *shared.get_mut(k) = sum };
        });
        run.per_chart(self.level, &sums)
    }
}

/// One block's rows.
struct BlockRows<'a, S> {
    patch: &'a Patch,
    surface: S,
    weights: &'a Weights,
    rows: &'a mut Rows,
    r: &'a mut [Plane; 2],
}

impl<S: Surface> Kernel for BlockRows<'_, S> {
    type Output = ();

    #[inline(always)]
    fn run(self) {
        block(self.patch, self.surface, self.weights, self.rows, self.r);
    }
}

#[inline(always)]
fn block<S: Surface>(patch: &Patch, surface: S, weights: &Weights, rows: &mut Rows, r: &mut [Plane; 2]) {
    // Slopes at all nodes of the window: the far end of an edge pulls along its own tangent plane.
    let mut slopes: [Window; 6] = [[0.0; WINDOW_NODES]; 6];
    for j in 0..SIDE + 2 {
        for i in 0..SIDE + 2 {
            let at = place(i, j);
            // Far ends that are fixed take no part in the step.
            if patch.movable[at] != 0 {
                let slope = patch.slope_at_window(surface, at, i, j);
                for (window, x) in slopes.iter_mut().zip(slope) {
                    window[at] = x;
                }
            }
        }
    }
    for row in all_rows() {
        let p = patch.here(row);
        let own = V::ZERO.lt(V::load_u8(&patch.movable, row.at(0, 0)));
        let mut local = patch.local::<S>(row, &p, weights);
        let s = row.slot();
        for (jacobian, slope) in &local.corners {
            let wall = wall(*jacobian);
            local.matrix[0] += wall * slope[0] * slope[0];
            local.matrix[1] += wall * slope[0] * slope[1];
            local.matrix[2] += wall * slope[1] * slope[1];
        }
        for c in 0..3 {
            // Fixed nodes get the identity, so that nothing divides by zero.
            let identity = if c == 1 { V::ZERO } else { V::ONE };
            own.select(local.matrix[c], identity).store(&mut rows.diagonal[c], s);
        }
        for c in 0..2 {
            own.select(-local.gradient[c], V::ZERO).store(&mut r[c], s);
        }
        let corners = corner_pairs(patch, row, &p, weights);
        for (k, &(di, dj, e, theirs)) in NEIGHBOURS.iter().enumerate() {
            let edge = patch.edge(row, &p, k);
            let (_, near, chord) = S::gradient(&p.value, &p.slope, &edge.value, edge.same, &edge.d);
            let slope_n: Slopes = each!([0, 1, 2, 3, 4, 5], |c| V::load(&slopes[c], edge.at));
            let far = S::far_gradient(&chord, &slope_n);
            let square = edge.weight * edge.inverse * edge.inverse;
            let smooth = edge.smoothness(weights);
            let mut pair = [
                square * (near[0] * far[0]) - smooth,
                square * (near[0] * far[1]),
                square * (near[1] * far[0]),
                square * (near[1] * far[1]) - smooth,
            ];
            if weights.orientation > 0.0 {
                let n = edge.normal;
                let kappa = weights.orientation * edge.shorter * edge.shorter;
                for (c, x) in pair.iter_mut().enumerate() {
                    *x -= V::splat(kappa * n[c / 2] * n[c % 2]);
                }
            }
            for (x, corner) in pair.iter_mut().zip(corners[k]) {
                *x += corner;
            }
            // A pair that the neighbour owns is stored at its place, transposed.
            let at = if theirs { row.at(di, dj) } else { row.at(0, 0) };
            for c in 0..4 {
                let from = if theirs { [0, 2, 1, 3][c] } else { c };
                let target = &mut rows.pair[4 * e + c];
                for lane in 0..LANES {
                    // Only pairs of movable nodes count; a fixed lane's numbers may be anything.
                    let both = own.0[lane] != 0 && patch.movable[edge.at + lane] != 0;
                    if own.0[lane] != 0 {
                        target[at + lane] = if both { pair[from].0[lane] } else { 0.0 };
                    } else if !theirs {
                        target[at + lane] = 0.0;
                    }
                }
            }
        }
    }
}

/// Under this corner Jacobian the step meets a wall, ...
const WALL_JACOBIAN: f32 = 2.5 * MIN_JACOBIAN;
/// ... of this weight in the step's system (not in the energy): where the bound on J is active, the step slides along it
/// instead of being cut by it.
const WALL: f32 = 10.0;

/// The wall's weight at a corner.
#[inline(always)]
fn wall(jacobian: V) -> V {
    jacobian.lt(V::splat(WALL_JACOBIAN)).select(V::splat(WALL), V::ZERO)
}

/// The room term's part of the pairs of a row's nodes with their neighbours, row-major.
#[inline(always)]
fn corner_pairs(patch: &Patch, row: Row, p: &super::super::patch::Place, weights: &Weights) -> [[V; 4]; 8] {
    let mut pairs = [[V::ZERO; 4]; 8];
    for &(sx, sy) in &QUADRANTS {
        let to = |di: i64, dj: i64| {
            let n = row.at(di, dj);
            [(V::load(&patch.u[0], n) - p.u[0]) + di as f32, (V::load(&patch.u[1], n) - p.u[1]) + dj as f32]
        };
        let (a, b, c) = (to(sx, 0), to(0, sy), to(sx, sy));
        let sign = (sx * sy) as f32;
        let index =
            |di: i64, dj: i64| NEIGHBOURS.iter().position(|n| (n.0, n.1) == (di, dj)).unwrap_or_default();
        let (ka, kb, kc) = (index(sx, 0), index(0, sy), index(sx, sy));
        // J = sign (a x b): dJ/dp = sign (a_y - b_y, b_x - a_x), dJ/da = sign (b_y, -b_x), dJ/db = sign (-a_y, a_x).
        for (k, l, a, b) in [(ka, kb, &a, &b), (ka, kc, &a, &c), (kc, kb, &c, &b)] {
            let jacobian = (a[0] * b[1] - a[1] * b[0]) * sign;
            let room = jacobian.lt(V::splat(weights.room_threshold)).select(V::splat(weights.room), V::ZERO);
            let beta = room + wall(jacobian);
            let own = [a[1] - b[1], b[0] - a[0]];
            let first = [b[1], -b[0]];
            let second = [-a[1], a[0]];
            for row in 0..2 {
                for column in 0..2 {
                    // The sign squares away.
                    pairs[k][2 * row + column] += beta * own[row] * first[column];
                    pairs[l][2 * row + column] += beta * own[row] * second[column];
                }
            }
        }
    }
    pairs
}
