//! relax: descent node by node (method §6). With its neighbours fixed, each node takes its 2x2 Gauss-Newton step,
//! limited so that no corner Jacobian falls below ε.
//!
//! Blocks of one block colour (x & 1, y & 1) do not touch. They are relaxed in parallel, each with its four node
//! colours in turn and with its halo frozen, so the bits do not depend on the order of the blocks. Gathering a block
//! takes a third of the time of a sweep; therefore two sweeps are done on a gathered block.

use std::hint::black_box;

use vrtm_core::method::law::{MAX_NODE_STEP, MIN_JACOBIAN, MIN_NODE_STEP, SWEPT_MARGIN, passes};

use super::buffers::State;
use super::lanes::{LANES, Lanes, Mask, Vectorised, dispatch, each};
use super::patch::{NodeState, Patch, Source};
use super::row::{Offsets, Row};
use super::run::{Run, SurfaceFn};
use super::sampling::{GridRow, Surface};
use super::terms::{CORNERS, Model, cross, least_jacobian};

impl Run<'_> {
    /// Relaxes a level. `fraction` is the step fraction per chart (1 if absent).
    pub(super) fn relax_level(&mut self, level: usize, sweeps: u32, fraction: Option<&[f32]>) {
        self.count_updates(level, sweeps);
        self.with_surface(level, Relax { level, sweeps, fraction });
    }
}

/// Sweeps over all active blocks of a level.
pub struct Relax<'a> {
    pub level: usize,
    pub sweeps: u32,
    /// Step fraction per chart (1 if absent). Sweeps after a partial correction use the same fraction, so that both
    /// fade in together.
    pub fraction: Option<&'a [f32]>,
}

impl SurfaceFn<()> for Relax<'_> {
    fn call<S: Surface>(self, run: &Run, state: State, surface: S) {
        let level = &run.grid.levels[self.level];
        for sweeps in passes(self.sweeps) {
            // Blocks of one colour do not touch.
            for blocks in &run.work[self.level].colours {
                let next = |b| Patch::prefetch(level, state, b);
                run.each_of(blocks, next, |worker, _, b| {
                    let source = run.source(self.level, state, surface, b);
                    let fraction =
                        self.fraction.map_or(1.0, |fraction| fraction[level.blocks.list[b].chart as usize]);
                    run.patches
                        .with(worker, |patch| dispatch(RelaxBlock { patch, source, sweeps, fraction }));
                });
            }
        }
    }
}

/// Does some sweeps over a block with its halo frozen. No other item may access this block, or write to its neighbour
/// blocks, meanwhile.
struct RelaxBlock<'a, S> {
    patch: &'a mut Patch,
    source: Source<'a, S>,
    sweeps: u32,
    fraction: f32,
}

impl<S: Surface> Vectorised for RelaxBlock<'_, S> {
    type Output = ();

    #[inline(always)]
    fn run<V: Lanes>(self) {
        let RelaxBlock { patch, source, sweeps, fraction } = self;
        // SAFETY: no other item accesses the block, or writes to its neighbour blocks.
        unsafe { patch.load::<V, S>(&source, true) };
        for _ in 0..sweeps {
            for row in Row::all() {
                // Opaque: addresses of windows that are hoisted out of the loop would each be spilled.
                let (patch, row) = black_box((&mut *patch, row));
                step::<V, S>(patch, &source, row, fraction);
            }
        }
        // SAFETY: no other item accesses the block.
        unsafe { store::<S>(patch, source.state, source.b) };
    }
}

/// Writes the nodes of block `b` back to the state.
///
/// # Safety
/// No other item accesses this block meanwhile.
#[inline(always)]
unsafe fn store<S: Surface>(patch: &Patch, state: State, b: usize) {
    // SAFETY: promised by the caller.
    let (u, value) = unsafe { (state.u.get_mut(b), state.value.get_mut(b)) };
    for row in Row::all() {
        let (at, s) = (row.at(0, 0), row.slot());
        for c in 0..2 {
            u[c][s..s + LANES].copy_from_slice(&patch.u[c][at..at + LANES]);
        }
        for c in 0..3 {
            value[c][s..s + LANES].copy_from_slice(&patch.value[c][at..at + LANES]);
        }
    }
    if S::CHORDS {
        // SAFETY: promised by the caller.
        let triangle = unsafe { state.triangle.get_mut(b) };
        for row in Row::all() {
            let (at, s) = (row.at(0, 0), row.slot());
            triangle[s..s + LANES].copy_from_slice(&patch.triangle[at..at + LANES]);
        }
    }
}

