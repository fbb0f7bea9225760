//! The memory of one tile's solver on the GPU: constants that are uploaded once per grid, and what a solve changes.

use std::collections::HashMap;
use std::sync::{Arc, Weak};

use super::bands::{Band, bands};
use super::constants::{band_blocks, constants, corners, triangles};
use super::context::Context;
use super::correct::coarse_levels::CoarseLevels;
use super::kernels::{Binding, Kernel, slot};
use super::layout::{INTERPOLATION, Params, ROW_PLANES};
use super::lists::{Lists, active, band_lists};
use super::recorder::Recording;
use super::results::ResultBuffers;
use super::sizes::Sizes;
use super::upload::Uploader;
use crate::error::{Error, ErrorKind, Result};
use crate::mesh::TileMesh;
use crate::tile::Grid;
use crate::tile::blocks::NODES;
use crate::tile::codes::of_weight;

/// Bytes of a plane.
pub const PLANE: u64 = NODES as u64 * 4;

/// One band's buffers.
#[derive(Debug)]
pub struct BandBuffers {
    pub blocks: wgpu::Buffer,
    pub lists: wgpu::Buffer,
    pub nodes: wgpu::Buffer,
    pub state: wgpu::Buffer,
    /// Coarser levels only.
    pub metric: Option<wgpu::Buffer>,
    pub rows: wgpu::Buffer,
    pub vectors: wgpu::Buffer,
    /// Level 1 only: the entries of its gather.
    pub gather: Option<[wgpu::Buffer; 2]>,
    /// Where its blocks begin in `rows` and `vectors`, which coarse levels have in common; `None` for other levels.
    pub base: Option<u32>,
}

/// What the coarse levels that one kernel does have in common, beside rows and vectors.
#[derive(Debug)]
pub struct Coarse {
    pub levels: CoarseLevels,
    pub blocks: wgpu::Buffer,
    pub lists: wgpu::Buffer,
}

/// The memory of one tile's solver, kept between solves.
#[derive(Debug)]
pub(crate) struct Memory {
    grid: Weak<Grid>,
    pub context: Arc<Context>,
    pub bands: Vec<Vec<Band>>,
    pub coarse: Option<Coarse>,
    pub buffers: Vec<Vec<BandBuffers>>,
    /// Per level and band, for the charts of the last solve.
    pub lists: Vec<Vec<Lists>>,
    listed: Option<Vec<bool>>,
    pub triangles: wgpu::Buffer,
    pub corners: wgpu::Buffer,
    pub positions: wgpu::Buffer,
    pub charts: wgpu::Buffer,
    pub ranges: wgpu::Buffer,
    pub partials: wgpu::Buffer,
    /// Sizes of gated dispatches (that of a workgroup per chart first), their arguments, and which gates opened.
    pub sizes: wgpu::Buffer,
    pub gates: wgpu::Buffer,
    pub opened: wgpu::Buffer,
    /// How many sizes there are.
    pub size_count: u32,
    pub recording: Recording,
    /// Two results: the last one and the next.
    results: [Arc<ResultBuffers>; 2],
    /// Bind groups that were made, by kernel, band and the kernel's own buffers.
    pub groups: HashMap<(Kernel, [usize; 2], Vec<wgpu::Buffer>), wgpu::BindGroup>,
}

/// Most bytes per block in one buffer.
const LARGEST: u64 = ROW_PLANES as u64 * PLANE;

fn capacity(context: &Context) -> usize {
    let limits = &context.limits;
    // Shaders count in u32.
    let bytes = limits.max_storage_buffer_binding_size.min(limits.max_buffer_size).min(i32::MAX as u64);
    let most = (bytes / LARGEST) as usize;
    context.options.band.map_or(most, |band| band.min(most))
}

/// Copies interpolation's weights, a plane per block, to their places in the rows of `count` blocks, the first of which is
/// block `base` there.
fn put_weights(context: &Context, weights: &wgpu::Buffer, rows: &wgpu::Buffer, base: u32, count: u64) {
    let mut encoder = context.device.create_command_encoder(&Default::default());
    for b in 0..count {
        let to = (u64::from(base) + b) * ROW_PLANES as u64 + INTERPOLATION as u64;
        encoder.copy_buffer_to_buffer(weights, b * PLANE, rows, to * PLANE, PLANE);
    }
    context.queue.submit([encoder.finish()]);
}

