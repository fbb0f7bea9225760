//! correct: one Gauss-Newton step for all nodes of a level at once (method §7); the counterpart of `cpu/correct.rs`.

#[cfg(test)]
mod tests;

use super::kernels::Kernel;
use super::layout::{
    Chart, DECIDE_FIRST_STEP, DECIDE_LAST_TRIAL, DECIDE_SECOND_STEP, DECIDE_TRIAL, DOWN_FROM_RESIDUAL,
    DOWN_GATHER, Params, RELAX_FRACTION, SELECT_FIRST_CORRECTION, SELECT_LATER_CORRECTION, STEP_FIRST_TRIAL,
    STEP_LATER_TRIAL, UP_COARSE, UP_FIRST, UP_SECOND,
};
use super::lists::{GateSet, active_blocks};
use super::run::Run;
use vrtm_core::allocation::Vec;
use vrtm_core::error::Result;
use vrtm_core::grid::planes::NODES;
use vrtm_core::method::acceptance::Correction;
use vrtm_core::method::law::{COARSEST_SWEEPS, SMOOTHER_SWEEPS, limit_rounds, margin_left, trial_fractions};

/// The rounds of the step limit on level 0 that are preceded by a gate: one or two rounds are common, more are rare.
const LATER_GATES: [u32; 2] = [2, 6];

