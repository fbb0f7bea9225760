//! The stages, as the schedule calls them.

use std::sync::atomic::Ordering;

use crate::pbd::Iteration;
use crate::solve::{ChartResult, Correction, Stages};
use crate::tile::blocks::NODES;
use crate::tile::metric;

use super::certify::{self, Certificate};
use super::record::Record;
use super::refresh::Start;
use super::relax::Relax;
use super::team::Shared;
use super::{Run, prolong};

impl Stages for Run<'_> {
    fn levels(&self) -> usize {
        self.grid.levels.len()
    }

    fn surface(&mut self) {
        let triangle = self.grid.pose_triangles(self.mesh, self.pose);
        let (triangles, metrics) =
            (Shared::new(&mut self.memory.triangles), Shared::new(&mut self.memory.metrics));
        const CHUNK: usize = 256;
        let count = self.grid.triangles.len();
        self.team.run(count.div_ceil(CHUNK), |k| {
            for t in k * CHUNK..((k + 1) * CHUNK).min(count) {
                if self.charts[self.grid.chart_of[t] as usize] {
                    let pose = triangle(t);
                    // SAFETY: each item has its own triangles.
                    unsafe {
                        *metrics.get_mut(t) = pose.metric();
                        *triangles.get_mut(t) = Record::new(&self.grid.triangles[t], &pose);
                    }
                }
            }
        });
    }

    fn pyramid(&mut self) {
        for k in 1..self.grid.levels.len() {
            let (finer, coarser) = self.memory.levels.split_at_mut(k);
            let (finer, buffers) = (&finer[k - 1], &mut coarser[0]);
            let metric = Shared::new(&mut buffers.metric);
            let (grid, metrics) = (self.grid, &self.memory.metrics);
            let blocks = &self.work[k].stored;
            self.team.run(blocks.len(), |n| {
                let b = blocks[n] as usize;
                // SAFETY: each item has its own block.
                let out = unsafe { metric.get_mut(b) };
                match k {
                    1 => grid.gather.block(b, metrics, out),
                    _ => {
                        metric::restrict_block(&grid.levels[k], &grid.levels[k - 1], &finer.metric, b, out);
                    }
                }
            });
        }
    }

    fn identity(&mut self, level: usize) {
        let u = Shared::new(&mut self.memory.levels[level].u);
        let blocks = &self.work[level].stored;
        self.team.run(blocks.len(), |k| {
            // SAFETY: each item has its own block.
            unsafe { *u.get_mut(blocks[k] as usize) = [[0.0; NODES]; 2] };
        });
        let stored = std::mem::take(&mut self.work[level].stored);
        self.refresh(level, &stored, Start::Identity);
        self.work[level].stored = stored;
        if level == 0 {
            self.energy_before();
        }
    }

    fn previous(&mut self) {
        self.identity(0);
        for &b in &self.work[0].active {
            self.memory.levels[0].u[b as usize] = self.result[b as usize];
        }
        let active = std::mem::take(&mut self.work[0].active);
        self.refresh(0, &active, Start::Nearest);
        self.work[0].active = active;
    }

    fn prolong(&mut self, level: usize) {
        if level == 0 {
            // For the energy of the identity.
            self.identity(level);
        } else {
            self.rest_still_blocks(level);
        }
        let (finer, coarser) = self.memory.levels.split_at_mut(level + 1);
        let coarse = &coarser[0].u;
        let u = Shared::new(&mut finer[level].u);
        let (fine_level, coarse_level) = (&self.grid.levels[level], &self.grid.levels[level + 1]);
        let blocks = &self.work[level].active;
        self.team.run(blocks.len(), |k| {
            let b = blocks[k] as usize;
            // SAFETY: each item has its own block.
            let out = unsafe { u.get_mut(b) };
            prolong::block(fine_level, coarse_level, |b, c| &coarse[b][c], b, out);
        });
        let active = std::mem::take(&mut self.work[level].active);
        self.refresh(level, &active, Start::Nearest);
        self.work[level].active = active;
    }

    fn relax(&mut self, level: usize, sweeps: u32) {
        self.known.fill(None);
        self.relax_level(level, sweeps, None);
    }

    fn correct(&mut self, level: usize, correction: &Correction) {
        self.correct_level(level, correction);
    }

    fn iterate(&mut self, level: usize, iteration: &Iteration) {
        self.iterate_level(level, iteration);
    }

    fn smooth(&mut self, level: usize, smoothing: f32) {
        self.smooth_level(level, smoothing);
    }

    fn certify(&mut self, as_is: bool) {
        let all_known = (0..self.charts.len()).all(|c| !self.charts[c] || self.known[c].is_some());
        let energies = match (as_is, all_known) {
            (true, _) => self.energies_as_is(0),
            (false, true) => self.known.iter().map(|energy| energy.unwrap_or_default()).collect(),
            (false, false) => self.energies(0),
        };
        let certificates = self.certificates();
        for c in 0..self.charts.len() {
            if !self.charts[c] {
                continue;
            }
            let certificate = &certificates[c];
            let outcome = &mut self.outcome[c];
            outcome.energy = energies[c];
            outcome.min_jacobian = certificate.min_jacobian;
            outcome.folds = certificate.folds;
            outcome.max_displacement = certificate.max_displacement;
            // A comparison with NaN is false: then too, the identity.
            let better = outcome.energy.is_finite()
                && (as_is || (outcome.energy <= outcome.energy_before && certificate.folds == 0));
            if !better {
                *outcome = ChartResult {
                    energy: outcome.energy_before,
                    min_jacobian: 1.0,
                    folds: 0,
                    max_displacement: 0.0,
                    fallback: true,
                    ..*outcome
                };
            }
            for b in self.grid.levels[0].blocks.of_chart[c].clone() {
                self.result[b] = if better { self.memory.levels[0].u[b] } else { [[0.0; NODES]; 2] };
            }
        }
    }
}

