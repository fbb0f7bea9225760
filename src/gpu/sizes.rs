//! The table of a tile's buffers: each one's bytes, from which they are counted and from which they are allocated.

use super::bands::Band;
use super::context::padded;
use super::correct::coarse_levels::CoarseLevels;
use super::layout::{
    BlockRecord, Chart, CoarseBlock, METRIC_PLANES, NODE_PLANES, RESULT_PLANES, ROW_PLANES, STATE_PLANES,
    Triangle, VECTOR_PLANES,
};
use super::lists::{GATES, MOST_GATES, list_bytes, size_bytes};
use super::memory::PLANE;
use super::recorder::Recording;
use crate::mesh::TileMesh;
use crate::tile::Grid;

/// Bytes of one band's buffers.
#[derive(Clone, Copy, Debug)]
pub struct BandSizes {
    pub blocks: u64,
    pub lists: u64,
    pub nodes: u64,
    pub state: u64,
    /// Coarser levels only.
    pub metric: Option<u64>,
    /// `None` where the coarse levels have them in common.
    pub rows: Option<u64>,
    /// Likewise.
    pub vectors: Option<u64>,
    /// Level 1 only.
    pub gather: Option<[u64; 2]>,
    /// Each of the two results; finest level only.
    result: u64,
}

/// Bytes of all buffers of a tile.
#[derive(Clone, Debug)]
pub struct Sizes {
    /// Per level and band.
    pub bands: Vec<Vec<BandSizes>>,
    pub coarse_rows: u64,
    pub coarse_vectors: u64,
    pub coarse_blocks: u64,
    pub coarse_lists: u64,
    pub triangles: u64,
    pub corners: u64,
    pub positions: u64,
    pub charts: u64,
    pub ranges: u64,
    pub partials: u64,
    pub sizes: u64,
    pub gates: u64,
    pub opened: u64,
}

fn bytes_of<T>(count: usize) -> u64 {
    (count * size_of::<T>()) as u64
}

impl Sizes {
    pub fn new(grid: &Grid, tile: &TileMesh, bands: &[Vec<Band>], coarse: Option<&CoarseLevels>) -> Sizes {
        let band = |k: usize, band: &Band| {
            let blocks = band.held.len();
            let planes = |n: usize| blocks as u64 * n as u64 * PLANE;
            let apart = coarse.is_none_or(|coarse| coarse.base(k).is_none());
            BandSizes {
                blocks: bytes_of::<BlockRecord>(blocks),
                lists: list_bytes(blocks as u64),
                nodes: planes(NODE_PLANES),
                state: planes(STATE_PLANES),
                metric: (k > 0).then(|| planes(METRIC_PLANES)),
                rows: apart.then(|| planes(ROW_PLANES)),
                vectors: apart.then(|| planes(VECTOR_PLANES)),
                gather: (k == 1).then(|| grid.gather.bytes_of(band.held.clone())),
                result: if k == 0 { planes(RESULT_PLANES) } else { 0 },
            }
        };
        let common = |planes: usize| coarse.map_or(0, |coarse| coarse.blocks as u64 * planes as u64 * PLANE);
        let vertices = tile.charts.iter().map(|chart| chart.vertices.len()).sum();
        Sizes {
            bands: bands
                .iter()
                .enumerate()
                .map(|(k, bands)| bands.iter().map(|of| band(k, of)).collect())
                .collect(),
            coarse_rows: common(ROW_PLANES),
            coarse_vectors: common(VECTOR_PLANES),
            coarse_blocks: coarse.map_or(0, |coarse| bytes_of::<CoarseBlock>(coarse.blocks)),
            coarse_lists: coarse.map_or(0, |coarse| bytes_of::<u32>(coarse.list_length(grid))),
            triangles: bytes_of::<Triangle>(tile.triangles.len()),
            corners: bytes_of::<[u32; 3]>(tile.triangles.len()),
            positions: bytes_of::<[f32; 3]>(vertices),
            charts: bytes_of::<Chart>(tile.charts.len()),
            ranges: bytes_of::<[u32; 2]>(tile.charts.len() * grid.levels.len()),
            partials: bytes_of::<[f32; 4]>(grid.levels[0].blocks.list.len()),
            sizes: size_bytes(bands),
            gates: GATES as u64 * 4 * size_bytes(bands),
            opened: bytes_of::<u32>(MOST_GATES as usize),
        }
    }

    /// Bytes of all of them, and of the recording.
    pub fn total(&self) -> u64 {
        let band = |band: &BandSizes| {
            let gather = band.gather.unwrap_or_default();
            let always = [band.blocks, band.lists, band.nodes, band.state];
            let at_times = [band.metric, band.rows, band.vectors].into_iter().flatten();
            let gather = gather.into_iter().filter(|_| band.gather.is_some());
            let results = [band.result; 2].into_iter().filter(|&bytes| bytes > 0);
            always.into_iter().chain(at_times).chain(gather).chain(results).map(padded).sum::<u64>()
        };
        let bands: u64 = self.bands.iter().flatten().map(band).sum();
        let coarse = [self.coarse_blocks, self.coarse_lists].into_iter().filter(|&bytes| bytes > 0);
        let single = [
            self.coarse_rows,
            self.coarse_vectors,
            self.triangles,
            self.corners,
            self.positions,
            self.charts,
            self.ranges,
            self.partials,
            self.sizes,
            self.gates,
            self.opened,
        ];
        bands + coarse.chain(single).map(padded).sum::<u64>() + Recording::BYTES
    }
}

#[cfg(test)]
mod tests {
    use std::sync::Arc;

    use crate::gpu::Memory;
    use crate::gpu::context::{Options, tests::gpu};
    use crate::oracle::reference::tests::{maps, sheet};
    use crate::settings::TileSettings;
    use crate::tile::Grid;
    use crate::tile::coverage::Coverage;

    #[test]
    fn what_is_counted_is_what_is_allocated() {
        let mesh = sheet(4, |u, v| [u, v, 0.0]);
        let tile = &mesh.tiles[0];
        let maps = maps(96, TileSettings::default(), |u, _| u);
        let coverage = Coverage::new(tile, 96, 96, maps.settings.overlap);
        let grid = Arc::new(Grid::new(&mesh, tile, &maps, &coverage));
        // In one buffer per level, and in several.
        for band in [None, Some(32)] {
            let Some(context) = gpu(Options { band, ..Options::default() }) else { return };
            let context = Arc::new(context);
            let memory = Memory::new(&context, &grid, tile).unwrap();
            let allocated: u64 = memory.all_buffers().iter().map(wgpu::Buffer::size).sum();
            assert_eq!(allocated, Memory::bytes_for(&context, &grid, tile).unwrap(), "{band:?}");
        }
    }
}
