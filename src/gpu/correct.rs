//! correct: one Gauss-Newton step for all nodes of a level at once (method §7); the twin of `cpu/correct.rs`.

pub(super) mod coarse_levels;
#[cfg(test)]
mod tests;

use super::kernels::Kernel;
use super::layout::{
    DECIDE_BEFORE, DECIDE_DIRECTION, DECIDE_FIRST_DIRECTION, DECIDE_LAST_TRIAL, DECIDE_STEP_LENGTH,
    DECIDE_TRIAL, GATE_LIMITED, Params, RELAX_FRACTION, SELECT_ALL, SELECT_FIRST_CORRECTION,
    SELECT_LATER_CORRECTION, SMOOTH_BACKWARDS, SMOOTH_FROM_ZERO, STEP_FIRST_TRIAL, STEP_LATER_TRIAL,
};
use super::{BandBuffer, GateSet, Run};
use crate::method::acceptance::Correction;
use crate::method::law::{
    CG_ITERATIONS, COARSEST_ROUNDS, FALLOFF_PASSES, FIRST_FALLOFF_PASSES, LIMIT_ROUNDS, SMOOTHER_SWEEPS,
    TRIAL_FRACTIONS, kept_margin,
};

impl Run<'_> {
    pub(super) fn correct_level(&mut self, level: usize, correction: &Correction) {
        self.select(if correction.first { SELECT_FIRST_CORRECTION } else { SELECT_LATER_CORRECTION });
        self.open_gate(GateSet::Correction, 0);
        let correction_gate = self.gate;
        self.energy(self.with_pull(level), level, DECIDE_BEFORE);
        self.assemble(level);
        // Further corrections use the coarser systems of the first one: these precondition well enough.
        if correction.first {
            for k in level + 1..self.grid.levels.len() {
                self.galerkin(k);
            }
        }
        self.conjugate_gradients(level);
        self.limit_step(level);
        self.gate = correction_gate;
        for (n, factor) in TRIAL_FRACTIONS.into_iter().chain([0.0]).enumerate() {
            let kernel = if level == 0 { Kernel::StepChords } else { Kernel::StepMetrics };
            let mode = if n == 0 { STEP_FIRST_TRIAL } else { STEP_LATER_TRIAL };
            let params = Params { factor, mode, ..self.at_level(level) };
            self.dispatch_active(kernel, level, params, Some(BandBuffer::State));
            self.relax_level(level, correction.sweeps, RELAX_FRACTION);
            // The last trial has a fraction of 0: it is relaxation alone.
            let last = n == TRIAL_FRACTIONS.len();
            let decision = if last { DECIDE_LAST_TRIAL } else { DECIDE_TRIAL };
            let Correction { tolerance, trusts_model, .. } = *correction;
            let trusts_model = u32::from(trusts_model);
            self.energy(Params { tolerance, trusts_model, ..self.with_pull(level) }, level, decision);
            if n == 0 {
                // Nearly always all charts accept the whole step.
                self.open_gate(GateSet::Trial, 0);
            }
        }
        self.gate = None;
        self.select(SELECT_ALL);
    }

    /// Assembles the system of a level from its state.
    pub(super) fn assemble(&mut self, level: usize) {
        let kernel = if level == 0 { Kernel::AssembleChords } else { Kernel::AssembleMetrics };
        let params = self.with_pull(level);
        self.dispatch_active(kernel, level, params, None);
        if params.pull > 0.0 {
            for band in 0..self.memory.bands[level].len() {
                let active = self.memory.lists[level][band].active;
                let extra = [self.anchor(level, band)];
                self.dispatch_list(Kernel::Pull, [level, band], &extra, active, params);
            }
        }
        self.exchange(level, BandBuffer::Rows);
    }

    /// Forms the system of level `k` from that of the next finer level (method §7.4).
    fn galerkin(&mut self, k: usize) {
        let together = self.memory.buffers[k - 1][0].base.is_some();
        for band in 0..self.memory.bands[k].len() {
            for (n, finer_band) in self.memory.bands[k][band].finer.clone().enumerate() {
                let fine = &self.memory.buffers[k - 1][finer_band];
                let params = Params { other_base: fine.base.unwrap_or(0), ..self.params };
                let extra = [fine.blocks.clone(), fine.rows.clone()];
                let (kernel, extra) = if together {
                    (Kernel::GalerkinTogether, &extra[..1])
                } else {
                    (Kernel::Galerkin, &extra[..])
                };
                let active = self.memory.lists[k][band].active_by_finer_band[n];
                self.dispatch_list(kernel, [k, band], extra, active, params);
            }
        }
        self.exchange(k, BandBuffer::Rows);
    }

    fn conjugate_gradients(&mut self, level: usize) {
        for mode in 0..CG_ITERATIONS {
            self.precondition(level);
            let decision = if mode == 0 { DECIDE_FIRST_DIRECTION } else { DECIDE_DIRECTION };
            self.reduce(Kernel::ResidualDot, level, self.params, decision);
            let params = Params { mode, ..self.params };
            if mode > 0 {
                self.dispatch_active(Kernel::Direction, level, params, Some(BandBuffer::Vectors));
            }
            self.reduce(Kernel::Curvature, level, self.params, DECIDE_STEP_LENGTH);
            let last = mode + 1 == CG_ITERATIONS;
            self.dispatch_active(Kernel::Advance, level, params, last.then_some(BandBuffer::Vectors));
        }
    }

    /// Dispatches a V-cycle: direction = M⁻¹ residual on `level` (method §7.4).
    fn precondition(&mut self, level: usize) {
        let coarsest = self.grid.levels.len() - 1;
        let first_coarse = self.memory.coarse.as_ref().map(|coarse| coarse.levels.first);
        let turn = first_coarse.unwrap_or(coarsest).max(level);
        for k in level..turn {
            self.smooth(k, SMOOTH_FROM_ZERO);
            self.restrict(k);
        }
        match first_coarse {
            Some(first) => self.coarse_cycle(turn - first),
            None => {
                for round in 0..COARSEST_ROUNDS {
                    self.smooth(coarsest, if round == 0 { SMOOTH_FROM_ZERO } else { 0 });
                }
                for _ in 0..COARSEST_ROUNDS {
                    self.smooth(coarsest, SMOOTH_BACKWARDS);
                }
            }
        }
        for k in (level..turn).rev() {
            self.multigrid_up(k);
        }
    }

    fn smooth(&mut self, k: usize, mode: u32) {
        let params = Params { mode, sweeps: SMOOTHER_SWEEPS, ..self.params };
        self.each_colour(k, mode == SMOOTH_BACKWARDS, BandBuffer::Vectors, |run, band, list| {
            run.dispatch_list(Kernel::SmoothDirection, [k, band], &[], list, params);
        });
    }

    /// Computes the right-hand side of level `k + 1` from the residual of level `k`.
    fn restrict(&mut self, k: usize) {
        for band in 0..self.memory.bands[k].len() {
            let coarse = &self.memory.buffers[k + 1][self.memory.bands[k][band].coarser];
            let params = Params { other_base: coarse.base.unwrap_or(0), ..self.params };
            let extra = [coarse.nodes.clone(), coarse.vectors.clone()];
            let active = self.memory.lists[k][band].active;
            self.dispatch_list(Kernel::Restrict, [k, band], &extra, active, params);
        }
    }

    /// Adds the interpolated direction of level `k + 1` to that of level `k`, and smooths it.
    fn multigrid_up(&mut self, k: usize) {
        self.each_colour(k, true, BandBuffer::Vectors, |run, band, list| {
            let coarse = &run.memory.buffers[k + 1][run.memory.bands[k][band].coarser];
            let params =
                Params { sweeps: SMOOTHER_SWEEPS, other_base: coarse.base.unwrap_or(0), ..run.params };
            let extra = [coarse.blocks.clone(), coarse.vectors.clone()];
            run.dispatch_list(Kernel::MultigridUp, [k, band], &extra, list, params);
        });
    }

    /// Dispatches the part of the V-cycle on the coarse levels, from the `top`-th of them on.
    fn coarse_cycle(&mut self, top: usize) {
        let Some(coarse) = &self.memory.coarse else { return };
        let count = coarse.levels.bases.len() as u32;
        let params = Params { mode: top as u32, count, sweeps: SMOOTHER_SWEEPS, ..self.params };
        let bytes = coarse.levels.bytes_moved(self.grid, coarse.levels.first + top);
        let extra = [coarse.blocks.clone(), coarse.lists.clone()];
        // Any of these levels will do: all have the same buffers of rows and vectors.
        let at = [coarse.levels.first, 0];
        let size = self.dispatch_size(0, params.items);
        self.dispatch(Kernel::MultigridCoarse, at, &extra, &params, size, bytes);
    }

    /// Computes the step fraction of each node (method §7.6).
    fn limit_step(&mut self, level: usize) {
        self.dispatch_active(Kernel::FirstFractions, level, self.params, Some(BandBuffer::Vectors));
        self.open_gate(GateSet::StepLimit, GATE_LIMITED);
        // A dispatch does `FALLOFF_PASSES` passes of the falloff; the first dispatches shrink no fractions.
        let falloffs = FIRST_FALLOFF_PASSES / FALLOFF_PASSES;
        for mode in 0..falloffs + LIMIT_ROUNDS {
            let kept = mode.checked_sub(falloffs).and_then(kept_margin);
            let params = Params { mode, factor: kept.unwrap_or(-1.0), ..self.params };
            if mode >= falloffs {
                self.dispatch_active(Kernel::MarkCorners, level, params, Some(BandBuffer::Vectors));
            }
            self.dispatch_active(Kernel::ShrinkFractions, level, params, Some(BandBuffer::Vectors));
        }
    }
}