/// Relaxes the nodes of one row. Their steps are multiplied by `fraction`.
#[inline(always)]
fn step<V: Lanes, S: Surface>(patch: &mut Patch, source: &Source<S>, row: Row, fraction: f32) {
    let &Source { level, surface, weights, b, .. } = source;
    let mut lanes = patch.movable_lanes::<V>(row);
    if !lanes.any() {
        return;
    }
    let (here, stiff) = (patch.node_state::<V>(row), patch.stiff[row.index()]);
    let d = row.offsets(&patch.u, &here.u);
    let mut model = patch.elastic_model(row, &here.u, &d, weights);
    if stiff {
        let slopes = patch.slopes::<V, S>(row, &here);
        each!([0, 1, 2, 3, 4, 5, 6, 7], |k| {
            let edge = patch.edge_model::<V, S>(row, &here, &d, &slopes, k);
            model.add_edge(&edge, V::one());
        });
    }
    if least_jacobian(&d).lt(V::splat(weights.room_threshold)).any() {
        patch.add_room(row, &d, weights, &mut model);
    }
    let delta = newton_step(&model, &d);
    let delta = each!([0, 1], |c| delta[c] * fraction);
    // Steps that nobody sees are not worth a sample of the surface. A comparison with NaN is false: no step.
    let square = delta[0] * delta[0] + delta[1] * delta[1];
    lanes = lanes.and(V::splat(MIN_NODE_STEP * MIN_NODE_STEP).lt(square));
    if !lanes.any() {
        return;
    }
    let u = each!([0, 1], |c| here.u[c] + lanes.select(delta[c], V::zero()));
    let mut moved = NodeState { u, samples: here.samples };
    let found = surface.sample_row(&GridRow::new(level, b, row), &u, lanes, &mut moved.samples);
    patch.accept::<V, S>(row, lanes.and(found), &moved, stiff);
}

/// The step -H⁻¹γ, clamped to `MAX_NODE_STEP` and limited so that every corner Jacobian keeps most of what it has over
/// ε; NaN if the model has no minimum.
#[inline(always)]
fn newton_step<V: Lanes>(model: &Model<V>, d: &Offsets<V>) -> [V; 2] {
    let ([gx, gy], [xx, xy, yy]) = (model.gradient, model.matrix);
    let inverse = V::one() / (xx * yy - xy * xy);
    let delta = [(xy * gy - yy * gx) * inverse, (xy * gx - xx * gy) * inverse];
    // This order keeps NaN.
    let delta = each!([0, 1], |c| V::splat(MAX_NODE_STEP).min(V::splat(-MAX_NODE_STEP).max(delta[c])));
    // J of a corner between a and b changes by δ x d_a - δ x d_b.
    let along = each!([0, 1, 2, 3, 4, 5, 6, 7], |k| cross(&delta, &d[k]));
    let mut least = V::zero();
    each!([0, 1, 2, 3, 4, 5, 6, 7, 8, 9, 10, 11], |k| {
        let (a, b) = CORNERS[k];
        let most = (cross(&d[a], &d[b]) - V::splat(MIN_JACOBIAN)) * SWEPT_MARGIN;
        least = ((along[a] - along[b]) + most).min(least);
    });
    // Only a few corners would lose more and limit the step.
    if !least.lt(V::zero()).any() {
        return delta;
    }
    let mut fraction = V::one();
    for (a, b) in CORNERS {
        let most = (cross(&d[a], &d[b]) - V::splat(MIN_JACOBIAN)).max(V::zero()) * SWEPT_MARGIN;
        let loss = along[b] - along[a];
        fraction = fraction.min(most.lt(loss).select(most / loss, V::one()));
    }
    each!([0, 1], |c| delta[c] * fraction)
}
