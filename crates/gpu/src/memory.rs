//! The memory of a solver on the GPU, of one tile or of several as one: constants, which are uploaded once per grid,
//! and the state of a solve.

use std::collections::HashMap;
use std::ops::Range;
use std::sync::{Arc, Weak};

use super::context::Context;
use super::kernels::{Binding, Kernel, slot};
use super::layout::{PLANE, Params, ROW_PLANES};
use super::lists::{Lists, level_lists};
use super::pipelines::{Pipeline, range};
use super::recorder::{Bound, RecorderResources};
use super::records::{block_nodes, block_records, corners, features, triangles};
use super::results::{Displacements, RESULT_BLOCK, ResultBuffers};
use super::sizes::{BufferSizes, feature_bytes};
use super::upload::Uploader;
use vrtm_core::allocation::{Vec, vec};
use vrtm_core::error::Result;
use vrtm_core::grid::features::{Features, Pieces};
use vrtm_core::grid::planes::Plane;
use vrtm_core::grid::{Grid, Level};
use vrtm_core::mesh::TileMesh;

/// One level's buffers.
#[derive(Debug)]
pub struct LevelBuffers {
    pub blocks: wgpu::Buffer,
    pub lists: wgpu::Buffer,
    pub nodes: wgpu::Buffer,
    /// The state on coarser levels; `None` on level 0, whose state is the result that the solve writes.
    pub state: Option<wgpu::Buffer>,
    /// The metric on coarser levels; `None` on level 0.
    pub metric: Option<wgpu::Buffer>,
    pub rows: wgpu::Buffer,
    pub vectors: wgpu::Buffer,
    /// Contributions of the finer level's blocks to this level's right-hand side in a V-cycle; on coarser levels only.
    pub contributions: wgpu::Buffer,
    /// On level 1, the triangles of the dual cells (method §3): first entries per node, and the entries.
    pub gather: Option<[wgpu::Buffer; 2]>,
}

/// The painted features of a grid, and what a solve knows of them.
#[derive(Debug)]
pub struct FeatureBuffers {
    /// Tells whether those of a grid are uploaded.
    of: Weak<Features>,
    /// Per level, the features and the sums of their pieces.
    pub levels: Vec<[wgpu::Buffer; 2]>,
    pub multipliers: wgpu::Buffer,
}

/// The memory of a solver, kept between solves.
#[derive(Debug)]
pub struct Memory {
    /// The grid whose constants are uploaded.
    pub grid: Weak<Grid>,
    /// Its planes of triangles, which identify its blocks.
    pub blocks: Weak<Vec<Plane<u32>>>,
    pub context: Arc<Context>,
    pub levels: Vec<LevelBuffers>,
    /// Per level, the number of active blocks of all charts.
    pub active_blocks: Vec<u64>,
    /// Per level, whether four threads relax a node.
    pub is_wide: Vec<bool>,
    /// Per tile, its blocks of level 0.
    pub parts: Vec<Range<usize>>,
    /// Lists per level, for the charts in `listed_charts`.
    pub lists: Vec<Lists>,
    listed_charts: Option<Vec<bool>>,
    pub features: FeatureBuffers,
    pub triangles: wgpu::Buffer,
    pub corners: wgpu::Buffer,
    pub positions: wgpu::Buffer,
    pub charts: wgpu::Buffer,
    pub ranges: wgpu::Buffer,
    pub partials: wgpu::Buffer,
    /// Dispatch sizes (the number of charts first, then the lengths of all lists), the indirect arguments that the
    /// gates derive from them, and a record of which gates were open.
    pub dispatch_sizes: wgpu::Buffer,
    pub indirect_arguments: wgpu::Buffer,
    pub gate_open: wgpu::Buffer,
    /// A placeholder bound for contributions that do not exist: from a level finer than the finest, or to one coarser
    /// than the coarsest.
    pub no_contributions: wgpu::Buffer,
    /// Number of dispatch sizes.
    pub dispatch_size_count: u32,
    pub recording: RecorderResources,
    /// Bytes of all these buffers, and of two results.
    pub bytes: u64,
    /// Two results: the last one and the next. There are more while older ones are being read.
    results: Vec<Arc<ResultBuffers>>,
    /// Bind groups created so far, by kernel, level, the level's state and the kernel's extra buffers.
    pub bind_groups: HashMap<(Kernel, usize, wgpu::Buffer, Vec<wgpu::Buffer>), Bound>,
}

/// The maximum number of bytes of a block in one buffer.
const MAX_BYTES_PER_BLOCK: u64 = ROW_PLANES as u64 * PLANE;

