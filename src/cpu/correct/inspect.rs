//! A correction's inside, read from outside; see `cpu/inspect.rs`.

use super::super::inspect::flat;
use super::*;
use crate::tile::codes::of_weight;

impl Run<'_> {
    /// Assembles a level's system for its present state. Gives its rows, as [`Run::rows`], and right-hand side.
    pub fn assembled(&mut self, level: usize) -> [Vec<u32>; 2] {
        let mut workspace = std::mem::take(&mut self.memory.workspace);
        let mut assembling = workspace.assembling(level, &mut []);
        let (rows, residual) = assembling.system();
        self.with_surface(level, assemble::Assemble { rows, residual, level });
        let mut samples = std::mem::take(&mut self.memory.levels);
        rows::finish(self, level, &mut assembling.solving(&mut samples[level..]).levels[0], false);
        self.memory.levels = samples;
        self.memory.workspace = workspace;
        [self.rows(level), flat(self.memory.workspace.residual(level))]
    }

    /// A level's system, per block: the diagonal (3), then the pairs of its nodes' owned edges (two words each),
    /// interpolation's weights (1; none on the coarsest level).
    pub fn rows(&self, level: usize) -> Vec<u32> {
        let mut all = Vec::new();
        let Rows { diagonal, words, .. } = self.memory.workspace.rows(level);
        for (b, (diagonal, words)) in diagonal.iter().zip(words).enumerate() {
            all.extend(flat(&[*diagonal]));
            all.extend_from_slice(words.as_flattened().as_flattened());
            let weights = self.grid.levels[level].interpolation.get(b).unwrap_or(&[0; NODES]);
            all.extend(weights.map(|code| of_weight(code).to_bits()));
        }
        all
    }

    /// The last step on a level, before it was limited, and the step fraction of each node.
    pub fn step_of(&self, level: usize) -> [Vec<u32>; 2] {
        let workspace = &self.memory.workspace;
        let blocks = self.grid.levels[level].blocks.list.len();
        let step = if level == 0 { &*self.result } else { &workspace.coarse_step()[..blocks] };
        let fraction = (0..blocks).flat_map(|b| workspace.step_fraction(level, b).map(f32::to_bits));
        [flat(step), fraction.collect()]
    }
}
