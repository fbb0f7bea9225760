//! A correction's inside, read from outside; see `cpu/inspect.rs`.

use super::super::inspect::flat;
use super::*;
use crate::tile::codes::of_weight;

impl Run<'_> {
    /// Assembles a level's system for its present state. Gives its rows, as [`Run::rows`], and right-hand side.
    pub fn assembled(&mut self, level: usize) -> [Vec<u32>; 2] {
        let mut systems = std::mem::take(&mut self.memory.systems);
        self.with_surface(level, assemble::Assemble { system: &mut systems.levels[level], level });
        rows::finish(self, level, &mut systems.levels[level], false);
        self.memory.systems = systems;
        [self.rows(level), flat(&self.memory.systems.levels[level].r)]
    }

    /// A level's system, per block: the diagonal (3), then the pairs of its nodes' owned edges (two words each),
    /// interpolation's weights (1; none on the coarsest level).
    pub fn rows(&self, level: usize) -> Vec<u32> {
        let mut all = Vec::new();
        let Rows { diagonal, words, .. } = &self.memory.systems.levels[level].rows;
        for (b, (diagonal, words)) in diagonal.iter().zip(words).enumerate() {
            all.extend(flat(&[*diagonal]));
            all.extend_from_slice(words.as_flattened().as_flattened());
            let weights = self.grid.levels[level].interpolation.get(b).unwrap_or(&[0; NODES]);
            all.extend(weights.map(|code| of_weight(code).to_bits()));
        }
        all
    }

    /// The last step on a level, before it was cut, and its local share.
    pub fn step_of(&self, level: usize) -> [Vec<u32>; 2] {
        let systems = &self.memory.systems;
        let n = self.grid.levels[level].blocks.list.len();
        let x = if level == 0 { &*self.result } else { &systems.x[..n] };
        [flat(x), systems.levels[level].r.iter().flat_map(|r| r[0]).map(f32::to_bits).collect()]
    }

    /// Per chart, the share of the next step that it is to take; 0: it sits out the level's further corrections.
    pub fn next(&self) -> &[f32] {
        &self.memory.systems.next
    }

    pub fn set_next(&mut self, next: &[f32]) {
        self.memory.systems.next.copy_from_slice(next);
    }
}