/// Most blocks of a level: its largest buffer has to fit into one binding.
pub fn most_blocks(context: &Context) -> usize {
    let limits = &context.limits;
    // Indices in shaders are 32 bits wide.
    let bytes = limits.max_storage_buffer_binding_size.min(limits.max_buffer_size).min(i32::MAX as u64);
    context.options.most_blocks.unwrap_or(usize::MAX).min((bytes / MAX_BYTES_PER_BLOCK) as usize)
}

/// Most active blocks of a tile's level on which four threads relax a node: fewer leave most of a large GPU idle.
const WIDE_BLOCKS: usize = 2048;

fn active_blocks_of(level: &Level) -> usize {
    level.blocks.list.iter().filter(|block| block.active).count()
}

/// Key of the choice of kernels and of the layout of buffers.
pub fn kind(grid: &Grid) -> impl PartialEq + use<> {
    let finest = &grid.levels[0];
    let is_wide: Vec<bool> = grid.levels.iter().map(|level| active_blocks_of(level) <= WIDE_BLOCKS).collect();
    (grid.has_extra, finest.density.is_empty(), finest.hold.is_empty(), grid.coarsest(), is_wide)
}

/// Per tile, its blocks of level 0.
fn parts(grid: &Grid, tiles: &[&TileMesh]) -> Vec<Range<usize>> {
    let of_chart = &grid.levels[0].blocks.of_chart;
    let (mut chart, mut start) = (0, 0);
    let part = |tile: &&TileMesh| {
        chart += tile.charts.len();
        let end = if chart > 0 { of_chart[chart - 1].end } else { 0 };
        std::mem::replace(&mut start, end)..end
    };
    tiles.iter().map(part).collect()
}

impl FeatureBuffers {
    fn new(uploader: &Uploader, grid: &Grid) -> Result<FeatureBuffers> {
        let of_level = |pieces: &Pieces| {
            let [size, squares] = feature_bytes(pieces);
            let features = features(pieces);
            let features = uploader.upload("features", size, bytemuck::cast_slice(&features))?;
            Ok([features, uploader.storage("squares", squares)?])
        };
        let bytes = (grid.features.count * size_of::<f32>()) as u64;
        Ok(FeatureBuffers {
            of: Arc::downgrade(&grid.features),
            levels: grid.features.levels.iter().map(of_level).collect::<Result<_>>()?,
            multipliers: uploader.storage("multipliers", bytes)?,
        })
    }
}

impl Memory {
    /// Allocates the memory for the grid of some tiles, and uploads its constants. Several tiles are of one kind.
    pub fn new(context: &Arc<Context>, grid: &Arc<Grid>, tiles: &[&TileMesh]) -> Result<Memory> {
        let sizes = BufferSizes::new(grid, tiles);
        let uploader = Uploader::new(context);
        let storage = |label: &str, bytes: u64| uploader.storage(label, bytes);
        let no_contributions = storage("contributions", sizes.no_contributions)?;
        let mut levels = Vec::with_capacity(grid.levels.len());
        for (k, (level, sizes)) in grid.levels.iter().zip(&sizes.levels).enumerate() {
            let of_level = 0..level.blocks.list.len();
            let gather = match sizes.gather {
                Some([starts_size, entries_size]) => {
                    let (starts, entries) = grid.gather.of_blocks(of_level.clone());
                    let entries: Vec<[u32; 2]> =
                        entries.iter().map(|&(t, fraction)| [t, fraction.to_bits()]).collect();
                    Some([
                        uploader.upload("gather", starts_size, bytemuck::cast_slice(&starts))?,
                        uploader.upload("gather", entries_size, bytemuck::cast_slice(&entries))?,
                    ])
                }
                None => None,
            };
            let blocks = block_records(grid, k, of_level.clone());
            let nodes = block_nodes(grid, level, k, of_level);
            levels.push(LevelBuffers {
                blocks: uploader.upload("blocks", sizes.blocks, bytemuck::cast_slice(&blocks))?,
                lists: storage("lists", sizes.lists)?,
                nodes: uploader.upload("nodes", sizes.nodes, bytemuck::cast_slice(&nodes))?,
                state: (k > 0).then(|| storage("state", sizes.state)).transpose()?,
                metric: sizes.metric.map(|bytes| storage("metric", bytes)).transpose()?,
                rows: storage("rows", sizes.rows)?,
                contributions: match sizes.contributions {
                    Some(bytes) => storage("contributions", bytes)?,
                    None => no_contributions.clone(),
                },
                vectors: storage("vectors", sizes.vectors)?,
                gather,
            });
        }
        let blocks = &levels[0].blocks;
        let result = || -> Result<_> {
            let state = storage("result", sizes.levels[0].state)?;
            Ok(Arc::new(ResultBuffers { state, blocks: blocks.clone() }))
        };
        let indirect = wgpu::BufferUsages::STORAGE | wgpu::BufferUsages::INDIRECT;
        let (triangles, corners) = (triangles(grid), corners(tiles));
        // As it is for each of the tiles alone.
        let first = tiles[0].charts.len() as u32;
        let is_wide = |level: &Level| {
            let list = level.blocks.list.iter();
            list.filter(|block| block.active && block.chart < first).count() <= WIDE_BLOCKS
        };
        let memory = Memory {
            grid: Arc::downgrade(grid),
            blocks: Arc::downgrade(&grid.triangle),
            active_blocks: grid.levels.iter().map(|level| active_blocks_of(level) as u64).collect(),
            is_wide: grid.levels.iter().map(is_wide).collect(),
            parts: parts(grid, tiles),
            triangles: uploader.upload("triangles", sizes.triangles, bytemuck::cast_slice(&triangles))?,
            corners: uploader.upload("corners", sizes.corners, bytemuck::cast_slice(&corners))?,
            features: FeatureBuffers::new(&uploader, grid)?,
            positions: storage("positions", sizes.positions)?,
            charts: storage("charts", sizes.charts)?,
            ranges: storage("ranges", sizes.ranges)?,
            partials: storage("partials", sizes.partials)?,
            dispatch_sizes: storage("sizes", sizes.dispatch_sizes)?,
            indirect_arguments: context.buffer("gates", sizes.indirect_arguments, indirect)?,
            gate_open: storage("gates", sizes.gate_open)?,
            no_contributions,
            dispatch_size_count: 0,
            bytes: sizes.total(),
            recording: RecorderResources::new(context)?,
            results: [result()?, result()?].into_iter().collect(),
            lists: Vec::new(),
            listed_charts: None,
            bind_groups: HashMap::new(),
            context: context.clone(),
            levels,
        };
        context.check()?;
        Ok(memory)
    }

