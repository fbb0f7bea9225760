//! The coarse levels of the V-cycle: the levels on which every chart has so few blocks that one dispatch can work on
//! all of these levels.

use crate::layout::CoarseBlock;
use crate::records::packed_weights;
use vrtm_core::allocation::Vec;
use vrtm_core::grid::Grid;
use vrtm_core::grid::planes::NODES;
use vrtm_core::mesh::NONE;
use vrtm_core::method::law::FEW_BLOCKS;

/// Blocks of a chart on which the threads of a dispatch work at once (shaders/correct/multigrid_coarse.wgsl). Where a chart has
/// more, one dispatch for each step of the V-cycle takes less time; the coarsest level is always one of the coarse levels.
const BLOCKS_AT_ONCE: usize = 4;

/// The coarse levels, and the positions of their blocks in the shared buffers.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct CoarseLevels {
    /// The finest of the coarse levels, which include every level coarser than it.
    pub first: usize,
    /// Per coarse level, the index of its first block in the shared buffers.
    pub bases: Vec<u32>,
    /// Number of blocks of all coarse levels.
    pub blocks: usize,
}

impl CoarseLevels {
    /// Finds the coarse levels, with at most `capacity` blocks in total; `None` if the coarsest level is not one of
    /// them.
    pub fn new(grid: &Grid, capacity: usize) -> Option<CoarseLevels> {
        let mut coarse = CoarseLevels { first: grid.levels.len(), bases: Vec::new(), blocks: 0 };
        for (k, level) in grid.levels.iter().enumerate().rev() {
            let blocks = coarse.blocks + level.blocks.list.len();
            let most = if k + 1 == grid.levels.len() { FEW_BLOCKS } else { BLOCKS_AT_ONCE };
            if level.blocks.most_of_a_chart() > most || blocks > capacity {
                break;
            }
            (coarse.first, coarse.blocks) = (k, blocks);
        }
        let mut base = 0;
        for level in &grid.levels[coarse.first..] {
            coarse.bases.push(base);
            base += level.blocks.list.len() as u32;
        }
        (!coarse.bases.is_empty()).then_some(coarse)
    }

    /// Index of a level's first block in the shared buffers; `None` for a finer level.
    pub fn base(&self, level: usize) -> Option<u32> {
        level.checked_sub(self.first).map(|k| self.bases[k])
    }

    /// Records of all blocks, level by level.
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
                    neighbours: level.blocks.neighbours[b].map(|b| place(k, b)),
                    active_neighbours: level.blocks.neighbours[b].map(|b| place(k, active(b))),
                    parent: if k + 1 < grid.levels.len() { place(k + 1, level.parent[b]) } else { NONE },
                    children: level.children[b]
                        .map(|child| k.checked_sub(1).map_or(NONE, |k| place(k, child))),
                    colour: block.y % 2 * 2 + block.x % 2,
                    fixed,
                    weights: packed_weights(level, b),
                });
            }
        }
        all
    }

    /// For each chart and level, first and count of its active blocks; then these blocks.
    pub fn lists(&self, grid: &Grid) -> Vec<u32> {
        let charts = grid.movable.len();
        let mut ranges = Vec::with_capacity(charts * self.bases.len() * 2);
        let mut all: Vec<u32> = Vec::new();
        let start = (charts * self.bases.len() * 2) as u32;
        for c in 0..charts {
            for (level, base) in grid.levels[self.first..].iter().zip(&self.bases) {
                let first = all.len();
                let active = level.blocks.of_chart[c].clone().filter(|&b| level.blocks.list[b].active);
                all.extend(active.map(|b| base + b as u32));
                ranges.extend([start + first as u32, (all.len() - first) as u32]);
            }
        }
        ranges.extend(all);
        ranges
    }

    /// Length of `lists`.
    pub fn list_length(&self, grid: &Grid) -> usize {
        let active =
            |level: &vrtm_core::grid::Level| level.blocks.list.iter().filter(|block| block.active).count();
        let blocks: usize = grid.levels[self.first..].iter().map(active).sum();
        grid.movable.len() * self.bases.len() * 2 + blocks
    }

    /// The least number of bytes moved by a V-cycle from `level` down.
    pub fn bytes_moved(&self, grid: &Grid, level: usize) -> u64 {
        /// Bytes for smoothing on the way down and up, the residual, restriction and interpolation.
        const PER_NODE: u64 = 2 * 100 + 100 + 60;
        let active = |level: &vrtm_core::grid::Level| {
            level.blocks.list.iter().filter(|block| block.active).count() as u64
        };
        grid.levels[level..].iter().map(|level| active(level) * NODES as u64 * PER_NODE).sum()
    }
}
