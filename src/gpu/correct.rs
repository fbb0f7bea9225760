//! correct: one Gauss-Newton step for all nodes of a level at once; the twin of `cpu/correct.rs`.

use super::kernels::Kernel;
use super::layout::Params;
use super::stages::{Charts, Decision};
use super::{GateSet, Run, Shared};
use crate::solve::{Correction, ITERATIONS};

/// Sweeps on either side of a V-cycle.
const SWEEPS: u32 = 2;
/// Rounds of them in each direction on the coarsest level.
const COARSEST_ROUNDS: u32 = 4;
/// Falloffs, of two passes, before the first round.
const FALLOFFS: u32 = 2;
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
        self.open_gate(GateSet::Correction, false);
        let correcting = self.gate;
        self.energy(level, Decision::Before, None);
        let kernel = if level == 0 { Kernel::AssembleChords } else { Kernel::AssembleMetrics };
        self.each_active(kernel, level, self.at_level(level), Some(Shared::Rows));
        // The coarser systems of the first correction precondition the next ones well enough.
        if correction.first {
            for k in level + 1..self.grid.levels.len() {
                self.galerkin(k);
            }
        }
        self.conjugate_gradients(level);
        self.cut(level);
        self.gate = correcting;
        for (n, part) in TRIALS.into_iter().enumerate() {
            let kernel = if level == 0 { Kernel::StepChords } else { Kernel::StepMetrics };
            let params = Params { part, mode: u32::from(n > 0), ..self.at_level(level) };
            self.each_active(kernel, level, params, Some(Shared::State));
            self.relax_level(level, correction.sweeps, true);
            let last = n + 1 == TRIALS.len();
            let decision = if last { Decision::LastTrial } else { Decision::Trial };
            self.energy(level, decision, Some(correction));
            if n == 0 {
                // Nearly always all charts take the whole step.
                self.open_gate(GateSet::Trial, false);
            }
        }
        self.gate = None;
        self.select(Charts::All);
    }

    /// The system of level `k` from the next finer one's.
    fn galerkin(&mut self, k: usize) {
        let together = self.memory.buffers[k - 1][0].base.is_some();
        for band in 0..self.memory.bands[k].len() {
            for (n, below) in self.memory.bands[k][band].below.clone().enumerate() {
                let fine = &self.memory.buffers[k - 1][below];
                let params = Params { other_base: fine.base.unwrap_or(0), ..self.params };
                let (kernel, own) = if together {
                    (Kernel::GalerkinTogether, vec![fine.blocks.clone()])
                } else {
                    (Kernel::Galerkin, vec![fine.blocks.clone(), fine.rows.clone()])
                };
                let over = self.memory.lists[k][band].active_over[n];
                self.run_list(kernel, [k, band], &own, over, params);
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
            if mode > 0 {
                self.each_active(Kernel::Direction, level, params, Some(Shared::Vectors));
            }
            self.reduce(Kernel::Curvature, level, self.params, Decision::LengthOfStep);
            let last = mode + 1 == ITERATIONS;
            self.each_active(Kernel::Advance, level, params, last.then_some(Shared::Vectors));
        }
    }

    /// z = M⁻¹ r on `level`.
    fn cycle(&mut self, level: usize) {
        let coarsest = self.grid.levels.len() - 1;
        let small = self.memory.small.as_ref().map(|small| small.levels.first);
        let turn = small.unwrap_or(coarsest).max(level);
        for k in level..turn {
            self.smooth(k, FRESH);
            self.restrict(k);
        }
        match small {
            Some(first) => self.cycle_small(turn - first),
            None => {
                for round in 0..COARSEST_ROUNDS {
                    self.smooth(coarsest, if round == 0 { FRESH } else { 0 });
                }
                for _ in 0..COARSEST_ROUNDS {
                    self.smooth(coarsest, BACKWARDS);
                }
            }
        }
        for k in (level..turn).rev() {
            self.ascend(k);
        }
    }

    fn smooth(&mut self, k: usize, mode: u32) {
        let params = Params { mode, sweeps: SWEEPS, ..self.params };
        self.each_colour(k, mode == BACKWARDS, Shared::Vectors, |run, band, list| {
            run.run_list(Kernel::Smooth, [k, band], &[], list, params);
        });
    }

    /// The right-hand side of level `k + 1` from the residual of level `k`.
    fn restrict(&mut self, k: usize) {
        for band in 0..self.memory.bands[k].len() {
            let coarse = &self.memory.buffers[k + 1][self.memory.bands[k][band].above];
            let params = Params { other_base: coarse.base.unwrap_or(0), ..self.params };
            let own = [coarse.nodes.clone(), coarse.vectors.clone()];
            let active = self.memory.lists[k][band].active;
            self.run_list(Kernel::Restrict, [k, band], &own, active, params);
        }
    }

    /// Takes the correction of level `k + 1` in, and smooths.
    fn ascend(&mut self, k: usize) {
        self.each_colour(k, true, Shared::Vectors, |run, band, list| {
            let coarse = &run.memory.buffers[k + 1][run.memory.bands[k][band].above];
            let params = Params { sweeps: SWEEPS, other_base: coarse.base.unwrap_or(0), ..run.params };
            let own = [coarse.blocks.clone(), coarse.vectors.clone()];
            run.run_list(Kernel::Ascend, [k, band], &own, list, params);
        });
    }

    /// The V-cycle from the small level `top` down.
    fn cycle_small(&mut self, top: usize) {
        let Some(small) = &self.memory.small else { return };
        let count = small.levels.bases.len() as u32;
        let params = Params { mode: top as u32, count, sweeps: SWEEPS, ..self.params };
        let bytes = small.levels.bytes_moved(self.grid, small.levels.first + top);
        let own = [small.blocks.clone(), small.lists.clone()];
        // Any of these levels: their rows and vectors are the same buffers.
        let at = [small.levels.first, 0];
        let size = self.gated(0, params.items);
        self.dispatch(Kernel::Cycle, at, &own, &params, size, bytes);
    }

    /// The step's local share.
    fn cut(&mut self, level: usize) {
        self.each_active(Kernel::Parts, level, self.params, Some(Shared::Vectors));
        self.open_gate(GateSet::Cut, true);
        for mode in 0..FALLOFFS + ROUNDS {
            let part = match mode {
                ..FALLOFFS => 1.0,
                _ if mode < FALLOFFS + HALVINGS => 0.5,
                _ => 0.0,
            };
            let params = Params { mode, part, ..self.params };
            if mode >= FALLOFFS {
                self.each_active(Kernel::Mark, level, params, Some(Shared::Vectors));
            }
            self.each_active(Kernel::Shrink, level, params, Some(Shared::Vectors));
        }
    }
}
