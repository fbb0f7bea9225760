//! The Gauss-Newton system of a level (method §7.1): for each pair of neighbours, the sum of w/l² g_p g_nᵀ over what depends
//! on both; the right-hand side is minus the gradient (halves of the derivatives on both sides). Of the diagonal only the
//! sum of the row is formed here: what the pairs lose to rounding has to come back in it (`rows`).

use super::super::energy::Total;
use super::super::lanes::{Kernel, LANES, Lanes, Truth, each, wide};
use super::super::patch::{NEIGHBOURS, Patch, Place, QUADRANTS, Weights};
use super::super::row::Row;
use super::super::sampling::{Chord, Slopes};
use super::super::terms::{Edge, Visitor, lowest};
use super::rows::{Words, encode};
use super::*;
use crate::method::law::{NEAR_BOUND_JACOBIAN, NEAR_BOUND_STIFFNESS};
use crate::tile::Level;
use crate::tile::blocks::SIDE;
use crate::tile::window::{Window, place};

/// Assembles the owned pairs and the sums of a level's rows, and the right-hand side; gives the energy per chart.
pub struct Assemble<'a> {
    pub rows: &'a mut Rows,
    /// Of a step of 0: the right-hand side.
    pub residual: &'a mut [[Plane; 2]],
    pub level: usize,
}

impl SurfaceFn<Vec<f64>> for Assemble<'_> {
    fn call<S: Surface>(self, run: &mut Run, state: State, surface: S) -> Vec<f64> {
        let level = &run.grid.levels[self.level];
        let blocks = &run.work[self.level].active;
        let mut sums = vec![0.0f64; blocks.len()];
        let shared = SharedSlice::new(&mut sums);
        let Rows { diagonal, words, .. } = self.rows;
        let (sums_of_rows, words) = (SharedSlice::new(diagonal), SharedSlice::new(words));
        let r = SharedSlice::new(self.residual);
        run.team.run_on(blocks.len(), |worker, k| {
            let b = blocks[k] as usize;
            let sum = run.patches.with(worker, |patch| {
                // SAFETY: each item has its own rows.
                let out = unsafe {
                    Out { sums: sums_of_rows.get_mut(b), words: words.get_mut(b), r: r.get_mut(b) }
                };
                wide(AssembleBlock {
                    patch,
                    level,
                    state,
                    surface,
                    weights: &run.weights[self.level],
                    b,
                    out,
                })
            });
            // SAFETY: each item has its own sum.
            unsafe { *shared.get_mut(k) = sum };
        });
        run.per_chart(self.level, &sums)
    }
}

/// One block's rows; gives the block's part of its chart's energy. Nothing may write the state meanwhile.
struct AssembleBlock<'a, S> {
    patch: &'a mut Patch,
    level: &'a Level,
    state: State,
    surface: S,
    weights: &'a Weights,
    b: usize,
    out: Out<'a>,
}

/// Where a block's rows are written.
struct Out<'a> {
    /// Per node, (xx, xy, yy) of its row's sum.
    sums: &'a mut [Plane; 3],
    words: &'a mut Words,
    r: &'a mut [Plane; 2],
}

impl<S: Surface> Kernel for AssembleBlock<'_, S> {
    type Output = f64;

    #[inline(always)]
    fn run<V: Lanes>(self) -> f64 {
        let AssembleBlock { patch, level, state, surface, weights, b, mut out } = self;
        // SAFETY: nothing writes the state.
        unsafe { patch.load::<V, S>(level, state, b) };
        patch.load_slopes::<V, S>(surface);
        let slopes = window_slopes::<S>(patch, surface);
        let mut total = Total::new();
        for row in Row::all() {
            block_row::<V, S>(patch, weights, &slopes, row, &mut out, &mut total);
        }
        total.energy()
    }
}

/// Slopes at all nodes of the window: the far end of an edge pulls along its own tangent plane. Far ends that are fixed
/// take no part in the step, and have none.
#[inline(always)]
fn window_slopes<S: Surface>(patch: &Patch, surface: S) -> [Window; 6] {
    let mut slopes: [Window; 6] = [[0.0; WINDOW_NODES]; 6];
    for row in Row::all() {
        let (at, s) = (row.at(0, 0), row.slot());
        for (window, plane) in slopes.iter_mut().zip(&patch.slope) {
            window[at..at + LANES].copy_from_slice(&plane[s..s + LANES]);
        }
    }
    let mut ring = |i: usize, j: usize| {
        let at = place(i, j);
        if patch.movable[at] != 0 {
            let slope = patch.slope_at_window(surface, at, i, j);
            for (window, x) in slopes.iter_mut().zip(slope) {
                window[at] = x;
            }
        }
    };
    for k in 0..SIDE + 1 {
        ring(k, 0);
        ring(SIDE + 1, k);
        ring(k + 1, SIDE + 1);
        ring(0, k + 1);
    }
    slopes
}

