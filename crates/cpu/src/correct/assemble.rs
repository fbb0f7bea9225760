//! Assembles the Gauss-Newton system of a level from its state (method §7.1): the pairs A_pn of neighbouring movable
//! nodes, and the right-hand side, which is minus the gradient (matrix and gradient are halves of derivatives). Instead
//! of the diagonal blocks, the symmetric parts of the row sums are formed, from which `complete` computes diagonals
//! that compensate for the rounding of the pairs.

use super::super::buffers::State;
use super::super::energy::Total;
use super::super::lanes::{LANES, Lanes, Mask, Vectorised, dispatch, each};
use super::super::patch::{NEIGHBOURS, NodeState, Patch, QUADRANTS, Source, Weights};
use super::super::row::Row;
use super::super::run::{Run, SurfaceFn};
use super::super::sampling::{GradientTerms, Slopes, Surface};
use super::super::terms::{Edge, Visitor, least_jacobian, pull_stiffness};
use super::rows::{Rows, Words, encode};
use vrtm_core::allocation::Vec;
use vrtm_core::grid::planes::Plane;
use vrtm_core::grid::window::Window;
use vrtm_core::method::law::{NEAR_BOUND_JACOBIAN, NEAR_BOUND_STIFFNESS};
use vrtm_core::team::SharedSlice;

/// Assembles the owned pairs, the row sums and the right-hand side of a level; returns the energy per chart.
pub struct Assemble<'a> {
    pub rows: &'a mut Rows,
    /// The residual of a step of 0, which is the right-hand side.
    pub residual: &'a mut [[Plane; 2]],
    pub level: usize,
}

impl SurfaceFn<Vec<f64>> for Assemble<'_> {
    fn call<S: Surface>(self, run: &Run, state: State, surface: S) -> Vec<f64> {
        let Rows { diagonal, words, .. } = self.rows;
        let (row_sums, words) = (SharedSlice::new(diagonal), SharedSlice::new(words));
        let right_hand_sides = SharedSlice::new(self.residual);
        let next = |b| Patch::prefetch_next(&run.grid.levels[self.level], state, b);
        run.sum_blocks(self.level, next, |worker, b| {
            // SAFETY: each item has its own rows.
            let (sums, words, right_hand_side) =
                unsafe { (row_sums.get_mut(b), words.get_mut(b), right_hand_sides.get_mut(b)) };
            let out = Out { sums, words, right_hand_side };
            let source = run.source(self.level, state, surface, b);
            run.patches.with(worker, |patch| {
                run.slopes.with(worker, |slopes| dispatch(AssembleBlock { patch, slopes, source, out }))
            })
        })
    }
}

/// Assembles one block's rows; returns the block's part of its chart's energy. No other item may write the state
/// meanwhile.
struct AssembleBlock<'a, S> {
    patch: &'a mut Patch,
    /// Scratch memory, which is too large for the stack of a host's thread.
    slopes: &'a mut [Window; 6],
    source: Source<'a, S>,
    out: Out<'a>,
}

/// The output of one block.
struct Out<'a> {
    /// Per node, (xx, xy, yy) of the symmetric part of its row sum.
    sums: &'a mut [Plane; 3],
    words: &'a mut Words,
    right_hand_side: &'a mut [Plane; 2],
}

impl<S: Surface> Vectorised for AssembleBlock<'_, S> {
    type Output = f64;

    #[inline(always)]
    fn run<V: Lanes>(self) -> f64 {
        let AssembleBlock { patch, slopes, source, mut out } = self;
        // SAFETY: nothing writes the state.
        unsafe { patch.load::<V, S>(&source) };
        // SAFETY: nothing writes the state.
        unsafe { patch.window_slopes::<V, S>(&source, slopes) };
        let mut total = Total::new();
        for row in Row::all() {
            block_row::<V, S>(patch, source.weights, slopes, row, &mut out, &mut total);
        }
        total.energy()
    }
}

