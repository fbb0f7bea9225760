//! relax: descent node by node (method §6). With its neighbours fixed, each node takes its 2x2 Gauss-Newton step,
//! limited so that no corner Jacobian falls below ε; the step is kept if the node's energy does not rise.
//!
//! Blocks of one block colour (x & 1, y & 1) do not touch. They are relaxed in parallel, each with its four node
//! colours in turn and with its halo frozen, so the bits do not depend on the order of the blocks. Gathering a block
//! takes a third of the time of a sweep; therefore two sweeps are done on a gathered block.

use vrtm_core::method::law::{MAX_NODE_STEP, MIN_JACOBIAN, MIN_RELATIVE_GAIN, SWEPT_MARGIN, passes};

use super::buffers::State;
use super::lanes::{LANES, Lanes, Mask, Vectorised, dispatch, each};
use super::patch::{NodeState, Patch, Source};
use super::row::Row;
use super::run::{Run, SurfaceFn};
use super::sampling::{GridRow, Surface};
use super::terms::QuadraticModel;

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
                let next = |b| Patch::prefetch_next(level, state, b);
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
        unsafe { patch.load::<V, S>(&source) };
        for _ in 0..sweeps {
            for row in Row::all() {
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
    let here = patch.node_state::<V>(row);
    let stiff = patch.has_stiff_edges::<V>(row, weights);
    let slopes = if stiff { patch.slopes::<V, S>(row, &here) } else { [V::zero(); 6] };
    let model = patch.quadratic_model::<V, S>(row, &here, &slopes, weights, stiff, &mut ());
    let mut delta = newton_step(&model);
    let predicted = -(model.gradient[0] * delta[0] + model.gradient[1] * delta[1]);
    lanes = lanes.and((model.terms.energy * MIN_RELATIVE_GAIN).lt(predicted));
    if !lanes.any() {
        return;
    }
    delta = each!([0, 1], |c| delta[c] * fraction);
    // The second trial takes half of the step, in lanes whose first trial was not accepted.
    for _ in 0..2 {
        let u = each!([0, 1], |c| lanes.select(here.u[c] + delta[c], here.u[c]));
        let mut trial = NodeState { u, samples: here.samples };
        let found = surface.sample_row(&GridRow::new(level, b, row), &u, lanes, &mut trial.samples);
        let energy = patch.terms::<V, S>(row, &trial, weights, stiff).energy;
        // An infinite energy is never accepted, although `le` is true for two infinite energies.
        let lower = energy.le(model.terms.energy).and(energy.lt(V::splat(f32::INFINITY)));
        let better = found.and(lower);
        patch.accept::<V, S>(row, better, &trial);
        lanes = lanes.and_not(better);
        if !lanes.any() {
            return;
        }
        delta = [delta[0] * 0.5, delta[1] * 0.5];
    }
}

/// The step -H⁻¹γ, clamped to `MAX_NODE_STEP` and limited so that every corner Jacobian keeps most of what it has over
/// ε.
#[inline(always)]
fn newton_step<V: Lanes>(model: &QuadraticModel<V>) -> [V; 2] {
    let ([gx, gy], [xx, xy, yy]) = (model.gradient, model.matrix);
    let inverse = V::one() / (xx * yy - xy * xy);
    let mut delta = [(xy * gy - yy * gx) * inverse, (xy * gx - xx * gy) * inverse];
    // The clamp also turns NaN into a finite step, which is then accepted or refused by its energy.
    delta = each!([0, 1], |c| delta[c].max(V::splat(-MAX_NODE_STEP)).min(V::splat(MAX_NODE_STEP)));
    let mut fraction = V::one();
    for (jacobian, corner_gradient) in &model.terms.corners {
        let change = corner_gradient[0] * delta[0] + corner_gradient[1] * delta[1];
        let most = (*jacobian - V::splat(MIN_JACOBIAN)).max(V::zero()) * SWEPT_MARGIN;
        // Only the few corners that would lose more limit the step.
        let limits = most.lt(-change);
        if limits.any() {
            fraction = fraction.min(limits.select(most / -change, V::one()));
        }
    }
    each!([0, 1], |c| delta[c] * fraction)
}
