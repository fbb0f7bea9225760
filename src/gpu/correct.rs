//! correct: one Gauss-Newton step for all nodes of a level at once; the twin of `cpu/correct.rs`.

use super::kernels::Kernel;
use super::layout::Params;
use super::stages::{Charts, Decision};
use super::{Run, Shared};
use crate::solve::Correction;

/// Iterations of conjugate gradients.
const ITERATIONS: u32 = 4;
/// Sweeps on either side of a V-cycle.
const SWEEPS: u32 = 2;
/// Rounds of them in each direction on the coarsest level.
const COARSEST_ROUNDS: u32 = 4;
/// Rounds of halving the step's local share, and rounds in all.
const HALVINGS: u32 = 8;
const ROUNDS: u32 = 16;
/// Parts of the step that are tried until the energy falls; the last is relaxation alone.
const TRIALS: [f32; 4] = [1.0, 0.5, 0.25, 0.0];

/// Modes of `smooth_z`.
const BACKWARDS: u32 = 1;
const FRESH: u32 = 2;

impl Run<'_> {
    pub(super) fn correct_level(&mut self, level: usize, correction: &Correction) {
        self.select(if correction.first { Charts::FirstCorrection } else { Charts::LaterCorrection });
        self.energy(level, Decision::Before, 0.0);
        let kernel = if level == 0 { Kernel::AssembleChords } else { Kernel::AssembleMetrics };
        self.each_active(kernel, level, self.at_level(level), Some(Shared::Rows));
        for k in level + 1..self.grid.levels.len() {
            self.galerkin(k);
        }
        self.conjugate_gradients(level);
        self.cut(level);
        self.select(Charts::LaterCorrection);
        for (n, part) in TRIALS.into_iter().enumerate() {
            let kernel = if level == 0 { Kernel::StepChords } else { Kernel::StepMetrics };
            let params = Params { part, mode: u32::from(n > 0), ..self.at_level(level) };
            self.each_active(kernel, level, params, Some(Shared::State));
            self.relax_level(level, correction.sweeps);
            let last = n + 1 == TRIALS.len();
            let decision = if last { Decision::LastTrial } else { Decision::Trial };
            self.energy(level, decision, correction.tolerance);
        }
        self.select(Charts::All);
    }

    /// The system of level `k` from the next finer one's.
    fn galerkin(&mut self, k: usize) {
        for band in 0..self.memory.bands[k].len() {
            for (n, below) in self.memory.bands[k][band].below.clone().enumerate() {
                let fine = &self.memory.buffers[k - 1][below];
                let own = [fine.blocks.clone(), fine.rows.clone()];
                let over = self.memory.lists[k][band].active_over[n];
                self.run_list(Kernel::Galerkin, [k, band], &own, over, self.params);
            }
        }
        self.exchange(k, Shared::Rows);
    }

    fn conjugate_gradients(&mut self, level: usize) {
        for mode in 0..ITERATIONS {
            self.cycle(level);
            let decision = if mode == 0 { Decision::FirstDirection } else { Decision::Direction };
            self.reduce(Kernel::ResidualDot, level, self.params, decision);
            let params = Params { mode, ..self.params };
            self.each_active(Kernel::Direction, level, params, Some(Shared::Vectors));
            self.reduce(Kernel::Curvature, level, self.params, Decision::LengthOfStep);
            let last = mode + 1 == ITERATIONS;
            self.each_active(Kernel::Advance, level, params, last.then_some(Shared::Vectors));
        }
    }

    /// z = M⁻¹ r on `level`.
    fn cycle(&mut self, level: usize) {
        let coarsest = self.grid.levels.len() - 1;
        for k in level..coarsest {
            self.smooth(k, FRESH);
            self.each_active(Kernel::Residual, k, self.params, Some(Shared::Vectors));
            self.restrict(k + 1);
        }
        for round in 0..COARSEST_ROUNDS {
            self.smooth(coarsest, if round == 0 { FRESH } else { 0 });
        }
        for _ in 0..COARSEST_ROUNDS {
            self.smooth(coarsest, BACKWARDS);
        }
        for k in (level..coarsest).rev() {
            self.add_coarse(k);
            self.smooth(k, BACKWARDS);
        }
    }

    fn smooth(&mut self, k: usize, mode: u32) {
        let params = Params { mode, sweeps: SWEEPS, ..self.params };
        self.each_colour(Kernel::Smooth, k, mode == BACKWARDS, params, Shared::Vectors);
    }

    /// The right-hand side of level `k` from the next finer one's residual.
    fn restrict(&mut self, k: usize) {
        for band in 0..self.memory.bands[k].len() {
            for (n, below) in self.memory.bands[k][band].below.clone().enumerate() {
                let fine = &self.memory.buffers[k - 1][below];
                let own = [fine.blocks.clone(), fine.vectors.clone()];
                let over = self.memory.lists[k][band].active_over[n];
                self.run_list(Kernel::Restrict, [k, band], &own, over, self.params);
            }
        }
    }

    fn add_coarse(&mut self, k: usize) {
        self.exchange(k + 1, Shared::Vectors);
        for band in 0..self.memory.bands[k].len() {
            let coarse = &self.memory.buffers[k + 1][self.memory.bands[k][band].above];
            let own = [coarse.blocks.clone(), coarse.vectors.clone()];
            let active = self.memory.lists[k][band].active;
            self.run_list(Kernel::AddCoarse, [k, band], &own, active, self.params);
        }
        self.exchange(k, Shared::Vectors);
    }

    /// The step's local share.
    fn cut(&mut self, level: usize) {
        for round in 0..ROUNDS {
            let params = Params { mode: u32::from(round > 0), ..self.params };
            self.reduce(Kernel::Mark, level, params, Decision::Cut);
            self.exchange(level, Shared::Vectors);
            let part = if round < HALVINGS { 0.5 } else { 0.0 };
            self.each_active(Kernel::Shrink, level, Params { part, ..self.params }, Some(Shared::Vectors));
            for mode in [0, 1] {
                let params = Params { mode, ..self.params };
                self.each_active(Kernel::Falloff, level, params, Some(Shared::Vectors));
            }
        }
    }
}