impl Memory {
    /// Allocates for a grid, and uploads what does not depend on the pose.
    pub fn new(context: &Arc<Context>, grid: &Arc<Grid>, tile: &TileMesh) -> Result<Memory> {
        let bands = bands(&grid.levels, capacity(context))?;
        let coarse = CoarseLevels::new(grid, &bands, capacity(context));
        let sizes = Sizes::new(grid, tile, &bands, coarse.as_ref());
        let uploader = Uploader::new(context);
        let storage = |label: &str, bytes: u64| uploader.storage(label, bytes);
        let coarse_rows = storage("rows", sizes.coarse_rows)?;
        let coarse_vectors = storage("vectors", sizes.coarse_vectors)?;
        let mut buffers = Vec::with_capacity(bands.len());
        for (k, level) in grid.levels.iter().enumerate() {
            let base = coarse.as_ref().and_then(|coarse| coarse.base(k));
            let mut of_level = Vec::with_capacity(bands[k].len());
            for (band, sizes) in bands[k].iter().zip(&sizes.bands[k]) {
                let gather = match sizes.gather {
                    Some([starts_size, entries_size]) => {
                        let (starts, entries) = grid.gather.of_blocks(band.held.clone());
                        let entries: Vec<[u32; 2]> =
                            entries.iter().map(|&(t, share)| [t, share.to_bits()]).collect();
                        Some([
                            uploader.upload("gather", starts_size, bytemuck::cast_slice(&starts))?,
                            uploader.upload("gather", entries_size, bytemuck::cast_slice(&entries))?,
                        ])
                    }
                    None => None,
                };
                let rows =
                    sizes.rows.map_or_else(|| Ok(coarse_rows.clone()), |bytes| storage("rows", bytes))?;
                if let Some(weights) = level.interpolation.get(band.held.clone()) {
                    let weights: Vec<f32> =
                        weights.as_flattened().iter().map(|&code| of_weight(code)).collect();
                    let bytes: &[u8] = bytemuck::cast_slice(&weights);
                    let weights = uploader.upload("interpolation", bytes.len() as u64, bytes)?;
                    put_weights(context, &weights, &rows, base.unwrap_or(0), band.held.len() as u64);
                }
                let vectors = sizes.vectors;
                let blocks = band_blocks(grid, &bands, k, band);
                let nodes = constants(grid, level, k, band);
                of_level.push(BandBuffers {
                    blocks: uploader.upload("blocks", sizes.blocks, bytemuck::cast_slice(&blocks))?,
                    lists: storage("lists", sizes.lists)?,
                    nodes: uploader.upload("nodes", sizes.nodes, bytemuck::cast_slice(&nodes))?,
                    state: storage("state", sizes.state)?,
                    metric: sizes.metric.map(|bytes| storage("metric", bytes)).transpose()?,
                    rows,
                    vectors: vectors
                        .map_or_else(|| Ok(coarse_vectors.clone()), |bytes| storage("vectors", bytes))?,
                    gather,
                    base,
                });
            }
            buffers.push(of_level);
        }
        let coarse = coarse
            .map(|levels| {
                let (blocks, lists) = (levels.blocks(grid), levels.lists(grid));
                let blocks: &[u8] = bytemuck::cast_slice(&blocks);
                let blocks = uploader.upload("coarse levels", sizes.coarse_blocks, blocks)?;
                let lists = bytemuck::cast_slice(&lists);
                let lists = uploader.upload("coarse levels", sizes.coarse_lists, lists)?;
                Ok::<_, Error>(Coarse { levels, blocks, lists })
            })
            .transpose()?;
        let blocks: Vec<_> = buffers[0].iter().map(|band: &BandBuffers| band.blocks.clone()).collect();
        let result = || ResultBuffers::new(&bands[0], blocks.clone(), &storage).map(Arc::new);
        let indirect = wgpu::BufferUsages::STORAGE | wgpu::BufferUsages::INDIRECT;
        let (triangles, corners) = (triangles(grid), corners(grid, tile));
        let memory = Memory {
            grid: Arc::downgrade(grid),
            triangles: uploader.upload("triangles", sizes.triangles, bytemuck::cast_slice(&triangles))?,
            corners: uploader.upload("corners", sizes.corners, bytemuck::cast_slice(&corners))?,
            positions: storage("positions", sizes.positions)?,
            charts: storage("charts", sizes.charts)?,
            ranges: storage("ranges", sizes.ranges)?,
            partials: storage("partials", sizes.partials)?,
            sizes: storage("sizes", sizes.sizes)?,
            gates: context.buffer("gates", sizes.gates, indirect)?,
            opened: storage("gates", sizes.opened)?,
            size_count: 0,
            recording: Recording::new(context)?,
            results: [result()?, result()?],
            lists: Vec::new(),
            listed: None,
            groups: HashMap::new(),
            context: context.clone(),
            coarse,
            bands,
            buffers,
        };
        context.check()?;
        Ok(memory)
    }

    /// Bytes that `new` takes for a grid.
    pub fn bytes_for(context: &Context, grid: &Grid, tile: &TileMesh) -> Result<u64> {
        let bands = bands(&grid.levels, capacity(context))?;
        let coarse = CoarseLevels::new(grid, &bands, capacity(context));
        Ok(Sizes::new(grid, tile, &bands, coarse.as_ref()).total())
    }

    /// True if this is the memory of a grid.
    pub fn is_for(&self, grid: &Arc<Grid>) -> bool {
        self.grid.upgrade().is_some_and(|own| Arc::ptr_eq(&own, grid))
    }

