//! correct: one Gauss-Newton step for all nodes of a level at once. The 9-point system of 2x2 blocks is solved by
//! conjugate gradients around a Galerkin V-cycle, the step is cut where cells would fold, and each chart takes it only
//! if its energy falls.

mod assemble;
mod cut;
mod galerkin;
mod inspect;
mod multigrid;
mod rows;
#[cfg(test)]
mod tests;

use crate::solve::{Correction, ITERATIONS, SUFFICIENT};
use crate::tile::Grid;
use crate::tile::blocks::{NODES, Plane};
use crate::tile::halo::WINDOW_NODES;

use super::lanes::{Kernel, LANES, Lanes, Truth, wide};
use super::patch::State;
use super::refresh::Start;
use super::surface::Surface;
use super::team::Shared;
use super::{Run, SurfaceFn, Worker};
pub(super) use rows::Pairs;
use rows::Rows;

/// The system of one level and the vectors that the solution needs.
#[derive(Debug, Default)]
struct System {
    rows: Rows,
    /// Right-hand side, then residual; once the system is solved, the first plane is the share of the step that a node
    /// takes.
    r: Vec<[Plane; 2]>,
    /// The preconditioner's result, then the search direction; once the system is solved, the state before the step. 0 in
    /// blocks without movable nodes.
    z: Vec<[Plane; 2]>,
    /// Residual inside the V-cycle, and A z. While a system is solved, this is the memory of the level's samples, which
    /// the step makes stale.
    t: Vec<[Plane; 3]>,
}

/// The systems of all levels.
#[derive(Debug, Default)]
pub(super) struct Systems {
    levels: Vec<System>,
    /// Solution on the coarser level that is corrected: the step. That of the finest level is where the result will be.
    x: Vec<[Plane; 2]>,
    /// Per chart: the share of the level's next step that it is to take; 0 if the last one gained too little to try again.
    next: Vec<f32>,
}

impl Systems {
    pub fn new(grid: &Grid) -> Systems {
        let zero = |n: usize| vec![[[0.0f32; NODES]; 2]; n];
        let levels = grid
            .levels
            .iter()
            .map(|level| {
                let n = level.blocks.list.len();
                System { rows: Rows::new(n), r: zero(n), z: zero(n), t: Vec::new() }
            })
            .collect();
        Systems { levels, x: zero(longest_step(grid)), next: vec![1.0; grid.movable.len()] }
    }

    /// For a solver that corrects nothing.
    pub fn none(grid: &Grid) -> Systems {
        Systems { levels: Vec::new(), x: Vec::new(), next: vec![1.0; grid.movable.len()] }
    }

    /// Bytes that `new` takes.
    pub fn bytes_for(grid: &Grid) -> u64 {
        let block = rows::BYTES + 2 * 2 * NODES * 4;
        let blocks: usize = grid.levels.iter().map(|level| level.blocks.list.len()).sum();
        (blocks * block + longest_step(grid) * 2 * NODES * 4) as u64
    }
}

/// Blocks of the largest of the coarser levels.
fn longest_step(grid: &Grid) -> usize {
    grid.levels[1..].iter().map(|level| level.blocks.list.len()).max().unwrap_or(0)
}

/// No step is this long, in cells: more than the largest grid.
const MAX_STEP: f32 = 32768.0;

/// Parts of the step that are tried until the energy falls.
const TRIALS: [f32; 3] = [1.0, 0.5, 0.25];

