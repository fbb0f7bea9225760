//! correct: one Gauss-Newton step for all nodes of a level at once (method §7). The 9-point system of 2x2 blocks is
//! assembled and solved by conjugate gradients around a Galerkin V-cycle, the step is limited where cells would fold, and
//! each chart takes it only if its energy falls.

mod assemble;
mod conjugate_gradients;
mod galerkin;
#[cfg(all(feature = "gpu", feature = "oracle"))]
mod inspect;
mod multigrid;
mod rows;
mod step_limit;
#[cfg(test)]
mod tests;
mod workspace;

use crate::method::acceptance::{Correction, Gain};
use crate::method::law::TRIAL_FRACTIONS;
use crate::tile::blocks::{NODES, Plane};
use crate::tile::window::WINDOW_NODES;

use super::lanes::{Kernel, LANES, Lanes, Truth, wide};
use super::patch::State;
use super::sampling::{Start, Surface};
use super::team::SharedSlice;
use super::{Run, SurfaceFn, Worker};
pub(super) use rows::Pairs;
use rows::Rows;
pub(super) use workspace::Workspace;
use workspace::{SolvingLevel, Stepping};

impl Run<'_> {
    pub(super) fn correct_level(&mut self, level: usize, correction: &Correction) {
        let mut workspace = std::mem::take(&mut self.memory.workspace);
        // A warm start has read the last result by now: its memory is free until this one is certified.
        let result = std::mem::take(&mut self.result);
        let mut fraction = std::mem::take(&mut workspace.next_fraction);
        if correction.first {
            fraction.fill(1.0);
        }
        // Charts that sit out are visited on no level.
        let work = self.work.clone();
        for (work, grid) in self.work.iter_mut().zip(&self.grid.levels) {
            work.retain(|b| fraction[grid.blocks.list[b as usize].chart as usize] > 0.0);
        }
        let mut assembling = workspace.assembling(level, result);
        let (rows, residual) = assembling.system();
        let before = self.with_surface(level, assemble::Assemble { rows, residual, level });
        let mut samples = std::mem::take(&mut self.memory.levels);
        let mut solving = assembling.solving(&mut samples[level..]);
        self.complete_systems(level, &mut solving.levels, correction.first);
        let predicted = self.conjugate_gradients(level, &mut solving);
        let mut limiting = solving.limiting();
        self.memory.levels = samples;
        step_limit::limit(self, level, &mut limiting);
        self.try_fractions(level, limiting.stepping(), correction, &before, &predicted, &mut fraction);
        workspace.next_fraction = fraction;
        self.result = result;
        self.memory.workspace = workspace;
        self.work = work;
    }

    /// Completes the system of `level`, and forms those of all coarser levels from it: `levels` begin with `level`. Those of
    /// a level's first correction precondition the further ones well enough.
    fn complete_systems(&self, level: usize, levels: &mut [SolvingLevel], first: bool) {
        let last = if first { levels.len() - 1 } else { 0 };
        for k in 0..=last {
            rows::finish(self, level + k, &mut levels[k], k < last);
            if k < last {
                let (finer, coarser) = levels.split_at_mut(k + 1);
                galerkin::restrict(self, level + k, &finer[k], &mut coarser[0]);
            }
        }
    }

    /// Takes the step chart by chart, and relaxes; where that has not lowered the energy, half of the step, or a quarter, or
    /// none. Relaxing comes first because the step errs most where the surface has kinks: a rough error, which a sweep
    /// mends, and which would otherwise hold back the whole chart.
    ///
    /// `fraction` has, per chart, the fraction of this step that it is to take, and then that of the next one.
    fn try_fractions(
        &mut self,
        level: usize,
        stepping: Stepping,
        correction: &Correction,
        before: &[f64],
        predicted: &[f64],
        fraction: &mut [f32],
    ) {
        let list = &self.grid.levels[level].blocks.list;
        let Stepping { fraction: of_node, before: displacement, step } = stepping;
        let displacement = SharedSlice::new(displacement);
        let mut open: Vec<bool> =
            (0..self.charts.len()).map(|c| self.charts[c] && fraction[c] > 0.0).collect();
        for (trial, part) in TRIAL_FRACTIONS.into_iter().chain([0.0]).enumerate() {
            self.work[level].retain(|b| open[list[b as usize].chart as usize]);
            let blocks = self.work[level].active.clone();
            if blocks.is_empty() {
                break;
            }
            self.move_and_resample(level, &blocks, Start::Present, |b, u| {
                // SAFETY: each item has its own block.
                let from = unsafe { displacement.get_mut(b) };
                if trial == 0 {
                    *from = *u;
                }
                let part = part * fraction[list[b].chart as usize];
                let (step, of_node) = (&step[b], &of_node[b][0]);
                for c in 0..2 {
                    for s in 0..NODES {
                        // 0 times a step that is NaN is no step.
                        let part = if part > 0.0 { part * of_node[s] * step[c][s] } else { 0.0 };
                        u[c][s] = from[c][s] + part;
                    }
                }
            });
            self.relax_level(level, correction.sweeps, Some(fraction));
            let energies = self.energies(level);
            for c in (0..self.charts.len()).filter(|&c| open[c]).collect::<Vec<_>>() {
                let gain = Gain {
                    before: before[c],
                    after: energies[c],
                    identity: if level == 0 { self.results[c].energy_before } else { 0.0 },
                    predicted: predicted[c],
                    fraction: fraction[c],
                };
                // The last trial is relaxation alone.
                if gain.suffices() || trial == TRIAL_FRACTIONS.len() {
                    open[c] = false;
                    if level == 0 {
                        self.known_energies[c] = Some(energies[c]);
                    }
                    fraction[c] = correction.next_fraction(&gain) as f32;
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
