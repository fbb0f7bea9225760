//! The sizes of a solver's buffers in bytes, used both to count and to allocate its memory.

use super::bands::Band;
use super::context::padded;
use super::layout::{
    BlockRecord, Chart, METRIC_PLANES, PLANE, ROW_PLANES, SUMS, Triangle, VECTOR_PLANES, node_planes,
    state_planes,
};
use super::lists::{GATE_SETS, MAX_GATES, dispatch_size_bytes, list_bytes};
use super::recorder::RecorderResources;
use vrtm_core::allocation::Vec;
use vrtm_core::grid::Grid;
use vrtm_core::mesh::TileMesh;

/// Bytes of the finer level's contributions to one block: 10x10 sums of two components for each quarter.
pub const CONTRIBUTIONS: u64 = 4 * 100 * 8;

/// Sizes of one band's buffers in bytes.
#[derive(Clone, Copy, Debug)]
pub struct BandBufferSizes {
    pub blocks: u64,
    pub lists: u64,
    pub nodes: u64,
    /// The state on coarser levels; `None` on level 0, whose state is one of the results.
    pub state: Option<u64>,
    /// The metric on coarser levels; `None` on level 0.
    pub metric: Option<u64>,
    pub rows: u64,
    pub vectors: u64,
    /// `None` on level 0.
    pub contributions: Option<u64>,
    /// On level 1: first entries per node, and entries, of the gathered metrics.
    pub gather: Option<[u64; 2]>,
    /// Bytes of each of the solver's two result buffers; 0 on coarser levels.
    result: u64,
}

/// Sizes of all buffers of a solver in bytes.
#[derive(Clone, Debug)]
pub struct BufferSizes {
    /// Per level and band.
    pub bands: Vec<Vec<BandBufferSizes>>,
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
}

fn bytes_of<T>(count: usize) -> u64 {
    (count * size_of::<T>()) as u64
}

impl BufferSizes {
    pub fn new(grid: &Grid, tiles: &[&TileMesh], bands: &[Vec<Band>]) -> BufferSizes {
        let band = |k: usize, band: &Band| {
            let blocks = band.buffered.len();
            let planes = |n: usize| blocks as u64 * n as u64 * PLANE;
            BandBufferSizes {
                blocks: bytes_of::<BlockRecord>(blocks),
                lists: list_bytes(blocks as u64),
                nodes: planes(node_planes(grid)),
                state: (k > 0).then(|| planes(state_planes(k))),
                metric: (k > 0).then(|| planes(METRIC_PLANES)),
                rows: planes(ROW_PLANES),
                vectors: planes(VECTOR_PLANES),
                contributions: (k > 0).then(|| blocks as u64 * CONTRIBUTIONS),
                gather: (k == 1).then(|| grid.gather.bytes_of(band.buffered.clone())),
                result: if k == 0 { planes(state_planes(k)) } else { 0 },
            }
        };
        let vertices = tiles.iter().flat_map(|tile| &tile.charts).map(|chart| chart.count()).sum();
        BufferSizes {
            bands: bands
                .iter()
                .enumerate()
                .map(|(k, bands)| bands.iter().map(|of| band(k, of)).collect())
                .collect(),
            no_contributions: CONTRIBUTIONS,
            triangles: bytes_of::<Triangle>(grid.triangles.len()),
            corners: bytes_of::<[u32; 3]>(grid.triangles.len()),
            positions: bytes_of::<[f32; 3]>(vertices),
            charts: bytes_of::<Chart>(grid.movable.len()),
            ranges: bytes_of::<[u32; 2]>(grid.movable.len() * grid.levels.len()),
            partials: bytes_of::<[f32; SUMS as usize]>(grid.levels[0].blocks.list.len()),
            dispatch_sizes: dispatch_size_bytes(bands),
            indirect_arguments: GATE_SETS as u64 * 4 * dispatch_size_bytes(bands),
            gate_open: bytes_of::<u32>(MAX_GATES as usize),
        }
    }

    /// Bytes of all buffers, including those of the recorder.
    pub fn total(&self) -> u64 {
        let band = |band: &BandBufferSizes| {
            let gather = band.gather.unwrap_or_default();
            let always = [band.blocks, band.lists, band.nodes, band.rows, band.vectors];
            let optional = [band.state, band.metric, band.contributions];
            let optional = optional.into_iter().flatten();
            let gather = gather.into_iter().filter(|_| band.gather.is_some());
            let results = [band.result; 2].into_iter().filter(|&bytes| bytes > 0);
            always.into_iter().chain(optional).chain(gather).chain(results).map(padded).sum::<u64>()
        };
        let bands: u64 = self.bands.iter().flatten().map(band).sum();
        let single = [
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
        ];
        bands + single.into_iter().map(padded).sum::<u64>() + RecorderResources::BYTES
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
        // With one buffer per level, then with several.
        for band in [None, Some(32)] {
            let Some(context) = gpu(Options { band, ..Options::default() }) else { return };
            let context = Arc::new(context);
            let memory = Memory::new(&context, &grid, &[tile]).unwrap();
            let allocated: u64 = memory.all_buffers().iter().map(wgpu::Buffer::size).sum();
            assert_eq!(allocated, Memory::bytes_for(&context, &grid, &[tile]).unwrap(), "{band:?}");
        }
    }
}
