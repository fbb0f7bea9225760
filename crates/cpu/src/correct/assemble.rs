//! Assembles the Gauss-Newton system of a level from its state (method §7.1): the pairs A_pn of neighbouring movable
//! nodes, and the right-hand side, which is minus the gradient (matrix and gradient are halves of derivatives). Instead
//! of the diagonal blocks, the symmetric parts of the row sums are formed, from which `complete` computes diagonals
//! that compensate for the rounding of the pairs.

use std::hint::black_box;

use super::super::buffers::State;
use super::super::energy::Total;
use super::super::lanes::{LANES, Lanes, Mask, Vectorised, dispatch, each};
use super::super::patch::{Patch, Source, Weights};
use super::super::row::{NEIGHBOURS, Offsets, Row};
use super::super::run::{Run, SurfaceFn};
use super::super::sampling::{Slopes, Surface};
use super::super::terms::{
    CORNERS, Model, corner_gradient, cross, elastic_stiffness, least_jacobian, normal, pull_stiffness,
};
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
        self.rows.set_uniform([0, 2].map(|k| -elastic_stiffness(k, &run.weights[self.level])));
        let Rows { diagonal, words, is_uniform, .. } = self.rows;
        let (words, uniform) = words.split_at_mut(is_uniform.len());
        let (row_sums, words) = (SharedSlice::new(diagonal), SharedSlice::new(words));
        let is_uniform = SharedSlice::new(is_uniform);
        let right_hand_sides = SharedSlice::new(self.residual);
        let next = |b| Patch::prefetch(&run.grid.levels[self.level], state, b);
        run.sum_blocks(self.level, next, |worker, b| {
            // SAFETY: each item has its own rows.
            let (sums, words, right_hand_side) =
                unsafe { (row_sums.get_mut(b), words.get_mut(b), right_hand_sides.get_mut(b)) };
            // SAFETY: as above.
            let is_uniform = unsafe { is_uniform.get_mut(b) };
            let out = Out { sums, words, right_hand_side, is_uniform, uniform: uniform.first() };
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
    /// True as long as all rows are uniform; their pairs are not in `words`.
    is_uniform: &'a mut bool,
    /// The pairs of uniform rows, if the level may have any.
    uniform: Option<&'a Words>,
}

impl<S: Surface> Vectorised for AssembleBlock<'_, S> {
    type Output = f64;

    #[inline(always)]
    fn run<V: Lanes>(self) -> f64 {
        let AssembleBlock { patch, slopes, source, mut out } = self;
        // SAFETY: nothing writes the state.
        unsafe { patch.load::<V, S>(&source, false) };
        if patch.is_stiff {
            // SAFETY: nothing writes the state.
            unsafe { patch.window_slopes::<V, S>(&source, slopes) };
        }
        *out.is_uniform = out.uniform.is_some()
            && !patch.is_stiff
            && !patch.has_hold
            && !source.weights.orients()
            && patch.movable.iter().all(|&movable| movable == 1.0);
        let mut total = Total::new();
        for row in Row::all() {
            let (patch, slopes, row) = black_box((&*patch, &*slopes, row));
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
    let d = row.offsets(&patch.u, &p.u);
    let least = least_jacobian(&d);
    let mut model = patch.elastic_model(row, &p.u, &d, weights);
    let stiff = patch.stiff[row.index()];
    let own = each!([0, 1, 2, 3, 4, 5], |c| row.near::<V>(&slopes[c], 0, 0));
    // Most corners are above the thresholds of both the room term and the near-bound penalty.
    let crowded = least.lt(V::splat(weights.room_threshold.max(NEAR_BOUND_JACOBIAN))).any();
    let mut corner_pairs = None;
    if let Some(uniform) = out.uniform.filter(|_| *out.is_uniform) {
        if !crowded {
            total.add(movable, model.energy, least);
            return uniform_row(&model, weights, row, out);
        }
        *out.is_uniform = false;
        *out.words = *uniform;
    }
    if crowded {
        patch.add_room(row, &d, weights, &mut model);
        corner_pairs = Some(add_corners(&d, weights, &mut model));
    }
    let mut sums = [V::zero(); 3];
    each!([0, 1, 2, 3, 4, 5, 6, 7], |k| {
        let (di, dj, e, neighbour_owns) = NEIGHBOURS[k];
        let mut isotropic = patch.smoothness::<V>(row, k, weights);
        if weights.pull > 0.0 {
            isotropic += V::splat(pull_stiffness(k, weights));
        }
        let mut pair = [V::zero(); 4];
        if stiff {
            let edge = patch.edge_model::<V, S>(row, &p, &d, &own, k);
            model.add_edge(&edge, patch.part(row, k));
            isotropic += edge.stress;
            let neighbour_slopes: Slopes<V> = each!([0, 1, 2, 3, 4, 5], |c| row.near(&slopes[c], di, dj));
            let far = S::far_gradient(&edge.terms, &neighbour_slopes);
            let near = each!([0, 1], |c| edge.stiffness * edge.near[c]);
            pair = each!([0, 1, 2, 3], |c| near[c / 2] * far[c % 2]);
        }
        pair[0] -= isotropic;
        pair[3] -= isotropic;
        if weights.orients() {
            let normal = normal(k);
            let stiffness = patch.orientation::<V>(row, k, weights);
            for (c, x) in pair.iter_mut().enumerate() {
                *x -= stiffness * (normal[c / 2] * normal[c % 2]);
            }
        }
        if let Some(corner_pairs) = &corner_pairs {
            pair = each!([0, 1, 2, 3], |c| pair[c] + corner_pairs[k][c]);
        }
        // Only pairs of two movable nodes count. Lanes of fixed nodes may hold any bits, even NaN.
        let both = movable.and(V::zero().lt(patch.movable_near::<V>(row, k)));
        pair = each!([0, 1, 2, 3], |c| both.select(pair[c], V::zero()));
        sums = [sums[0] + pair[0], sums[1] + (pair[1] + pair[2]), sums[2] + pair[3]];
        if !neighbour_owns {
            for (word, plane) in encode::<V>(pair).into_iter().zip(&mut out.words[e]) {
                V::store_index(word, plane, row.slot());
            }
        }
    });
    sums[1] = sums[1] * 0.5;
    total.add(movable, model.energy, least);
    for c in 0..2 {
        row.store(&mut out.right_hand_side[c], movable.select(-model.gradient[c], V::zero()));
    }
    for c in 0..3 {
        row.store(&mut out.sums[c], movable.select(model.matrix[c] + sums[c], V::zero()));
    }
}

/// Assembles the row sums and the right-hand side of nodes with uniform rows.
#[inline(always)]
fn uniform_row<V: Lanes>(model: &Model<V>, weights: &Weights, row: Row, out: &mut Out) {
    let pairs = 4.0 * (elastic_stiffness(0, weights) + elastic_stiffness(2, weights));
    for c in 0..3 {
        let sum = if c == 1 { V::zero() } else { model.matrix[c] - V::splat(pairs) };
        row.store(&mut out.sums[c], sum);
    }
    for c in 0..2 {
        row.store(&mut out.right_hand_side[c], -model.gradient[c]);
    }
}

/// Adds the near-bound penalty to the matrix. Returns the contributions of the room term and of the penalty to the
/// pairs of a row's nodes with their neighbours, row-major.
#[inline(always)]
fn add_corners<V: Lanes>(d: &Offsets<V>, weights: &Weights, model: &mut Model<V>) -> [[V; 4]; 8] {
    let mut pairs = [[V::zero(); 4]; 8];
    for (k, l) in CORNERS {
        let (a, b) = (&d[k], &d[l]);
        // J = a x b: ∂J/∂a = (b_y, -b_x), ∂J/∂b = (-a_y, a_x).
        let (by_p, by_a, by_b) = (corner_gradient(a, b), [b[1], -b[0]], [-a[1], a[0]]);
        let jacobian = cross(a, b);
        let [penalty, room] = each!([0, 1], |k| {
            let (bound, stiffness) =
                [(NEAR_BOUND_JACOBIAN, NEAR_BOUND_STIFFNESS), (weights.room_threshold, weights.room)][k];
            jacobian.lt(V::splat(bound)).select(V::splat(stiffness), V::zero())
        });
        model.add_direction(by_p, V::zero(), penalty);
        let stiffness = room + penalty;
        for row in 0..2 {
            for column in 0..2 {
                pairs[k][2 * row + column] += stiffness * by_p[row] * by_a[column];
                pairs[l][2 * row + column] += stiffness * by_p[row] * by_b[column];
            }
        }
    }
    pairs
}