    /// Buffers for a result that nothing else holds.
    pub fn free_result(&mut self) -> Result<Arc<ResultBuffers>> {
        if let Some(free) = self.results.iter().find(|result| Arc::strong_count(result) == 1) {
            return Ok(free.clone());
        }
        Err(Error::new(ErrorKind::Internal, "both results are in use"))
    }

    /// Makes the lists of the charts that a solve works on.
    pub fn list(&mut self, grid: &Grid, charts: &[bool]) {
        if self.listed.as_deref() == Some(charts) {
            return;
        }
        self.lists.clear();
        let mut ranges: Vec<[u32; 2]> = Vec::new();
        let mut sizes = vec![charts.len() as u32];
        for (k, level) in grid.levels.iter().enumerate() {
            let mut of_level = Vec::with_capacity(self.bands[k].len());
            let mut sums = 0;
            let mut of_chart = vec![[0u32; 2]; charts.len()];
            for (band, buffers) in self.bands[k].iter().zip(&self.buffers[k]) {
                let finer = k.checked_sub(1).map(|k| (&grid.levels[k], &self.bands[k][band.below.clone()]));
                let (lists, all) = band_lists(level, band, finer, charts, &mut sizes, sums);
                for b in active(level, band, charts) {
                    let range = &mut of_chart[level.blocks.list[b].chart as usize];
                    range[0] = if range[1] == 0 { sums } else { range[0] };
                    range[1] += 1;
                    sums += 1;
                }
                self.context.queue.write_buffer(&buffers.lists, 0, bytemuck::cast_slice(&all));
                of_level.push(lists);
            }
            ranges.extend(of_chart);
            self.lists.push(of_level);
        }
        self.size_count = sizes.len() as u32;
        self.context.queue.write_buffer(&self.sizes, 0, bytemuck::cast_slice(&sizes));
        self.context.queue.write_buffer(&self.ranges, 0, bytemuck::cast_slice(&ranges));
        self.listed = Some(charts.to_vec());
    }

    /// The bind group of a kernel: `at` is the band (level, index), `own` the kernel's own buffers.
    pub fn group(
        &self,
        kernel: Kernel,
        layout: &wgpu::BindGroupLayout,
        at: [usize; 2],
        own: &[wgpu::Buffer],
    ) -> wgpu::BindGroup {
        let band = &self.buffers[at[0]][at[1]];
        let entries: Vec<_> = kernel
            .source()
            .bindings
            .iter()
            .map(|binding| {
                let buffer = match binding.number() {
                    slot::CHARTS => &self.charts,
                    slot::BLOCKS => &band.blocks,
                    slot::LISTS => &band.lists,
                    slot::NODES => &band.nodes,
                    slot::STATE => &band.state,
                    // The first steps of the pyramid look at triangles, whatever the level.
                    slot::SURFACE if kernel == Kernel::PyramidGather => &self.triangles,
                    slot::SURFACE => band.metric.as_ref().unwrap_or(&self.triangles),
                    slot::ROWS => &band.rows,
                    slot::VECTORS => &band.vectors,
                    slot::PARTIALS => &self.partials,
                    0 => &self.recording.params,
                    n => &own[(n - slot::OWN) as usize],
                };
                let resource = match binding {
                    Binding::Params => wgpu::BindingResource::Buffer(wgpu::BufferBinding {
                        buffer,
                        offset: 0,
                        size: std::num::NonZeroU64::new(size_of::<Params>() as u64),
                    }),
                    _ => buffer.as_entire_binding(),
                };
                wgpu::BindGroupEntry { binding: binding.number(), resource }
            })
            .collect();
        self.context.device.create_bind_group(&wgpu::BindGroupDescriptor {
            label: Some(kernel.source().entry),
            layout,
            entries: &entries,
        })
    }

    /// Each buffer once.
    #[cfg(test)]
    #[allow(clippy::mutable_key_type, reason = "a buffer is compared by its identity")]
    pub fn all_buffers(&self) -> std::collections::HashSet<wgpu::Buffer> {
        let bands = self.buffers.iter().flatten().flat_map(|band| {
            let always = [&band.blocks, &band.lists, &band.nodes, &band.state, &band.rows, &band.vectors];
            always.into_iter().chain(&band.metric).chain(band.gather.iter().flatten())
        });
        let coarse = self.coarse.iter().flat_map(|coarse| [&coarse.blocks, &coarse.lists]);
        let results = self.results.iter().flat_map(|result| result.bands.iter().map(|(_, buffer)| buffer));
        let single = [
            &self.triangles,
            &self.corners,
            &self.positions,
            &self.charts,
            &self.ranges,
            &self.partials,
            &self.sizes,
            &self.gates,
            &self.opened,
            &self.recording.params,
        ];
        bands.chain(coarse).chain(results).chain(single).cloned().collect()
    }
}
