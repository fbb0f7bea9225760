//! The memory of one tile's solver on the GPU: constants that are uploaded once per grid, and what a solve changes.

use std::collections::HashMap;
use std::sync::{Arc, Weak};

use super::bands::{Band, bands};
use super::constants::{band_blocks, constants, triangles};
use super::context::Context;
use super::cycle::{CycleBlock, SmallLevels};
use super::kernels::{Binding, Kernel, slot};
use super::layout::{
    Block, Chart, INTERPOLATION, METRIC_PLANES, NODE_PLANES, Params, RESULT_PLANES, ROW_PLANES, STATE_PLANES,
    Triangle, VECTOR_PLANES,
};
use super::lists::{GATES, Lists, MOST_GATES, active, band_lists, list_bytes, size_bytes};
use super::recorder::Recording;
use super::results::ResultBuffers;
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
    /// Where its blocks begin in `rows` and `vectors`, which small levels have in common; `None` for other levels.
    pub base: Option<u32>,
}

/// What the small levels have in common beside rows and vectors.
#[derive(Debug)]
pub struct Small {
    pub levels: SmallLevels,
    pub blocks: wgpu::Buffer,
    pub lists: wgpu::Buffer,
}

/// The memory of one tile's solver, kept between solves.
#[derive(Debug)]
pub(crate) struct Memory {
    grid: Weak<Grid>,
    pub context: Arc<Context>,
    pub bands: Vec<Vec<Band>>,
    pub small: Option<Small>,
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

/// Bytes that are handed over at a time.
const UPLOAD: usize = 32 << 20;

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
        use wgpu::BufferUsages as Usage;
        let bands = bands(&grid.levels, capacity(context))?;
        let storage = |label: &str, bytes: u64| {
            let limit = context.limits.max_storage_buffer_binding_size.min(context.limits.max_buffer_size);
            if bytes > limit {
                let message = format!("{label}: {bytes} bytes, but the GPU binds at most {limit}");
                return Err(Error::new(ErrorKind::Unsupported, message));
            }
            context.buffer(label, bytes, Usage::STORAGE | Usage::COPY_DST | Usage::COPY_SRC)
        };
        let waiting = std::cell::Cell::new(0);
        let upload = |label: &str, bytes: &[u8]| {
            let buffer = storage(label, bytes.len() as u64)?;
            // What is written waits in host memory until it is submitted: not too much of it at a time.
            for (n, part) in bytes.chunks(UPLOAD).enumerate() {
                context.queue.write_buffer(&buffer, (n * UPLOAD) as u64, part);
                waiting.set(waiting.get() + part.len());
                if waiting.get() >= UPLOAD {
                    context.queue.submit([]);
                    context.wait()?;
                    waiting.set(0);
                }
            }
            Ok::<_, Error>(buffer)
        };
        let small = SmallLevels::new(grid, &bands, capacity(context));
        let common =
            |planes: usize| small.as_ref().map_or(0, |small| small.blocks as u64 * planes as u64 * PLANE);
        let (small_rows, small_vectors) =
            (storage("rows", common(ROW_PLANES))?, storage("vectors", common(VECTOR_PLANES))?);
        let mut buffers = Vec::with_capacity(bands.len());
        for (k, level) in grid.levels.iter().enumerate() {
            let base = small.as_ref().and_then(|small| small.base(k));
            let mut of_level = Vec::with_capacity(bands[k].len());
            for band in &bands[k] {
                let count = band.held.len() as u64;
                let planes = |n: usize| count * n as u64 * PLANE;
                let gather = match k {
                    1 => {
                        let (starts, entries) = grid.gather.of_blocks(band.held.clone());
                        let entries: Vec<[u32; 2]> =
                            entries.iter().map(|&(t, share)| [t, share.to_bits()]).collect();
                        Some([
                            upload("gather", bytemuck::cast_slice(&starts))?,
                            upload("gather", bytemuck::cast_slice(&entries))?,
                        ])
                    }
                    _ => None,
                };
                let rows = match base {
                    Some(_) => small_rows.clone(),
                    None => storage("rows", planes(ROW_PLANES))?,
                };
                if let Some(weights) = level.interpolation.get(band.held.clone()) {
                    let weights: Vec<f32> =
                        weights.as_flattened().iter().map(|&code| of_weight(code)).collect();
                    let weights = upload("interpolation", bytemuck::cast_slice(&weights))?;
                    put_weights(context, &weights, &rows, base.unwrap_or(0), count);
                }
                of_level.push(BandBuffers {
                    blocks: upload("blocks", bytemuck::cast_slice(&band_blocks(grid, &bands, k, band)))?,
                    lists: storage("lists", list_bytes(count))?,
                    nodes: upload("nodes", bytemuck::cast_slice(&constants(grid, level, k, band)))?,
                    state: storage("state", planes(STATE_PLANES))?,
                    metric: (k > 0).then(|| storage("metric", planes(METRIC_PLANES))).transpose()?,
                    rows,
                    vectors: match base {
                        Some(_) => small_vectors.clone(),
                        None => storage("vectors", planes(VECTOR_PLANES))?,
                    },
                    gather,
                    base,
                });
            }
            buffers.push(of_level);
        }
        let mut first_vertex = Vec::with_capacity(tile.charts.len());
        let mut vertices = 0u32;
        for chart in &tile.charts {
            first_vertex.push(vertices);
            vertices += chart.vertices.len() as u32;
        }
        let corners: Vec<u32> = tile
            .triangles
            .iter()
            .zip(&grid.chart_of)
            .flat_map(|(triangle, &chart)| triangle.local.map(|v| first_vertex[chart as usize] + v))
            .collect();
        let small = small
            .map(|levels| {
                let blocks =
                    upload("small levels", bytemuck::cast_slice::<CycleBlock, u8>(&levels.blocks(grid)))?;
                let lists = upload("small levels", bytemuck::cast_slice(&levels.lists(grid)))?;
                Ok::<_, Error>(Small { levels, blocks, lists })
            })
            .transpose()?;
        let charts = tile.charts.len() as u64;
        let blocks: Vec<_> = buffers[0].iter().map(|band: &BandBuffers| band.blocks.clone()).collect();
        let result = || ResultBuffers::new(&bands[0], blocks.clone(), &storage).map(Arc::new);
        let memory = Memory {
            grid: Arc::downgrade(grid),
            triangles: upload("triangles", bytemuck::cast_slice(&triangles(grid)))?,
            corners: upload("corners", bytemuck::cast_slice(&corners))?,
            positions: storage("positions", u64::from(vertices) * 12)?,
            charts: storage("charts", charts * size_of::<Chart>() as u64)?,
            ranges: storage("ranges", charts * grid.levels.len() as u64 * 8)?,
            partials: storage("partials", grid.levels[0].blocks.list.len() as u64 * 16)?,
            sizes: storage("sizes", size_bytes(&bands))?,
            gates: context.buffer(
                "gates",
                GATES as u64 * 4 * size_bytes(&bands),
                Usage::STORAGE | Usage::INDIRECT,
            )?,
            opened: storage("gates", u64::from(MOST_GATES) * 4)?,
            size_count: 0,
            recording: Recording::new(context)?,
            results: [result()?, result()?],
            lists: Vec::new(),
            listed: None,
            groups: HashMap::new(),
            context: context.clone(),
            small,
            bands,
            buffers,
        };
        context.check()?;
        Ok(memory)
    }

    /// Bytes that `new` takes for a grid.
    pub fn bytes_for(context: &Context, grid: &Grid, tile: &TileMesh) -> Result<u64> {
        let bands = bands(&grid.levels, capacity(context))?;
        let small = SmallLevels::new(grid, &bands, capacity(context));
        let mut bytes = Recording::BYTES + small.map_or(0, |small| small.bytes(grid));
        for (k, bands) in bands.iter().enumerate() {
            for band in bands {
                let count = band.held.len() as u64;
                let planes = NODE_PLANES + STATE_PLANES + ROW_PLANES + VECTOR_PLANES;
                let other = if k == 0 { 2 * RESULT_PLANES } else { METRIC_PLANES };
                bytes +=
                    count * ((planes + other) as u64 * PLANE + size_of::<Block>() as u64) + list_bytes(count);
            }
        }
        let vertices: usize = tile.charts.iter().map(|chart| chart.vertices.len()).sum();
        bytes += (tile.triangles.len() * (size_of::<Triangle>() + 12) + vertices * 12) as u64;
        bytes += (tile.charts.len() * (size_of::<Chart>() + 8 * grid.levels.len())) as u64;
        bytes += (1 + 4 * GATES as u64) * size_bytes(&bands) + u64::from(MOST_GATES) * 4;
        Ok(bytes + grid.gather.bytes() as u64 + grid.levels[0].blocks.list.len() as u64 * 16)
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
                    slot::SURFACE if kernel == Kernel::Gather => &self.triangles,
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
}