impl Run<'_> {
    pub(super) fn correct_level(&mut self, level: usize, plan: &Correction) {
        if plan.first {
            self.memory.systems.next.fill(1.0);
        }
        let mut systems = std::mem::take(&mut self.memory.systems);
        let work = self.work.clone();
        for (work, grid) in self.work.iter_mut().zip(&self.grid.levels) {
            work.retain(|b| systems.next[grid.blocks.list[b as usize].chart as usize] > 0.0);
        }
        let before =
            self.with_surface(level, assemble::Assemble { system: &mut systems.levels[level], level });
        let coarsest = systems.levels.len() - 1;
        self.lend_samples(&mut systems.levels[level..], level);
        // The coarser systems of the first correction precondition the next ones well enough.
        let last = if plan.first { coarsest } else { level };
        for k in level..=last {
            rows::finish(self, k, &mut systems.levels[k], k < last);
            if k < last {
                let (finer, coarser) = systems.levels.split_at_mut(k + 1);
                galerkin::restrict(self, k, &finer[k], &mut coarser[0]);
            }
        }
        // A warm start has read the last result by now.
        let result = std::mem::take(&mut self.result);
        let mut coarse = std::mem::take(&mut systems.x);
        let x: &mut [[Plane; 2]] = if level == 0 { &mut *result } else { &mut coarse };
        let predicted = self.conjugate_gradients(&mut systems.levels, level, x);
        self.lend_samples(&mut systems.levels[level..], level);
        cut::shares(self, level, &mut systems.levels[level], x);
        self.step(&mut systems, level, x, &before, &predicted, plan);
        self.result = result;
        systems.x = coarse;
        self.memory.systems = systems;
        self.work = work;
    }

    /// Gives the samples' memory from `level` on to the systems, or back.
    fn lend_samples(&mut self, systems: &mut [System], level: usize) {
        for (system, buffers) in systems.iter_mut().zip(&mut self.memory.levels[level..]) {
            std::mem::swap(&mut system.t, &mut buffers.value);
        }
    }

    /// Solves the level's system for `x`, chart by chart: the charts only share the passes over memory. Gives, per chart,
    /// by how much the quadratic model of the energy falls.
    ///
    /// Two iterations: the second direction is a sum of the preconditioner's result and of the first step, so that no
    /// direction needs to be kept.
    fn conjugate_gradients(
        &mut self,
        systems: &mut [System],
        level: usize,
        x: &mut [[Plane; 2]],
    ) -> Vec<f64> {
        let charts = self.charts.len();
        let mut predicted = vec![0.0f64; charts];
        // Of the first iteration.
        let (mut first_rz, mut first_alpha) = (vec![0.0f64; charts], vec![0.0f32; charts]);
        for iteration in 0..ITERATIONS {
            let (first, last) = (iteration == 0, iteration + 1 == ITERATIONS);
            let rz = multigrid::cycle(self, systems, level);
            let system = &mut systems[level];
            let z = Shared::new(&mut system.z);
            if !first {
                let beta: Vec<f32> = (0..charts)
                    .map(|c| {
                        let beta = (rz[c] / first_rz[c]) as f32 / first_alpha[c];
                        if beta.is_finite() { beta } else { 0.0 }
                    })
                    .collect();
                self.each_block(level, |_, b, c| {
                    // SAFETY: each item has its own block.
                    wide(Direction { z: unsafe { z.get_mut(b) }, x: &x[b], beta: beta[c] });
                });
            }
            let curvature = multigrid::multiply(self, level, &system.rows, &system.z, &mut system.t);
            let alpha: Vec<f32> = (0..charts)
                .map(|c| {
                    let alpha = (rz[c] / curvature[c]) as f32;
                    // Nothing left to solve, or not a number: no step.
                    if curvature[c] > 0.0 && alpha.is_finite() { alpha } else { 0.0 }
                })
                .collect();
            for c in 0..charts {
                predicted[c] += f64::from(alpha[c]) * rz[c];
            }
            let (x, r) = (Shared::new(x), Shared::new(&mut system.r));
            let (z, t) = (&system.z, &system.t);
            self.each_block(level, |_, b, c| {
                // SAFETY: each item has its own block.
                let (x, r) = unsafe { (x.get_mut(b), r.get_mut(b)) };
                wide(Advance { x, r, z: &z[b], t: &t[b], alpha: alpha[c], first, last });
            });
            (first_rz, first_alpha) = (rz, alpha);
        }
        predicted
    }

    /// Takes the step chart by chart, and relaxes; where that has not lowered the energy, half of the step, or a
    /// quarter, or none. Relaxing comes first because the step errs most where the surface has kinks: a rough error,
    /// which a sweep mends, and which would otherwise hold back the whole chart.
    fn step(
        &mut self,
        systems: &mut Systems,
        level: usize,
        x: &[[Plane; 2]],
        before: &[f64],
        predicted: &[f64],
        plan: &Correction,
    ) {
        let system = &mut systems.levels[level];
        let list = &self.grid.levels[level].blocks.list;
        let mut open: Vec<bool> =
            (0..self.charts.len()).map(|c| self.charts[c] && systems.next[c] > 0.0).collect();
        for (n, part) in TRIALS.into_iter().chain([0.0]).enumerate() {
            self.work[level].retain(|b| open[list[b as usize].chart as usize]);
            let blocks = self.work[level].active.clone();
            if blocks.is_empty() {
                break;
            }
            let (from, next) = (Shared::new(&mut system.z), &systems.next);
            let r = &system.r;
            self.move_and_refresh(level, &blocks, Start::Present, |b, u| {
                // SAFETY: each item has its own block.
                let from = unsafe { from.get_mut(b) };
                if n == 0 {
                    *from = *u;
                }
                let part = part * next[list[b].chart as usize];
                let (step, share) = (&x[b], &r[b][0]);
                for c in 0..2 {
                    for s in 0..NODES {
                        // No part of a step that is not a number is no step.
                        let part = if part > 0.0 { part * share[s] * step[c][s] } else { 0.0 };
                        u[c][s] = from[c][s] + part;
                    }
                }
            });
            self.relax_level(level, plan.sweeps, Some(&systems.next));
            let energies = self.energies(level);
            for c in 0..open.len() {
                let enough = f64::from(SUFFICIENT * systems.next[c]) * predicted[c];
                // A comparison with NaN is false: not accepted. The last trial is relaxation alone.
                if open[c] && (before[c] - energies[c] > enough || n == TRIALS.len()) {
                    open[c] = false;
                    let mut identity = 0.0;
                    if level == 0 {
                        self.known[c] = Some(energies[c]);
                        identity = self.outcome[c].energy_before;
                    }
                    let gain = before[c] - energies[c];
                    systems.next[c] = plan.next(before[c], identity, gain, predicted[c], systems.next[c]);
                }
            }
        }
    }

    /// Sums what all blocks of a level have, of which only active ones count, in their order, chart by chart.
    fn per_chart_of_blocks(&self, level: usize, of_block: &[f64]) -> Vec<f64> {
        let active: Vec<f64> = self.work[level].active.iter().map(|&b| of_block[b as usize]).collect();
        self.per_chart(level, &active)
    }

    /// Calls `f(thread, block, chart)` for all active blocks of a level.
    fn each_block(&self, level: usize, f: impl Fn(&Worker, usize, usize) + Sync) {
        let blocks = &self.work[level].active;
        let list = &self.grid.levels[level].blocks.list;
        self.team.run_on(blocks.len(), |worker, k| {
            let b = blocks[k] as usize;
            f(worker, b, list[b].chart as usize);
        });
    }
}