impl Run<'_> {
    pub(super) fn correct_level(&mut self, level: usize, correction: &Correction) {
        self.share = [1, 1];
        if correction.first {
            self.settled = false;
        } else if self.settled || !self.is_wanted() {
            self.settled = true;
            self.share = [1, 1];
            return;
        }
        self.params.in_correction = 1;
        self.select(if correction.first { SELECT_FIRST_CORRECTION } else { SELECT_LATER_CORRECTION });
        // Assembly computes the energy without a pull.
        let params = self.with_pull(level);
        if params.pull > 0.0 {
            self.energy_sums(params, level);
        }
        self.assemble(level);
        // Further corrections reuse the coarser systems of the first one, which precondition well enough.
        if correction.first {
            for k in level + 1..=self.grid.coarsest() {
                self.galerkin(k);
            }
        }
        self.params.has_last_step = u32::from(level == 0 && !correction.first);
        self.conjugate_gradients(level, correction.iterations);
        self.params.has_last_step = 0;
        self.limit_step(level);
        let trials = trial_fractions(level);
        for (n, &factor) in trials.iter().chain(&[0.0]).enumerate() {
            let kernel = if level == 0 { Kernel::StepChords } else { Kernel::StepMetrics };
            let mode = if n == 0 { STEP_FIRST_TRIAL } else { STEP_LATER_TRIAL };
            let params = Params { factor, mode, ..self.at_level(level) };
            self.dispatch_active(kernel, level, &[], params);
            // The last trial takes no step; sweeps alone might raise a chart's energy.
            let last = n == trials.len();
            if !last {
                self.relax_level(level, correction.sweeps, RELAX_FRACTION);
            }
            let decision = if last { DECIDE_LAST_TRIAL } else { DECIDE_TRIAL };
            let Correction { tolerance, trusts_model, .. } = *correction;
            let trusts_model = u32::from(trusts_model);
            self.energy(Params { tolerance, trusts_model, ..self.with_pull(level) }, level, decision);
            if n == 0 {
                // Nearly always, all charts accept the whole step.
                self.open_gate(GateSet::Trial, 0);
            }
        }
        self.gate = None;
        self.params.in_correction = 0;
        self.share = [1, 1];
        self.energy_is_known = level > 0 || self.pull == 0.0;
    }

    /// True if a chart takes part in a further correction of the level, from the records of the charts after
    /// the work so far. Reading them takes one wait but saves about seventy dispatches, which would turn out
    /// empty for charts with room.
    fn is_wanted(&mut self) -> bool {
        if self.error.is_some() {
            return false;
        }
        match self.waited_records() {
            Ok(records) => {
                let wanted = |chart: &Chart| chart.solved == 1 && chart.finished == 0;
                let wants: Vec<bool> = records.iter().map(wanted).collect();
                let blocks = |charts: &[bool]| active_blocks(&self.grid.levels[0], charts).count() as u64;
                self.share = [blocks(&wants), blocks(self.charts)];
                wants.contains(&true)
            }
            Err(error) => {
                self.error = Some(error);
                false
            }
        }
    }

    /// Submits the recorded commands, waits for them unless the call is cancelled, and reads the records of the charts.
    fn waited_records(&mut self) -> Result<Vec<Chart>> {
        let (charts, bytes) = (self.memory.charts.clone(), self.charts.len() * size_of::<Chart>());
        let readback = self.recorder.read(&[(&charts, 0..bytes as u64)], false)?;
        if let Some(control) = &self.control {
            self.context.wait_for(control)?;
        }
        let parts = self.context.taken(&readback)?;
        let records = parts.iter().flat_map(|part| part.chunks_exact(size_of::<Chart>()));
        Ok(records.map(bytemuck::pod_read_unaligned).collect())
    }

    /// Assembles the system of a level from its state.
    pub(super) fn assemble(&mut self, level: usize) {
        let kernel = if level == 0 { Kernel::AssembleChords } else { Kernel::AssembleMetrics };
        let params = self.with_pull(level);
        self.dispatch_active(kernel, level, &[], params);
        if params.pull > 0.0 {
            self.dispatch_active(Kernel::Pull, level, &[self.anchor(level)], params);
        }
    }

    /// Forms the system of level `k` from that of the next finer level (method §7.4).
    fn galerkin(&mut self, k: usize) {
        let fine = &self.memory.levels[k - 1];
        let extra = [fine.blocks.clone(), fine.rows.clone()];
        self.dispatch_active(Kernel::Galerkin, k, &extra, self.params);
    }

    /// Solves a level's system for the step, a combination of two preconditioned residuals and perhaps the last step
    /// (method §7.3). Its factors, the predicted gain and the energy before the step are stored in the records of the
    /// charts.
    fn conjugate_gradients(&mut self, level: usize, iterations: u32) {
        let params = self.with_pull(level);
        self.multigrid_down(level, DOWN_FROM_RESIDUAL);
        self.coarse_cycle(level);
        self.multigrid_up(level, UP_FIRST, params.pull);
        self.dispatch_to_coarser(Kernel::Product, level, None, self.params);
        self.decide(level, self.params, DECIDE_FIRST_STEP);
        if iterations == 1 {
            return;
        }
        self.coarse_cycle(level);
        self.multigrid_up(level, UP_SECOND, params.pull);
        self.reduce(Kernel::Curvature, level, self.params, DECIDE_SECOND_STEP);
    }

    /// The part of a V-cycle on the levels coarser than `level` (method §7.4).
    fn coarse_cycle(&mut self, level: usize) {
        let coarsest = self.grid.coarsest();
        for k in level + 1..coarsest {
            self.multigrid_down(k, DOWN_GATHER);
        }
        if level < coarsest {
            let first = self.memory.lists[coarsest].active.first;
            let params = Params { first, level: coarsest as u32, sweeps: COARSEST_SWEEPS, ..self.params };
            let extra = [self.memory.levels[coarsest].contributions.clone(), self.memory.ranges.clone()];
            let size = self.dispatch_size(0, params.items);
            let nodes = self.memory.active_blocks[coarsest] * NODES as u64;
            let bytes = nodes * u64::from(Kernel::MultigridCoarsest.source().bytes_per_node);
            self.dispatch(Kernel::MultigridCoarsest, coarsest, &extra, &params, size, bytes);
        }
        for k in (level + 1..coarsest).rev() {
            self.multigrid_up(k, UP_COARSE, 0.0);
        }
    }

    /// Sweeps of the smoother in a pass over level `k`.
    fn smoother_sweeps(&self, k: usize) -> u32 {
        if k == self.grid.coarsest() { COARSEST_SWEEPS } else { SMOOTHER_SWEEPS }
    }

    /// Smooths level `k` from 0, and forms its contributions to the coarser level.
    fn multigrid_down(&mut self, k: usize, mode: u32) {
        let contributed = self.memory.levels[k].contributions.clone();
        self.dispatch_to_coarser(Kernel::MultigridDown, k, Some(contributed), Params { mode, ..self.params });
    }

    /// Dispatches a kernel whose blocks contribute to the right-hand side of the next coarser level.
    fn dispatch_to_coarser(
        &mut self,
        kernel: Kernel,
        k: usize,
        contributed: Option<wgpu::Buffer>,
        params: Params,
    ) {
        let own = &self.memory.levels[k].contributions;
        // The coarsest level has no coarser level to contribute to.
        let has_coarser = u32::from(k < self.grid.coarsest());
        let leaving = match self.memory.levels.get(k + 1) {
            Some(coarser) => coarser.contributions.clone(),
            // Not the placeholder of `contributed`: a buffer that is written has no other binding.
            None => self.memory.gate_open.clone(),
        };
        let extra = [contributed.unwrap_or_else(|| own.clone()), leaving];
        let params = Params { has_coarser, sweeps: self.smoother_sweeps(k), ..params };
        self.dispatch_active(kernel, k, &extra, params);
    }

    /// Adds the interpolated direction of level `k + 1` to that of level `k`, and smooths it.
    fn multigrid_up(&mut self, k: usize, mode: u32, pull: f32) {
        let vectors = match self.memory.levels.get(k + 1) {
            Some(coarser) => coarser.vectors.clone(),
            None => self.memory.no_contributions.clone(),
        };
        let has_coarser = u32::from(k < self.grid.coarsest());
        let params = Params { mode, sweeps: self.smoother_sweeps(k), has_coarser, pull, ..self.params };
        self.dispatch_active(Kernel::MultigridUp, k, &[vectors], params);
    }

    /// Computes the step fraction of each node (method §7.6).
    fn limit_step(&mut self, level: usize) {
        self.dispatch_active(Kernel::FirstFractions, level, &[], self.params);
        self.open_gate(GateSet::StepLimit, 1);
        self.fall_off(level, 0);
        for round in 0..limit_rounds(level) {
            if level == 0 && LATER_GATES.contains(&round) {
                self.open_gate(GateSet::StepLimit, round + 1);
            }
            let params =
                Params { mode: round + 1, factor: margin_left(round).unwrap_or(-1.0), ..self.params };
            self.dispatch_active(Kernel::Shrink, level, &[], params);
            self.fall_off(level, round + 1);
        }
        self.gate = None;
    }

    /// Lets the fractions fall off after `rounds` rounds: along the rows of nodes, then along the columns.
    fn fall_off(&mut self, level: usize, rounds: u32) {
        for mode in [2 * rounds, 2 * rounds + 1] {
            self.dispatch_active(Kernel::Falloff, level, &[], Params { mode, ..self.params });
        }
    }
}
