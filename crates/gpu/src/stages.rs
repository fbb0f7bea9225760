//! The stages that the schedule calls (method §5). Each records its dispatches.

use super::kernels::Kernel;
use super::layout::{
    DECIDE_ALLOWING_FOLDS, DECIDE_CERTIFICATE, DECIDE_ENERGY, DECIDE_IDENTITY, ENERGY_ALLOWING_FOLDS,
    ENERGY_VALID, Params, RELAX_WHOLE, THREADS,
};
use super::recorder::DispatchSize;
use super::run::Run;
use vrtm_core::allocation::Vec;
use vrtm_core::grid::features::LEVELS;
use vrtm_core::method::law::{WARM_MULTIPLIER, harm_on, passes};
use vrtm_core::method::stage::{Stage, Stages, Start};

#[cfg(test)]
mod tests;

impl Stages for Run<'_> {
    fn run(&mut self, stage: &Stage) {
        self.recorder.stage(stage.time());
        match *stage {
            Stage::Surface => self.surface(),
            Stage::Pyramid { coarsest } => self.pyramid(self.grid.levels.len().min(coarsest + 1)),
            Stage::Start { level, from } => match from {
                Start::Identity => self.identity(level),
                Start::Previous => {
                    self.previous();
                    self.weigh(level, WARM_MULTIPLIER);
                }
                Start::Passing => self.interpolate(level),
                Start::Coarser => {
                    self.prolong(level);
                    self.weigh(level, 1.0);
                }
                Start::Smoothed(smoothing) => {
                    self.prolong(level);
                    self.regularise_level(level, smoothing);
                }
            },
            Stage::Relax { level, sweeps } => {
                self.energy_is_known = false;
                self.relax_level(level, sweeps, RELAX_WHOLE);
            }
            Stage::Correct { level, ref correction } => self.correct_level(level, correction),
            Stage::Iterate { level, ref iteration } => self.iterate_level(level, iteration),
            Stage::Energies { level, allow_folds } => {
                self.energy_of_identity(level);
                self.complete_energies(level, allow_folds);
            }
            Stage::Certify { allow_folds } => self.certify(allow_folds),
        }
    }

    fn wait(&mut self) {
        self.recorder.flush();
        if let Err(error) = self.context.wait() {
            self.error.get_or_insert(error);
        }
    }
}