/// z += beta x in one block.
struct Direction<'a> {
    z: &'a mut [Plane; 2],
    x: &'a [Plane; 2],
    beta: f32,
}

impl Kernel for Direction<'_> {
    type Output = ();

    #[inline(always)]
    fn run<V: Lanes>(self) {
        for (z, x) in self.z.iter_mut().zip(self.x) {
            for s in (0..NODES).step_by(LANES) {
                (V::load(z, s) + V::load(x, s) * self.beta).store(z, s);
            }
        }
    }
}

/// x += alpha z and r -= alpha t in one block; x = alpha z the first time. Nobody asks for the last r.
struct Advance<'a> {
    x: &'a mut [Plane; 2],
    r: &'a mut [Plane; 2],
    z: &'a [Plane; 2],
    t: &'a [Plane; 3],
    alpha: f32,
    first: bool,
    last: bool,
}

impl Kernel for Advance<'_> {
    type Output = ();

    #[inline(always)]
    fn run<V: Lanes>(self) {
        let Advance { x, r, z, t, alpha, first, last } = self;
        for c in 0..2 {
            for s in (0..NODES).step_by(LANES) {
                let step = V::load(&z[c], s) * alpha;
                let sum = if first { step } else { V::load(&x[c], s) + step };
                // A system that f32 cannot solve must not spoil the state.
                let small = sum.lt(V::splat(MAX_STEP)).and(V::splat(-MAX_STEP).lt(sum));
                small.select(sum, V::zero()).store(&mut x[c], s);
                if !last {
                    (V::load(&r[c], s) - V::load(&t[c], s) * alpha).store(&mut r[c], s);
                }
            }
        }
    }
}
