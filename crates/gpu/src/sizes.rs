//! The sizes of a solver's buffers in bytes, used both to count and to allocate its memory.

use super::context::padded;
use super::layout::{
    BlockRecord, Chart, METRIC_PLANES, PLANE, ROW_PLANES, SUMS, Triangle, VECTOR_PLANES, node_planes,
    state_planes,
};
use super::lists::{GATE_SETS, MAX_GATES, dispatch_size_bytes, list_bytes};
use super::recorder::RecorderResources;
use super::records::feature_words;
use vrtm_core::allocation::Vec;
use vrtm_core::grid::features::Pieces;
use vrtm_core::grid::{Grid, Level};
use vrtm_core::mesh::TileMesh;

/// Bytes of the finer level's contributions to one block: 10x10 sums of two components for each quarter.
pub const CONTRIBUTIONS: u64 = 4 * 100 * 8;

/// Sizes of one level's buffers in bytes.
#[derive(Clone, Copy, Debug)]
pub struct LevelSizes {
    pub blocks: u64,
    pub lists: u64,
    pub nodes: u64,
    /// The state; on level 0, each of the solver's two results.
    pub state: u64,
    /// The metric on coarser levels; `None` on level 0.
    pub metric: Option<u64>,
    pub rows: u64,
    pub vectors: u64,
    /// `None` on level 0.
    pub contributions: Option<u64>,
    /// On level 1: first entries per node, and entries, of the gathered metrics.
    pub gather: Option<[u64; 2]>,
}

/// Sizes of all buffers of a solver in bytes.
#[derive(Clone, Debug)]
pub struct BufferSizes {
    pub levels: Vec<LevelSizes>,
    pub no_contributions: u64,
    pub triangles: u64,
    pub corners: u64,
    pub positions: u64,
    pub charts: u64,
    pub ranges: u64,
    pub partials: u64,
    pub dispatch_sizes: u64,
    pub indirect_arguments: u64,
    pub gate_open: u64,
    /// Per level, the features and the sums of their pieces; the multipliers.
    pub features: Vec<[u64; 2]>,
    pub multipliers: u64,
}

fn bytes_of<T>(count: usize) -> u64 {
    (count * size_of::<T>()) as u64
}

/// Bytes of a level's features, and of two sums for each of their pieces.
pub fn feature_bytes(pieces: &Pieces) -> [u64; 2] {
    [bytes_of::<u32>(feature_words(pieces)), bytes_of::<[f32; 2]>(pieces.feature.len())]
}

impl BufferSizes {
    pub fn new(grid: &Grid, tiles: &[&TileMesh]) -> BufferSizes {
        let of_level = |(k, level): (usize, &Level)| {
            let blocks = level.blocks.list.len();
            let planes = |n: usize| blocks as u64 * n as u64 * PLANE;
            LevelSizes {
                blocks: bytes_of::<BlockRecord>(blocks),
                lists: list_bytes(blocks as u64),
                nodes: planes(node_planes(grid)),
                state: planes(state_planes(k)),
                metric: (k > 0).then(|| planes(METRIC_PLANES)),
                rows: planes(ROW_PLANES),
                vectors: planes(VECTOR_PLANES),
                contributions: (k > 0).then(|| blocks as u64 * CONTRIBUTIONS),
                gather: (k == 1).then(|| grid.gather.bytes_of(0..blocks)),
            }
        };
        let vertices = tiles.iter().flat_map(|tile| &tile.charts).map(|chart| chart.count()).sum();
        BufferSizes {
            levels: grid.levels.iter().enumerate().map(of_level).collect(),
            no_contributions: CONTRIBUTIONS,
            triangles: bytes_of::<Triangle>(grid.triangles.len()),
            corners: bytes_of::<[u32; 3]>(grid.triangles.len()),
            positions: bytes_of::<[f32; 3]>(vertices),
            charts: bytes_of::<Chart>(grid.movable.len()),
            ranges: bytes_of::<[u32; 2]>(grid.movable.len() * grid.levels.len()),
            partials: bytes_of::<[f32; SUMS as usize]>(grid.levels[0].blocks.list.len()),
            dispatch_sizes: dispatch_size_bytes(grid.levels.len()),
            indirect_arguments: GATE_SETS as u64 * 4 * dispatch_size_bytes(grid.levels.len()),
            gate_open: bytes_of::<u32>(MAX_GATES as usize),
            features: grid.features.levels.iter().map(feature_bytes).collect(),
            multipliers: bytes_of::<f32>(grid.features.count),
        }
    }

    /// Bytes of all buffers, including those of the recorder.
    pub fn total(&self) -> u64 {
        let of_level = |level: &LevelSizes| {
            let always = [level.blocks, level.lists, level.nodes, level.state, level.rows, level.vectors];
            let optional = level.metric.into_iter().chain(level.contributions);
            let gather = level.gather.into_iter().flatten();
            always.into_iter().chain(optional).chain(gather).map(padded).sum::<u64>()
        };
        let levels: u64 = self.levels.iter().map(of_level).sum();
        let second_result = self.levels[0].state;
        let single = [
            second_result,
            self.no_contributions,
            self.triangles,
            self.corners,
            self.positions,
            self.charts,
            self.ranges,
            self.partials,
            self.dispatch_sizes,
            self.indirect_arguments,
            self.gate_open,
            self.multipliers,
        ];
        levels
            + single.into_iter().chain(self.features.iter().flatten().copied()).map(padded).sum::<u64>()
            + RecorderResources::BYTES
    }
}

#[cfg(test)]
mod tests {
    use std::sync::Arc;

    use crate::Memory;
    use crate::context::tests::gpu;
    use vrtm_core::backend::Options;
    use vrtm_core::fixtures::{maps, sheet};
    use vrtm_core::grid::Grid;
    use vrtm_core::settings::TileSettings;

    #[test]
    fn what_is_counted_is_what_is_allocated() {
        let mesh = sheet(4, |u, v| [u, v, 0.0]);
        let tile = &mesh.tiles[0];
        let maps = maps(96, TileSettings::default(), |u, _| u);
        let grid = Arc::new(Grid::new(&mesh, tile, &maps));
        let Some(context) = gpu(Options::default()) else { return };
        let context = Arc::new(context);
        let memory = Memory::new(&context, &grid, &[tile]).unwrap();
        let allocated: u64 = memory.all_buffers().iter().map(wgpu::Buffer::size).sum();
        assert_eq!(allocated, Memory::bytes_for(&grid, &[tile]));
    }
}
