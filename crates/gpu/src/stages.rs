//! The stages that the schedule calls (method §5). Each records its dispatches.

use super::dispatch::BandBuffer;
use super::kernels::Kernel;
use super::layout::{
    DECIDE_ALLOWING_FOLDS, DECIDE_CERTIFICATE, DECIDE_ENERGY, DECIDE_IDENTITY, ENERGY_ALLOWING_FOLDS,
    ENERGY_VALID, Params, RELAX_WHOLE, THREADS,
};
use super::recorder::DispatchSize;
use super::run::Run;
use vrtm_core::allocation::Vec;
use vrtm_core::method::law::passes;
use vrtm_core::method::stage::{Stage, Stages, Start};

#[cfg(test)]
mod tests;

impl Stages for Run<'_> {
    fn run(&mut self, stage: &Stage) {
        self.recorder.stage(stage.kind() as usize);
        match *stage {
            Stage::Surface => self.surface(),
            Stage::Pyramid { coarsest } => {
                let levels = self.grid.levels.len().min(coarsest + 1);
                self.pyramid(levels);
                self.protect(levels);
            }
            Stage::Start { level, from } => match from {
                Start::Identity => self.identity(level),
                Start::Previous => self.previous(),
                Start::Passing => self.interpolate(level),
                Start::Coarser => self.prolong(level),
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
            [0, 0],
            &extra,
            &params,
            DispatchSize::ungated(items.div_ceil(THREADS)),
            u64::from(items) * 100,
        );
    }

    fn pyramid(&mut self, levels: usize) {
        for k in 1..levels {
            for band in 0..self.memory.bands[k].len() {
                let to = self.memory.buffers[k][band].metric.clone();
                if let Some([starts, entries]) = self.memory.buffers[k][band].gather.clone() {
                    let extra: Vec<_> = [starts, entries].into_iter().chain(to).collect();
                    let stored = self.memory.lists[k][band].stored;
                    self.dispatch_list(Kernel::PyramidGather, [k, band], &extra, stored, self.params);
                    continue;
                }
                for (n, finer_band) in self.memory.bands[k][band].finer.clone().enumerate() {
                    let fine = &self.memory.buffers[k - 1][finer_band];
                    let extra: Vec<_> = [fine.blocks.clone(), fine.nodes.clone()]
                        .into_iter()
                        .chain(fine.metric.clone())
                        .collect();
                    let stored = self.memory.lists[k][band].stored_by_finer_band[n];
                    self.dispatch_list(Kernel::PyramidRestrict, [k, band], &extra, stored, self.params);
                }
            }
            self.exchange(k, BandBuffer::Metric);
        }
    }

    /// Computes what rigid material loses of its weight in this pose, if anything is protected.
    fn protect(&mut self, levels: usize) {
        if self.params.lost == 0.0 {
            return;
        }
        for level in (0..levels).rev() {
            for band in 0..self.memory.bands[level].len() {
                let stored = self.memory.lists[level][band].stored;
                let nodes = self.memory.buffers[level][band].nodes.clone();
                let params = Params { factor: self.most_lost, ..self.at_level(level) };
                if level > 0 {
                    self.dispatch_list(Kernel::Protect, [level, band], &[nodes], stored, params);
                } else if let Some(coarser) = self.memory.buffers.get(1) {
                    let coarse = &coarser[self.memory.bands[0][band].coarser];
                    let extra = [nodes, coarse.blocks.clone(), coarse.nodes.clone()];
                    self.dispatch_list(Kernel::ProtectFinest, [0, band], &extra, stored, params);
                }
            }
            self.exchange(level, BandBuffer::Nodes);
        }
    }

    fn identity(&mut self, level: usize) {
        self.energy_is_known = false;
        let kernel = if level == 0 { Kernel::IdentityChords } else { Kernel::IdentityMetrics };
        for band in 0..self.memory.bands[level].len() {
            let active = self.memory.lists[level][band].active;
            self.dispatch_list(kernel, [level, band], &[], active, self.at_level(level));
        }
        self.exchange(level, BandBuffer::State);
        if level == 0 {
            self.energy_of_identity(0);
        }
    }

    fn previous(&mut self) {
        let Some(last) = self.last_result.clone() else { return self.identity(0) };
        self.energy_of_identity(0);
        self.energy_is_known = false;
        for band in 0..self.memory.bands[0].len() {
            let extra = [last.bands[band].1.clone()];
            let active = self.memory.lists[0][band].active;
            self.dispatch_list(Kernel::Previous, [0, band], &extra, active, self.at_level(0));
        }
        self.exchange(0, BandBuffer::State);
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
        for band in 0..self.memory.bands[level].len() {
            let coarse = &self.memory.buffers[level + 1][self.memory.bands[level][band].coarser];
            let extra: Vec<_> = [coarse.blocks.clone()].into_iter().chain(coarse.state.clone()).collect();
            let active = self.memory.lists[level][band].active;
            self.dispatch_list(kernel, [level, band], &extra, active, self.at_level(level));
        }
        self.exchange(level, BandBuffer::State);
    }

    fn certify(&mut self, allow_folds: bool) {
        // Those of a coarser level are known if work has ended there.
        self.complete_energies(0, allow_folds);
        let certificate = if allow_folds { DECIDE_ALLOWING_FOLDS } else { DECIDE_CERTIFICATE };
        self.reduce(Kernel::Certify, 0, self.at_level(0), certificate);
        self.dispatch_active(Kernel::FallBack, 0, self.params, Some(BandBuffer::State));
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
            self.each_colour(level, false, BandBuffer::State, |run, band, list| {
                let extra = [run.anchor(level, band)];
                run.dispatch_list(kernel, [level, band], &extra, list, params);
            });
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
        self.sums(kernel, level, params);
    }
}