    /// Uploads the features of a grid with the same blocks, if they are others.
    pub fn follow_features(&mut self, grid: &Grid) -> Result<()> {
        if !std::ptr::eq(self.features.of.as_ptr(), &*grid.features) {
            self.features = FeatureBuffers::new(&Uploader::new(&self.context), grid)?;
            // They keep the old buffers alive.
            self.bind_groups.clear();
        }
        Ok(())
    }

    /// See `Gpu::solver_bytes`.
    pub fn bytes_for(grid: &Grid, tiles: &[&TileMesh]) -> u64 {
        BufferSizes::new(grid, tiles).total()
    }

    /// Returns the buffers of a result that nothing else is using.
    pub fn free_result(&mut self) -> Result<Arc<ResultBuffers>> {
        let is_free = |result: &Arc<ResultBuffers>| Arc::strong_count(result) == 1;
        while self.results.len() > 2
            && let Some(free) = self.results.iter().rposition(is_free)
        {
            self.results.remove(free);
            // Bind groups keep the result's buffers alive.
            self.bind_groups.clear();
        }
        if let Some(free) = self.results.iter().find(|result| is_free(result)) {
            return Ok(free.clone());
        }
        let uploader = Uploader::new(&self.context);
        let (blocks, bytes) = (self.levels[0].blocks.clone(), self.results[0].state.size());
        let state = uploader.storage("result", bytes)?;
        let result = Arc::new(ResultBuffers { state, blocks });
        self.context.check()?;
        self.results.push(result.clone());
        Ok(result)
    }

    /// The last results of the tiles in the buffers of one result, each where a solve reads it; `None` if no tile has
    /// one.
    pub fn last_result(&mut self, lasts: &[Option<&Displacements>]) -> Result<Option<Arc<ResultBuffers>>> {
        let Some(first) = lasts.iter().flatten().next() else { return Ok(None) };
        let is_there = |(last, part): (&Option<&Displacements>, &Range<usize>)| {
            last.is_none_or(|last| Arc::ptr_eq(&last.buffers, &first.buffers) && last.blocks == *part)
        };
        if first.buffers.blocks == self.levels[0].blocks && lasts.iter().zip(&self.parts).all(is_there) {
            return Ok(Some(first.buffers.clone()));
        }
        let result = self.free_result()?;
        let mut encoder =
            self.context.device.create_command_encoder(&wgpu::CommandEncoderDescriptor::default());
        for (last, part) in lasts.iter().zip(&self.parts) {
            let Some(last) = last else { continue };
            let [source, target, blocks] =
                [last.blocks.start, part.start, part.len()].map(|b| b as u64 * RESULT_BLOCK);
            if blocks > 0 {
                encoder.copy_buffer_to_buffer(
                    &last.buffers.state,
                    source,
                    &result.state,
                    target,
                    Some(blocks),
                );
            }
        }
        self.context.queue.submit([encoder.finish()]);
        Ok(Some(result))
    }

