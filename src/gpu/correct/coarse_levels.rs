//! The coarse end of the V-cycle: levels whose charts have so few blocks that all of them are done in one dispatch.

use crate::gpu::bands::Band;
use crate::gpu::layout::CoarseBlock;
use crate::mesh::NONE;
use crate::tile::Grid;
use crate::tile::blocks::NODES;

/// Most active blocks of a chart on such a level: a chart of 64 x 64 nodes has 25.
const MOST_BLOCKS: usize = 36;
/// Which levels they are, and where their blocks stand in common buffers.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct CoarseLevels {
    /// The finest of them; all coarser ones belong to them too.
    pub first: usize,
    /// Per such level, its first block.
    pub bases: Vec<u32>,
    /// Blocks in all.
    pub blocks: usize,
}

impl CoarseLevels {
    /// Finds them; none if not even the coarsest level's blocks fit, or if there is one level only.
    pub fn new(grid: &Grid, bands: &[Vec<Band>], capacity: usize) -> Option<CoarseLevels> {
        let mut coarse = CoarseLevels { first: grid.levels.len(), bases: Vec::new(), blocks: 0 };
        for k in (1..grid.levels.len()).rev() {
            let blocks = &grid.levels[k].blocks;
            let active = |range: &std::ops::Range<usize>| {
                blocks.list[range.clone()].iter().filter(|b| b.active).count()
            };
            let fits = blocks.of_chart.iter().all(|range| active(range) <= MOST_BLOCKS);
            if !fits || bands[k].len() > 1 || coarse.blocks + blocks.list.len() > capacity {
                break;
            }
            coarse.first = k;
            coarse.blocks += blocks.list.len();
        }
        let mut base = 0;
        for level in &grid.levels[coarse.first..] {
            coarse.bases.push(base);
            base += level.blocks.list.len() as u32;
        }
        (!coarse.bases.is_empty()).then_some(coarse)
    }

    /// Where the blocks of a level begin in the common buffers; `None` for a level that is finer.
    pub fn base(&self, level: usize) -> Option<u32> {
        level.checked_sub(self.first).map(|k| self.bases[k])
    }

    /// All blocks, level by level.
    pub fn blocks(&self, grid: &Grid) -> Vec<CoarseBlock> {
        let mut all = Vec::with_capacity(self.blocks);
        for k in self.first..grid.levels.len() {
            let level = &grid.levels[k];
            let place = |k: usize, b: u32| match self.base(k) {
                Some(base) if b != NONE => base + b,
                _ => NONE,
            };
            for (b, block) in level.blocks.list.iter().enumerate() {
                let active =
                    |b: u32| if b != NONE && level.blocks.list[b as usize].active { b } else { NONE };
                let mut fixed = [0u32; NODES / 32];
                for (s, _) in level.movable[b].iter().enumerate().filter(|(_, movable)| **movable == 0) {
                    fixed[s / 32] |= 1 << (s % 32);
                }
                all.push(CoarseBlock {
                    active_neighbours: level.blocks.neighbours[b].map(|b| place(k, active(b))),
                    parent: if k + 1 < grid.levels.len() { place(k + 1, level.parent[b]) } else { NONE },
                    children: level.children[b].map(|child| place(k - 1, child)),
                    colour: block.y % 2 * 2 + block.x % 2,
                    fixed,
                });
            }
        }
        all
    }

    /// Per chart, level and colour the first and count of its active blocks, then all of these.
    pub fn lists(&self, grid: &Grid) -> Vec<u32> {
        let charts = grid.movable.len();
        let mut heads = Vec::with_capacity(charts * self.bases.len() * 8);
        let mut all: Vec<u32> = Vec::new();
        let start = (charts * self.bases.len() * 8) as u32;
        for c in 0..charts {
            for (level, base) in grid.levels[self.first..].iter().zip(&self.bases) {
                for colour in 0..4 {
                    let first = all.len();
                    all.extend(level.blocks.of_chart[c].clone().filter_map(|b| {
                        let block = &level.blocks.list[b];
                        let own = block.active && block.y % 2 * 2 + block.x % 2 == colour;
                        own.then_some(base + b as u32)
                    }));
                    heads.extend([start + first as u32, (all.len() - first) as u32]);
                }
            }
        }
        heads.extend(all);
        heads
    }

    /// Numbers in `lists`.
    pub fn list_length(&self, grid: &Grid) -> usize {
        let active =
            |level: &crate::tile::Level| level.blocks.list.iter().filter(|block| block.active).count();
        let blocks: usize = grid.levels[self.first..].iter().map(active).sum();
        grid.movable.len() * self.bases.len() * 8 + blocks
    }

    /// Bytes that one V-cycle from `level` down moves at least.
    pub fn bytes_moved(&self, grid: &Grid, level: usize) -> u64 {
        /// Smoothing down and up, the residual, both ways between levels.
        const PER_NODE: u64 = 2 * 100 + 100 + 60;
        let active =
            |level: &crate::tile::Level| level.blocks.list.iter().filter(|block| block.active).count() as u64;
        grid.levels[level..].iter().map(|level| active(level) * NODES as u64 * PER_NODE).sum()
    }
}