/// Diagonal and right-hand side of a row's nodes, and the pairs that they own.
#[inline(always)]
fn block_row<V: Lanes, S: Surface>(
    patch: &Patch,
    weights: &Weights,
    slopes: &[Window; 6],
    row: Row,
    out: &mut Out,
    total: &mut Total<V>,
) {
    let own = patch.movable_lanes::<V>(row);
    if !own.any() {
        for plane in out.sums.iter_mut().chain(&mut *out.r) {
            row.set(plane, V::zero());
        }
        for plane in out.words.as_flattened_mut() {
            V::store_index(V::index_from([0; LANES]), plane, row.slot());
        }
        return;
    }
    let p = patch.here::<V>(row);
    let rigid = patch.is_rigid::<V>(row, weights);
    let mut rank_one = RankOne { slopes, pairs: [[V::zero(); 4]; 8] };
    let mut local = patch.local::<V, S>(row, &p, weights, rigid, &mut rank_one);
    total.add(patch, row, own, weights, &local.terms);
    // Most corners are under neither the room term's threshold nor the near-bound penalty's.
    let crowded =
        lowest(&local.terms.corners).lt(V::splat(weights.room_threshold.max(NEAR_BOUND_JACOBIAN))).any();
    if crowded {
        for (jacobian, slope) in &local.terms.corners {
            let stiffness = near_bound(*jacobian);
            local.matrix[0] += stiffness * slope[0] * slope[0];
            local.matrix[1] += stiffness * slope[0] * slope[1];
            local.matrix[2] += stiffness * slope[1] * slope[1];
        }
    }
    for c in 0..2 {
        row.set(&mut out.r[c], own.select(-local.gradient[c], V::zero()));
    }
    let mut sums = local.matrix;
    let corners = if crowded { corner_pairs(patch, row, &p, weights) } else { [[V::zero(); 4]; 8] };
    each!([0, 1, 2, 3, 4, 5, 6, 7], |k| {
        let (di, dj, e, theirs) = NEIGHBOURS[k];
        let edge = patch.edge(row, &p, k);
        let smooth = edge.smoothness(weights);
        let mut pair = rank_one.pairs[k];
        pair[0] -= smooth;
        pair[3] -= smooth;
        if weights.orients() {
            let n = edge.normal;
            let kappa = edge.orientation(weights);
            for (c, x) in pair.iter_mut().enumerate() {
                *x -= kappa * (n[c / 2] * n[c % 2]);
            }
        }
        if crowded {
            for (x, corner) in pair.iter_mut().zip(corners[k]) {
                *x += corner;
            }
        }
        // Only pairs of movable nodes count; a fixed lane's numbers may be anything.
        let both = own.and(V::zero().lt(V::load_u8(&patch.movable, row.at(di, dj))));
        pair = each!([0, 1, 2, 3], |c| both.select(pair[c], V::zero()));
        for (sum, x) in sums.iter_mut().zip([pair[0], (pair[1] + pair[2]) * 0.5, pair[3]]) {
            *sum += x;
        }
        if !theirs {
            for (word, plane) in encode::<V>(pair).into_iter().zip(&mut out.words[e]) {
                V::store_index(word, plane, row.slot());
            }
        }
    });
    for c in 0..3 {
        row.set(&mut out.sums[c], own.select(sums[c], V::zero()));
    }
}

/// What the lengths of edges bring to the pairs of a row's nodes: w/l² g_p g_nᵀ, row-major.
struct RankOne<'a, V> {
    slopes: &'a [Window; 6],
    pairs: [[V; 4]; 8],
}

impl<V: Lanes> Visitor<V> for RankOne<'_, V> {
    #[inline(always)]
    fn edge<S: Surface>(&mut self, row: Row, k: usize, edge: &Edge<V>, near: &[V; 2], chord: &Chord<V>) {
        let (di, dj, ..) = NEIGHBOURS[k];
        let slope_n: Slopes<V> = each!([0, 1, 2, 3, 4, 5], |c| row.near(&self.slopes[c], di, dj));
        let far = S::far_gradient(chord, &slope_n);
        let square = edge.weight * edge.inverse * edge.inverse;
        self.pairs[k] = each!([0, 1, 2, 3], |c| square * (near[c / 2] * far[c % 2]));
    }
}

/// The near-bound penalty's stiffness at a corner.
#[inline(always)]
fn near_bound<V: Lanes>(jacobian: V) -> V {
    jacobian.lt(V::splat(NEAR_BOUND_JACOBIAN)).select(V::splat(NEAR_BOUND_STIFFNESS), V::zero())
}

/// The room term's part of the pairs of a row's nodes with their neighbours, row-major.
#[inline(always)]
fn corner_pairs<V: Lanes>(patch: &Patch, row: Row, p: &Place<V>, weights: &Weights) -> [[V; 4]; 8] {
    let mut pairs = [[V::zero(); 4]; 8];
    // Indices into `NEIGHBOURS`: along x, along y, across.
    const OF_QUADRANT: [[usize; 3]; 4] = [[0, 1, 2], [4, 1, 3], [0, 5, 7], [4, 5, 6]];
    for (&(sx, sy), [ka, kb, kc]) in QUADRANTS.iter().zip(OF_QUADRANT) {
        let (a, b) = (row.offset(&patch.u, &p.u, sx, 0), row.offset(&patch.u, &p.u, 0, sy));
        let c = row.offset(&patch.u, &p.u, sx, sy);
        let sign = (sx * sy) as f32;
        // J = sign (a x b): dJ/dp = sign (a_y - b_y, b_x - a_x), dJ/da = sign (b_y, -b_x), dJ/db = sign (-a_y, a_x).
        for (k, l, a, b) in [(ka, kb, &a, &b), (ka, kc, &a, &c), (kc, kb, &c, &b)] {
            let jacobian = (a[0] * b[1] - a[1] * b[0]) * sign;
            let room =
                jacobian.lt(V::splat(weights.room_threshold)).select(V::splat(weights.room), V::zero());
            let beta = room + near_bound(jacobian);
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
