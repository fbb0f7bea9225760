//! correct: one Gauss-Newton step for all nodes of a level at once (method §7). The 9-point system of 2x2 blocks is
//! assembled and solved by conjugate gradients with a Galerkin V-cycle as preconditioner, the step is limited where
//! cells would fold, and each chart takes it only if its energy falls.

mod assemble;
mod complete;
mod conjugate_gradients;
mod falloff;
mod galerkin;
mod last_step;
mod state;
mod multigrid;
pub(super) mod rows;
mod step_limit;
#[cfg(test)]
mod tests;
mod transfer;
pub(super) mod workspace;

use vrtm_core::allocation::Vec;
use vrtm_core::grid::planes::NODES;
use vrtm_core::method::acceptance::{Correction, Gain};
use vrtm_core::method::law::trial_fractions;

use super::run::Run;
use super::sampling::resample::Start;
use vrtm_core::team::SharedSlice;
use vrtm_core::unwind::{go_on, hold_back};
use workspace::{Assembling, SolvingLevel, Stepping};

impl Run<'_> {
    /// Corrects the state of `level`, and stores the step fractions of its next correction.
    pub(super) fn correct_level(&mut self, level: usize, correction: &Correction) {
        let mut workspace = std::mem::take(&mut self.memory.workspace);
        // A warm start has already read the last result, so its memory can hold the step until certification writes the
        // new result.
        let result = std::mem::take(&mut self.result);
        let mut fraction = std::mem::take(&mut workspace.next_fraction);
        if correction.first {
            fraction.fill(1.0);
        }
        // Charts with a step fraction of 0 take no part, on any level.
        let mut all_work = std::mem::take(&mut self.spare);
        all_work.iter_mut().zip(&self.work).for_each(|(to, from)| to.copy_from(from));
        for (work, grid) in self.work.iter_mut().zip(&self.grid.levels) {
            work.retain(|b| fraction[grid.blocks.list[b as usize].chart as usize] > 0.0);
        }
        let assembling = workspace.assembling(level, result);
        let corrected = hold_back(|| self.correct_with(level, correction, assembling, &mut fraction));
        workspace.next_fraction = fraction;
        self.result = result;
        self.memory.workspace = workspace;
        self.spare = std::mem::replace(&mut self.work, all_work);
        go_on(corrected);
    }

    /// Corrects `level` with the memory of the level and of the correction. `fraction` holds the charts' step
    /// fractions.
    fn correct_with(
        &mut self,
        level: usize,
        correction: &Correction,
        mut assembling: Assembling,
        fraction: &mut [f32],
    ) {
        let (rows, residual) = assembling.system();
        let before = self.with_surface(level, assemble::Assemble { rows, residual, level });
        let mut buffers = std::mem::take(&mut self.memory.levels);
        let mut solving = assembling.solving(&mut buffers[level..]);
        let solved = hold_back(|| {
            self.complete_systems(level, &mut solving.levels, correction.first);
            self.conjugate_gradients(level, correction, &mut solving)
        });
        let limiting = solving.limiting();
        self.memory.levels = buffers;
        let predicted = go_on(solved);
        let stepping = step_limit::limit(self, level, limiting);
        self.try_fractions(level, stepping, correction, &before, &predicted, fraction);
    }

    /// Completes the matrix of `level`, and forms those of all coarser levels from it if this is the level's first
    /// correction: these precondition later corrections well enough, too. `levels` begins with `level`.
    fn complete_systems(&self, level: usize, levels: &mut [SolvingLevel], first: bool) {
        let last = if first { levels.len() - 1 } else { 0 };
        for k in 0..=last {
            complete::complete(self, level + k, &mut levels[k], k < last);
            if k < last {
                let (finer, coarser) = levels.split_at_mut(k + 1);
                galerkin::triple_product(self, level + k, &finer[k], &mut coarser[0]);
            }
        }
    }

    /// Takes the step chart by chart, relaxes, and accepts the result if the energy fell enough; otherwise tries half
    /// of the step, then a quarter, then goes back (method §7.7). Relaxation comes before acceptance because the step
    /// errs most where the surface has kinks. This error is rough and local, and a sweep removes most of it; without
    /// relaxation it would cause the step of the whole chart to be refused.
    ///
    /// `fraction` holds each chart's step fraction of this correction, and is set to that of the next one.
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
        let Stepping { fraction: node_fraction, before: displacement, step, cut } = stepping;
        let displacement = SharedSlice::new(displacement);
        let mut open: Vec<bool> =
            (0..self.charts.len()).map(|c| self.charts[c] && fraction[c] > 0.0).collect();
        let trials = trial_fractions(level);
        for (trial, &trial_fraction) in trials.iter().chain(&[0.0]).enumerate() {
            self.work[level].retain(|b| open[list[b as usize].chart as usize]);
            let (state, blocks) = (self.memory.levels[level].state(), &self.work[level].active);
            if blocks.is_empty() {
                break;
            }
            self.move_and_resample(level, state, blocks, Start::Present, |b, u| {
                // SAFETY: each item has its own block.
                let u_before = unsafe { displacement.get_mut(b) };
                if trial == 0 {
                    *u_before = *u;
                }
                let chart_fraction = trial_fraction * fraction[list[b].chart as usize];
                let (step, node_fraction) = (&step[b], &node_fraction[b][0]);
                for c in 0..2 {
                    for s in 0..NODES {
                        // With a fraction of 0 no step is taken, even where the step is NaN.
                        let taken = if chart_fraction > 0.0 {
                            chart_fraction * node_fraction[s] * step[c][s]
                        } else {
                            0.0
                        };
                        u[c][s] = u_before[c][s] + taken;
                    }
                }
            });
            // The last trial takes no step; sweeps alone might raise a chart's energy.
            let is_last = trial == trials.len();
            let energies = if is_last {
                Vec::from(before)
            } else {
                self.relax_level(level, correction.sweeps, Some(fraction));
                self.energies_with_pull(level)
            };
            for c in 0..self.charts.len() {
                if !open[c] {
                    continue;
                }
                let gain = Gain {
                    before: before[c],
                    after: energies[c],
                    identity: if level == 0 { self.results[c].energy_before } else { 0.0 },
                    predicted: predicted[c],
                    cut: cut[c].into(),
                    fraction: fraction[c],
                };
                if gain.suffices() || is_last {
                    open[c] = false;
                    // With a pull, the energy that was lowered is not that of the state alone.
                    if self.weights[level].pull == 0.0 {
                        self.known_energies[c] = Some(energies[c]);
                    }
                    fraction[c] = correction.next_fraction(&gain) as f32;
                }
            }
        }
    }
}