impl Run<'_> {
    fn surface(&mut self) {
        let items = self.grid.triangles.len() as u32;
        let params = Params { items, ..self.params };
        let extra = [self.memory.corners.clone(), self.memory.positions.clone()];
        self.dispatch(
            Kernel::Surface,
            0,
            &extra,
            &params,
            DispatchSize::ungated(items.div_ceil(THREADS)),
            u64::from(items) * 100,
        );
    }

    fn pyramid(&mut self, levels: usize) {
        for k in 1..levels {
            let [fine, own] = [&self.memory.levels[k - 1], &self.memory.levels[k]];
            let (kernel, read) = match &own.gather {
                Some(gather) => (Kernel::PyramidGather, gather.clone()),
                None => (Kernel::PyramidRestrict, [fine.blocks.clone(), fine.nodes.clone()]),
            };
            let metric = if own.gather.is_some() { &own.metric } else { &fine.metric };
            let extra: Vec<_> = read.into_iter().chain(metric.clone()).collect();
            self.dispatch_stored(kernel, k, &extra, self.params);
        }
    }

    /// Raises the multipliers of the features that are worse on a level than without a warp, and weighs the level with
    /// them. `kept` is the part of the multipliers that remains.
    fn weigh(&mut self, level: usize, kept: f32) {
        let features = &self.grid.features;
        if self.harm == 0.0 || level >= LEVELS || features.count == 0 {
            return;
        }
        let Some(of_level) = &self.memory.features.levels.get(level) else { return };
        let [of_level, squares] = [&of_level[0], &of_level[1]].map(wgpu::Buffer::clone);
        let multipliers = self.memory.features.multipliers.clone();
        let kernel = if level == 0 { Kernel::SquaresChords } else { Kernel::SquaresMetrics };
        for is_state in 0..2 {
            let params = Params { is_identity: 1 - is_state, mode: is_state, ..self.at_level(level) };
            self.dispatch_stored(kernel, level, &[of_level.clone(), squares.clone()], params);
        }
        let params = Params {
            factor: harm_on(self.harm, level),
            kept: if self.has_multipliers { kept } else { 0.0 },
            ..self.at_level(level)
        };
        let extra = [of_level.clone(), squares, multipliers.clone()];
        let size = DispatchSize::ungated(features.count as u32);
        self.dispatch(Kernel::Multiply, 0, &extra, &params, size, 0);
        let nodes = self.memory.levels[level].nodes.clone();
        self.dispatch_stored(Kernel::Weigh, level, &[of_level, nodes, multipliers], params);
        self.weighed[level] = true;
        self.has_multipliers = true;
    }

    fn identity(&mut self, level: usize) {
        self.energy_is_known = false;
        let kernel = if level == 0 { Kernel::IdentityChords } else { Kernel::IdentityMetrics };
        self.dispatch_active(kernel, level, &[], self.at_level(level));
        if level == 0 {
            self.energy_of_identity(0);
        }
    }

    fn previous(&mut self) {
        let Some(last) = self.last_result.clone() else { return self.identity(0) };
        self.energy_of_identity(0);
        self.energy_is_known = false;
        self.dispatch_active(Kernel::Previous, 0, std::slice::from_ref(&last.state), self.at_level(0));
    }

    fn prolong(&mut self, level: usize) {
        if level == 0 {
            self.energy_of_identity(0);
        }
        self.energy_is_known = false;
        self.interpolate(level);
    }

    /// Interpolates the displacements of the next coarser level, and resamples.
    fn interpolate(&mut self, level: usize) {
        let kernel = if level == 0 { Kernel::ProlongChords } else { Kernel::ProlongMetrics };
        let coarse = &self.memory.levels[level + 1];
        let extra: Vec<_> = [coarse.blocks.clone()].into_iter().chain(coarse.state.clone()).collect();
        self.dispatch_active(kernel, level, &extra, self.at_level(level));
    }

    fn certify(&mut self, allow_folds: bool) {
        // Those of a coarser level are known if work has ended there.
        self.complete_energies(0, allow_folds);
        if self.weighed[0] && !allow_folds {
            self.energy_of_identity(0);
        }
        let certificate = if allow_folds { DECIDE_ALLOWING_FOLDS } else { DECIDE_CERTIFICATE };
        self.reduce(Kernel::Certify, 0, self.at_level(0), certificate);
        self.dispatch_active(Kernel::FallBack, 0, &[], self.params);
    }

    /// Computes the energies of a level's present state, unless they are known.
    fn complete_energies(&mut self, level: usize, allow_folds: bool) {
        if !self.energy_is_known {
            let mode = if allow_folds { ENERGY_ALLOWING_FOLDS } else { ENERGY_VALID };
            self.energy(Params { mode, ..self.at_level(level) }, level, DECIDE_ENERGY);
            self.energy_is_known = true;
        }
    }

    /// Relaxes a level with `sweeps` sweeps. With `RELAX_FRACTION`, each node's step is multiplied by the chart's step
    /// fraction of the present correction.
    pub(super) fn relax_level(&mut self, level: usize, sweeps: u32, mode: u32) {
        let nodes: u64 =
            self.charts.iter().zip(&self.grid.movable).filter(|(solve, _)| **solve).map(|(_, n)| n).sum();
        // Each coarser level is taken to have a quarter of the nodes of the next finer one.
        self.node_updates += (nodes >> (2 * level)) * u64::from(sweeps);
        let kernel = match (level, self.memory.is_wide[level]) {
            (0, true) => Kernel::RelaxChordsWide,
            (0, false) => Kernel::RelaxChords,
            (_, true) => Kernel::RelaxMetricsWide,
            (_, false) => Kernel::RelaxMetrics,
        };
        for sweeps in passes(sweeps) {
            let params = Params { sweeps, mode, ..self.with_pull(level) };
            for list in self.memory.lists[level].colours {
                self.dispatch_list(kernel, level, &[self.anchor(level)], list, params);
            }
        }
    }

    /// Computes the identity's energy on a level, for which no state needs to be written.
    fn energy_of_identity(&mut self, level: usize) {
        self.energy(Params { is_identity: 1, ..self.at_level(level) }, level, DECIDE_IDENTITY);
    }

    /// Computes a level's energy chart by chart, and makes the decision `decision`. With the parameters of `with_pull`
    /// it is the energy that corrections lower, with those of `at_level` the energy of the state alone.
    pub(super) fn energy(&mut self, params: Params, level: usize, decision: u32) {
        self.energy_sums(params, level);
        self.decide(level, params, decision);
    }

    /// The part of `energy` that is computed block by block.
    pub(super) fn energy_sums(&mut self, params: Params, level: usize) {
        let kernel = if level == 0 { Kernel::EnergyChords } else { Kernel::EnergyMetrics };
        self.dispatch_active(kernel, level, &[self.anchor(level)], params);
    }
}
