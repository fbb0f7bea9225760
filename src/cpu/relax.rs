//! relax: block descent. Each node takes its own 2x2 Gauss-Newton step with its neighbours fixed, cut so that no corner
//! Jacobian falls under ε, and only if its own energy falls.
//!
//! Blocks of one block colour (x & 1, y & 1) do not touch: they run in parallel, each with all four node colours inside,
//! its ring frozen; the bits do not depend on the order. A third of a sweep is the gathering of the block: two sweeps are
//! done on it at a time.

use crate::method::law::{BOUND_SAFETY, MAX_NODE_STEP, MIN_JACOBIAN, MIN_RELATIVE_GAIN};
use crate::method::schedule::passes;
use crate::tile::Level;

use super::lanes::{Kernel, LANES, Lanes, Truth, each, wide};
use std::sync::atomic::Ordering;

use super::patch::{Patch, Place, State, Weights};
use super::row::Row;
use super::sampling::Surface;
use super::terms::Local;
use super::{Run, SurfaceFn};

impl Run<'_> {
    /// Sweeps of which each chart's nodes take a share: all of each step without any.
    pub(super) fn relax_level(&mut self, level: usize, sweeps: u32, share: Option<&[f32]>) {
        let grid = &self.grid.levels[level];
        let movable = |b: &u32| grid.movable[*b as usize].iter().map(|&m| u64::from(m)).sum::<u64>();
        let nodes: u64 = self.work[level].active.iter().map(movable).sum();
        self.node_updates.fetch_add(nodes * u64::from(sweeps), Ordering::Relaxed);
        self.with_surface(level, Relax { level, sweeps, share });
    }
}

/// Sweeps over all blocks of a level.
pub struct Relax<'a> {
    pub level: usize,
    pub sweeps: u32,
    /// Per chart, the share of each step that is taken; all of it without any. What comes with a share of a correction is
    /// as much of a share, or it would set in at once.
    pub share: Option<&'a [f32]>,
}

impl SurfaceFn<()> for Relax<'_> {
    fn call<S: Surface>(self, run: &mut Run, state: State, surface: S) {
        let level = &run.grid.levels[self.level];
        for sweeps in passes(self.sweeps) {
            run.each_colour(self.level, false, |worker, b| {
                // Blocks of one colour do not touch.
                run.patches.with(worker, |patch| {
                    let share = self.share.map_or(1.0, |share| share[level.blocks.list[b].chart as usize]);
                    wide(Pass {
                        patch,
                        level,
                        state,
                        surface,
                        weights: &run.weights[self.level],
                        b,
                        sweeps,
                        share,
                    });
                });
            });
        }
    }
}

/// Some sweeps over block `b`, its ring frozen. No other item may touch this block, or write one around it, meanwhile.
struct Pass<'a, S> {
    patch: &'a mut Patch,
    level: &'a Level,
    state: State,
    surface: S,
    weights: &'a Weights,
    b: usize,
    sweeps: u32,
    share: f32,
}

impl<S: Surface> Kernel for Pass<'_, S> {
    type Output = ();

    #[inline(always)]
    fn run<V: Lanes>(self) {
        let Pass { patch, level, state, surface, weights, b, sweeps, share } = self;
        // SAFETY: no other item touches the block, or writes one around it.
        unsafe { patch.load::<V, S>(level, state, b) };
        patch.load_slopes::<V, S>(surface);
        for _ in 0..sweeps {
            for row in Row::all() {
                step::<V, S>(patch, surface, weights, row, share);
            }
        }
        // SAFETY: as above.
        unsafe { store::<S>(patch, state, b) };
    }
}

/// Writes a block's own nodes back.
///
/// # Safety
/// No other item touches this block now.
#[inline(always)]
unsafe fn store<S: Surface>(patch: &Patch, state: State, b: usize) {
    // SAFETY: the caller's promise.
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
        // SAFETY: the caller's promise.
        let triangle = unsafe { state.triangle.get_mut(b) };
        for row in Row::all() {
            let (at, s) = (row.at(0, 0), row.slot());
            triangle[s..s + LANES].copy_from_slice(&patch.triangle[at..at + LANES]);
        }
    }
}

/// A share of one row's step.
#[inline(always)]
fn step<V: Lanes, S: Surface>(patch: &mut Patch, surface: S, weights: &Weights, row: Row, share: f32) {
    let mut lanes = patch.movable_lanes::<V>(row);
    if !lanes.any() {
        return;
    }
    let here = patch.here::<V>(row);
    let rigid = patch.is_rigid::<V>(row, weights);
    let local = patch.local::<V, S>(row, &here, weights, rigid, &mut ());
    let mut delta = newton_step(&local);
    let predicted = -(local.gradient[0] * delta[0] + local.gradient[1] * delta[1]);
    lanes = lanes.and((local.terms.energy * MIN_RELATIVE_GAIN).lt(predicted));
    if !lanes.any() {
        return;
    }
    delta = each!([0, 1], |c| delta[c] * share);
    // The second try has half the step, for lanes whose first one did not lower their energy.
    for _ in 0..2 {
        let u = each!([0, 1], |c| lanes.select(here.u[c] + delta[c], here.u[c]));
        let mut there = Place { u, on: here.on };
        let found = surface.sample_row(&patch.site(row), &u, lanes, &mut there.on);
        let energy = patch.terms::<V, S>(row, &there, weights, rigid).energy;
        // Two infinite energies say nothing about each other.
        let lower = energy.le(local.terms.energy).and(energy.lt(V::splat(f32::INFINITY)));
        let better = found.and(lower);
        patch.keep::<V, S>(row, better, &there);
        lanes = lanes.and_not(better);
        if !lanes.any() {
            return;
        }
        delta = [delta[0] * 0.5, delta[1] * 0.5];
    }
}

/// -H⁻¹ g, cut to the trusted length and to J >= ε at every corner.
#[inline(always)]
fn newton_step<V: Lanes>(local: &Local<V>) -> [V; 2] {
    let ([gx, gy], [xx, xy, yy]) = (local.gradient, local.matrix);
    let inverse = V::one() / (xx * yy - xy * xy);
    let mut delta = [(xy * gy - yy * gx) * inverse, (xy * gx - xx * gy) * inverse];
    // This also turns what is not a number into a step, which the energy then has to approve.
    delta = each!([0, 1], |c| delta[c].max(V::splat(-MAX_NODE_STEP)).min(V::splat(MAX_NODE_STEP)));
    let mut share = V::one();
    for (jacobian, slope) in &local.terms.corners {
        let change = slope[0] * delta[0] + slope[1] * delta[1];
        let margin = (*jacobian - V::splat(MIN_JACOBIAN)).max(V::zero());
        // Only corners that shrink by more than there is limit the step: few.
        let limits = margin.lt(-change);
        if limits.any() {
            share = share.min(limits.select(margin / -change, V::one()));
        }
    }
    // A hair less, against rounding.
    each!([0, 1], |c| delta[c] * share * BOUND_SAFETY)
}