    /// Builds the lists of blocks for the charts that a solve works on, unless they are the same as in the last solve.
    pub fn update_lists(&mut self, grid: &Grid, charts: &[bool]) {
        if self.listed_charts.as_deref() == Some(charts) {
            return;
        }
        self.listed_charts = None;
        self.lists.clear();
        let mut ranges: Vec<[u32; 2]> = Vec::new();
        let mut sizes = vec![charts.len() as u32; 1];
        for (k, level) in grid.levels.iter().enumerate() {
            let (lists, all) = level_lists(level, charts, &mut sizes);
            self.context.queue.write_buffer(&self.levels[k].lists, 0, bytemuck::cast_slice(&all));
            self.lists.push(lists);
            // The active blocks of a chart follow one another, also in the list.
            let mut first = 0;
            ranges.extend(level.blocks.of_chart.iter().zip(charts).map(|(blocks, &solved)| {
                let active = blocks.clone().filter(|&b| solved && level.blocks.list[b].active).count() as u32;
                let range = [if active == 0 { 0 } else { first }, active];
                first += active;
                range
            }));
        }
        self.dispatch_size_count = sizes.len() as u32;
        self.context.queue.write_buffer(&self.dispatch_sizes, 0, bytemuck::cast_slice(&sizes));
        self.context.queue.write_buffer(&self.ranges, 0, bytemuck::cast_slice(&ranges));
        self.listed_charts = Some(Vec::from(charts));
    }

    /// Creates the bind group of a kernel: `state` is the level's state, `extra` are the kernel's
    /// extra buffers.
    pub fn bind_group(
        &self,
        kernel: Kernel,
        pipeline: &Pipeline,
        level: usize,
        state: &wgpu::Buffer,
        extra: &[wgpu::Buffer],
    ) -> Bound {
        let level = &self.levels[level];
        let buffer = |number: u32| match number {
            slot::CHARTS => &self.charts,
            slot::BLOCKS => &level.blocks,
            slot::LISTS => &level.lists,
            slot::NODES => &level.nodes,
            slot::STATE => state,
            // Level 1 of the pyramid gathers from triangles.
            slot::SURFACE if kernel == Kernel::PyramidGather => &self.triangles,
            slot::SURFACE => level.metric.as_ref().unwrap_or(&self.triangles),
            slot::ROWS => &level.rows,
            slot::VECTORS => &level.vectors,
            slot::PARTIALS => &self.partials,
            0 => &self.recording.params,
            n => &extra[(n - slot::EXTRA) as usize],
        };
        let bindings = kernel.source().bindings;
        let resources = bindings.iter().map(|binding| match (binding, buffer(binding.number())) {
            (Binding::Params, buffer) => range(buffer, 0, size_of::<Params>() as u64),
            (_, buffer) => buffer.as_entire_binding(),
        });
        let group = pipeline.bind_group(&self.context.device, kernel, resources);
        let stored = bindings.iter().filter(|binding| **binding != Binding::Params);
        let uses =
            stored.map(|binding| (buffer(binding.number()).clone(), matches!(binding, Binding::Write(_))));
        Bound { group, uses: Arc::new(uses.collect()) }
    }

    /// All buffers, each of them once.
    #[cfg(test)]
    #[allow(clippy::mutable_key_type, reason = "a buffer is compared by its identity")]
    pub fn all_buffers(&self) -> std::collections::HashSet<wgpu::Buffer> {
        let levels = self.levels.iter().flat_map(|level| {
            let solver = [&level.rows, &level.vectors, &level.contributions];
            let always = [&level.blocks, &level.lists, &level.nodes].into_iter().chain(solver);
            always.chain(&level.state).chain(&level.metric).chain(level.gather.iter().flatten())
        });
        let features = self.features.levels.iter().flatten().chain([&self.features.multipliers]);
        let results = self.results.iter().map(|result| &result.state);
        let single = [
            &self.triangles,
            &self.corners,
            &self.positions,
            &self.charts,
            &self.ranges,
            &self.partials,
            &self.dispatch_sizes,
            &self.indirect_arguments,
            &self.gate_open,
            &self.recording.params,
        ];
        levels.chain(features).chain(results).chain(single).cloned().collect()
    }
}