impl Run<'_> {
    /// Sets the blocks of a level that no stage visits to the identity.
    fn rest_still_blocks(&mut self, level: usize) {
        let list = &self.grid.levels[level].blocks.list;
        let still: Vec<u32> =
            self.work[level].stored.iter().copied().filter(|&b| !list[b as usize].active).collect();
        for &b in &still {
            self.memory.levels[level].u[b as usize] = [[0.0; NODES]; 2];
        }
        self.refresh(level, &still, Start::Identity);
    }

    /// Per chart, what its corners say.
    fn certificates(&self) -> Vec<Certificate> {
        let blocks = &self.work[0].active;
        let level = &self.grid.levels[0];
        let u = &self.memory.levels[0].u;
        let mut parts = vec![Certificate::default(); blocks.len()];
        let shared = Shared::new(&mut parts);
        self.team.run(blocks.len(), |k| {
            // SAFETY: each item has its own certificate.
            unsafe { *shared.get_mut(k) = certify::block(level, u, blocks[k] as usize) };
        });
        let mut certificates = vec![Certificate::default(); self.charts.len()];
        for (part, &b) in parts.iter().zip(blocks) {
            certificates[level.blocks.list[b as usize].chart as usize].add(part);
        }
        certificates
    }

    /// Sweeps of which each chart's nodes take a share: all of each step without any.
    pub(super) fn relax_level(&mut self, level: usize, sweeps: u32, share: Option<&[f32]>) {
        let grid = &self.grid.levels[level];
        let movable = |b: &u32| grid.movable[*b as usize].iter().map(|&m| u64::from(m)).sum::<u64>();
        let nodes: u64 = self.work[level].active.iter().map(movable).sum();
        self.node_updates.fetch_add(nodes * u64::from(sweeps), Ordering::Relaxed);
        self.with_surface(level, Relax { level, sweeps, share });
    }

    fn energy_before(&mut self) {
        let energies = self.energies(0);
        for (outcome, energy) in self.outcome.iter_mut().zip(energies) {
            outcome.energy_before = energy;
        }
    }
}