/// Assembles the row sums, the right-hand side and the owned pairs of a row's nodes, and adds their energy to `total`.
#[inline(always)]
fn block_row<V: Lanes, S: Surface>(
    patch: &Patch,
    weights: &Weights,
    slopes: &[Window; 6],
    row: Row,
    out: &mut Out,
    total: &mut Total<V>,
) {
    let movable = patch.movable_lanes::<V>(row);
    if !movable.any() {
        for plane in out.sums.iter_mut().chain(&mut *out.right_hand_side) {
            row.store(plane, V::zero());
        }
        for plane in out.words.as_flattened_mut() {
            V::store_index(V::index_from_array([0; LANES]), plane, row.slot());
        }
        return;
    }
    let p = patch.node_state::<V>(row);
    let stiff = patch.has_stiff_edges::<V>(row, weights);
    let mut rank_one = RankOne { slopes, pairs: [[V::zero(); 4]; 8] };
    let own = each!([0, 1, 2, 3, 4, 5], |c| row.near::<V>(&slopes[c], 0, 0));
    let mut model = patch.quadratic_model::<V, S>(row, &p, &own, weights, stiff, &mut rank_one);
    total.add(patch, row, movable, weights, &model.terms);
    // Most corners are above the thresholds of both the room term and the near-bound penalty.
    let crowded = least_jacobian(&model.terms.corners)
        .lt(V::splat(weights.room_threshold.max(NEAR_BOUND_JACOBIAN)))
        .any();
    if crowded {
        for (jacobian, gradient) in &model.terms.corners {
            let stiffness = near_bound_stiffness(*jacobian);
            model.matrix[0] += stiffness * gradient[0] * gradient[0];
            model.matrix[1] += stiffness * gradient[0] * gradient[1];
            model.matrix[2] += stiffness * gradient[1] * gradient[1];
        }
    }
    for c in 0..2 {
        row.store(&mut out.right_hand_side[c], movable.select(-model.gradient[c], V::zero()));
    }
    let mut sums = model.matrix;
    let corner_pairs = if crowded { corner_pairs(patch, row, &p, weights) } else { [[V::zero(); 4]; 8] };
    each!([0, 1, 2, 3, 4, 5, 6, 7], |k| {
        let (di, dj, e, neighbour_owns) = NEIGHBOURS[k];
        let edge = patch.edge(row, &p, k);
        let mut smooth = edge.smoothness(weights);
        let mut pair = rank_one.pairs[k];
        if weights.pull > 0.0 {
            smooth += V::splat(pull_stiffness(k, weights));
        }
        pair[0] -= smooth;
        pair[3] -= smooth;
        if weights.orients() {
            let normal = edge.normal;
            let stiffness = edge.orientation(weights);
            for (c, x) in pair.iter_mut().enumerate() {
                *x -= stiffness * (normal[c / 2] * normal[c % 2]);
            }
        }
        if crowded {
            for (x, corner) in pair.iter_mut().zip(corner_pairs[k]) {
                *x += corner;
            }
        }
        // Only pairs of two movable nodes count. Lanes of fixed nodes may hold any bits, even NaN.
        let both = movable.and(V::zero().lt(V::load_u8(&patch.movable, row.at(di, dj))));
        pair = each!([0, 1, 2, 3], |c| both.select(pair[c], V::zero()));
        for (sum, x) in sums.iter_mut().zip([pair[0], (pair[1] + pair[2]) * 0.5, pair[3]]) {
            *sum += x;
        }
        if !neighbour_owns {
            for (word, plane) in encode::<V>(pair).into_iter().zip(&mut out.words[e]) {
                V::store_index(word, plane, row.slot());
            }
        }
    });
    for c in 0..3 {
        row.store(&mut out.sums[c], movable.select(sums[c], V::zero()));
    }
}

/// The distortion terms of the pairs of a row's nodes: w / max(l, floor)² g_p g_nᵀ less the stress stiffness,
/// row-major, per neighbour n.
struct RankOne<'a, V> {
    slopes: &'a [Window; 6],
    pairs: [[V; 4]; 8],
}

impl<V: Lanes> Visitor<V> for RankOne<'_, V> {
    #[inline(always)]
    fn edge<S: Surface>(
        &mut self,
        row: Row,
        k: usize,
        edge: &Edge<V>,
        near: &[V; 2],
        terms: &GradientTerms<V>,
        stress: V,
    ) {
        let (di, dj, ..) = NEIGHBOURS[k];
        let neighbour_slopes: Slopes<V> = each!([0, 1, 2, 3, 4, 5], |c| row.near(&self.slopes[c], di, dj));
        let far = S::far_gradient(terms, &neighbour_slopes);
        let stiffness = edge.weight * edge.inverse_length * edge.inverse_length;
        self.pairs[k] = each!([0, 1, 2, 3], |c| stiffness * (near[c / 2] * far[c % 2]));
        self.pairs[k][0] -= stress;
        self.pairs[k][3] -= stress;
    }
}

/// The stiffness of the near-bound penalty at a corner.
#[inline(always)]
fn near_bound_stiffness<V: Lanes>(jacobian: V) -> V {
    jacobian.lt(V::splat(NEAR_BOUND_JACOBIAN)).select(V::splat(NEAR_BOUND_STIFFNESS), V::zero())
}

/// The contributions of the room term and of the near-bound penalty to the pairs of a row's nodes with their
/// neighbours, row-major.
#[inline(always)]
fn corner_pairs<V: Lanes>(patch: &Patch, row: Row, p: &NodeState<V>, weights: &Weights) -> [[V; 4]; 8] {
    let mut pairs = [[V::zero(); 4]; 8];
    // Per quadrant, indices in `NEIGHBOURS` of the cell's other nodes: along x, along y, along the diagonal.
    const CELL_NODES: [[usize; 3]; 4] = [[0, 1, 2], [4, 1, 3], [0, 5, 7], [4, 5, 6]];
    for (&(sx, sy), [ka, kb, kc]) in QUADRANTS.iter().zip(CELL_NODES) {
        let (a, b) = (row.offset(&patch.u, &p.u, sx, 0), row.offset(&patch.u, &p.u, 0, sy));
        let c = row.offset(&patch.u, &p.u, sx, sy);
        let sign = (sx * sy) as f32;
        // J = sign (a x b): ∂J/∂p = sign (a_y - b_y, b_x - a_x), ∂J/∂a = sign (b_y, -b_x), ∂J/∂b = sign (-a_y, a_x).
        for (k, l, a, b) in [(ka, kb, &a, &b), (ka, kc, &a, &c), (kc, kb, &c, &b)] {
            let jacobian = (a[0] * b[1] - a[1] * b[0]) * sign;
            let room =
                jacobian.lt(V::splat(weights.room_threshold)).select(V::splat(weights.room), V::zero());
            let stiffness = room + near_bound_stiffness(jacobian);
            let by_p = [a[1] - b[1], b[0] - a[0]];
            let by_a = [b[1], -b[0]];
            let by_b = [-a[1], a[0]];
            for row in 0..2 {
                for column in 0..2 {
                    // The sign occurs twice in each product, so it is left out.
                    pairs[k][2 * row + column] += stiffness * by_p[row] * by_a[column];
                    pairs[l][2 * row + column] += stiffness * by_p[row] * by_b[column];
                }
            }
        }
    }
    pairs
}
