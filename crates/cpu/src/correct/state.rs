//! Reads the intermediate results of corrections (method §7), for comparing the two backends. A module of
//! `cpu::correct`, so that it can access private state.

use super::super::run::Run;
use super::super::state::flat;
use super::{assemble, complete};
use vrtm_core::allocation::Vec;

impl Run<'_> {
    /// Assembles a level's system for its present state. Returns its rows in the layout of [`Run::rows`], and its
    /// right-hand side.
    pub fn assembled(&mut self, level: usize) -> [Vec<u32>; 2] {
        let mut workspace = std::mem::take(&mut self.memory.workspace);
        let mut assembling = workspace.assembling(level, &mut []);
        let (rows, residual) = assembling.system();
        self.with_surface(level, assemble::Assemble { rows, residual, level });
        let mut samples = std::mem::take(&mut self.memory.levels);
        complete::complete(self, level, &mut assembling.solving(&mut samples[level..]).levels[0], false);
        self.memory.levels = samples;
        self.memory.workspace = workspace;
        [self.rows(level), flat(&self.memory.workspace.levels[level].planes_a)]
    }

    /// The matrix of a level's system. A block has 3 planes for the diagonal, and 2 of encoded pairs for each of the
    /// four owned edges.
    pub fn rows(&self, level: usize) -> Vec<u32> {
        let mut all = Vec::new();
        let rows = &self.memory.workspace.levels[level].rows;
        for (b, diagonal) in rows.diagonal.iter().enumerate() {
            all.extend(flat(&[*diagonal]));
            all.extend(rows.words_of(b).as_flattened().as_flattened());
        }
        all
    }

    /// The step of a level's last correction, before it was limited, and the step fraction of each node.
    pub fn step_of(&self, level: usize) -> [Vec<u32>; 2] {
        let workspace = &self.memory.workspace;
        let blocks = self.grid.levels[level].blocks.list.len();
        let step = if level == 0 { &*self.result } else { &workspace.levels[0].planes_a[..blocks] };
        let fraction = workspace.levels[level].planes_a.iter().flat_map(|planes| planes[0].map(f32::to_bits));
        [flat(step), fraction.collect()]
    }
}
