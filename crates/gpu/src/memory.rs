//! The memory of a solver on the GPU, of one tile or of several as one: constants, which are uploaded once per grid,
//! and the state of a solve.

use std::collections::HashMap;
use std::ops::{Deref, Range};
use std::sync::{Arc, Weak};

use super::context::{Context, padded};
use super::kernels::{Binding, Kernel, slot};
use super::layout::{
    Chart, METRIC_PLANES, PLANE, Params, ROW_PLANES, SUMS, VECTOR_PLANES, node_planes, state_planes,
};
use super::lists::{GATE_SETS, Lists, MAX_GATES, dispatch_size_bytes, level_lists, list_bytes};
use super::pipelines::{Pipeline, range};
use super::recorder::{Bound, RecorderResources};
use super::records::{block_nodes, block_records, corners, feature_words, features, triangles};
use super::results::{Displacements, RESULT_BLOCK, ResultBuffers};
use super::upload::{Counter, Maker, Uploader};
use vrtm_core::allocation::{Vec, vec};
use vrtm_core::error::Result;
use vrtm_core::grid::features::{Features, Pieces};
use vrtm_core::grid::planes::{NODES, Plane};
use vrtm_core::grid::{Grid, Level};
use vrtm_core::mesh::TileMesh;

/// One level's buffers.
#[derive(Debug)]
pub struct LevelBuffers<B = wgpu::Buffer> {
    pub blocks: B,
    pub lists: B,
    pub nodes: B,
    /// The state on coarser levels; `None` on level 0, whose state is the result that the solve writes.
    pub state: Option<B>,
    /// The metric on coarser levels; `None` on level 0.
    pub metric: Option<B>,
    pub rows: B,
    pub vectors: B,
    /// Contributions of the finer level's blocks to this level's right-hand side in a V-cycle; on coarser levels only.
    pub contributions: B,
    /// On level 1, the triangles of the dual cells (method §3): first entries per node, and the entries.
    pub gather: Option<[B; 2]>,
}

/// The painted features of a grid, and what a solve knows of them.
#[derive(Debug)]
pub struct FeatureBuffers<B = wgpu::Buffer> {
    /// Tells whether those of a grid are uploaded.
    of: Weak<Features>,
    /// Per level, the features and two sums for each of their pieces.
    pub levels: Vec<[B; 2]>,
    pub multipliers: B,
}

/// All storage buffers of a solver, or what they take.
#[derive(Debug)]
pub struct Buffers<B = wgpu::Buffer> {
    pub levels: Vec<LevelBuffers<B>>,
    pub features: FeatureBuffers<B>,
    pub triangles: B,
    pub corners: B,
    pub positions: B,
    pub charts: B,
    pub ranges: B,
    pub partials: B,
    /// The number of charts, then the lengths of all lists.
    pub dispatch_sizes: B,
    /// A record of which gates were open.
    pub gate_open: B,
    /// A placeholder bound for contributions that do not exist: from a level finer than the finest, or to one coarser
    /// than the coarsest.
    pub no_contributions: B,
    /// Two results: the last one and the next. `Memory` takes them.
    results: Vec<B>,
}

/// The memory of a solver, kept between solves.
#[derive(Debug)]
pub struct Memory {
    /// The grid whose constants are uploaded.
    pub grid: Weak<Grid>,
    /// Its planes of triangles, which identify its blocks.
    pub blocks: Weak<Vec<Plane<u32>>>,
    pub context: Arc<Context>,
    pub buffers: Buffers,
    /// Per level, the number of active blocks of all charts.
    pub active_blocks: Vec<u64>,
    /// Per level, whether four threads relax a node.
    pub is_wide: Vec<bool>,
    /// Per tile, its blocks of level 0.
    pub parts: Vec<Range<usize>>,
    /// Lists per level, for the charts in `listed_charts`.
    pub lists: Vec<Lists>,
    listed_charts: Option<Vec<bool>>,
    /// The indirect arguments that gates derive from the dispatch sizes.
    pub indirect_arguments: wgpu::Buffer,
    /// Number of dispatch sizes.
    pub dispatch_size_count: u32,
    pub recording: RecorderResources,
    /// Bytes of all these buffers.
    pub bytes: u64,
    /// The two results, and more while older ones are being read.
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

/// Bytes of the finer level's contributions to one block: 10x10 sums of two components for each quarter.
const CONTRIBUTIONS: u64 = 4 * 100 * 8;

fn bytes_of<T>(count: usize) -> u64 {
    (count * size_of::<T>()) as u64
}

impl<B: Clone> FeatureBuffers<B> {
    fn new(maker: &impl Maker<Buffer = B>, grid: &Grid) -> Result<FeatureBuffers<B>> {
        let of_level = |pieces: &Pieces| {
            let features = maker.upload("features", feature_words(pieces), || features(pieces))?;
            Ok([features, maker.storage("squares", bytes_of::<[f32; 2]>(pieces.feature.len()))?])
        };
        Ok(FeatureBuffers {
            of: Arc::downgrade(&grid.features),
            levels: grid.features.levels.iter().map(of_level).collect::<Result<_>>()?,
            multipliers: maker.storage("multipliers", bytes_of::<f32>(grid.features.count))?,
        })
    }
}

impl<B: Clone> Buffers<B> {
    /// The buffers for the grid of some tiles, with its constants. Several tiles are of one kind.
    fn new(maker: &impl Maker<Buffer = B>, grid: &Grid, tiles: &[&TileMesh]) -> Result<Buffers<B>> {
        let storage = |label: &str, bytes: u64| maker.storage(label, bytes);
        let no_contributions = storage("contributions", CONTRIBUTIONS)?;
        let finest = grid.levels[0].blocks.list.len();
        let of_level = |(k, level): (usize, &Level)| {
            let count = level.blocks.list.len();
            let planes = |n: usize| count as u64 * n as u64 * PLANE;
            let coarser = |label: &str, bytes: u64| (k > 0).then(|| storage(label, bytes)).transpose();
            let gather = || {
                let [starts, entries] = grid.gather.sizes(0..count);
                let entry = |&(t, fraction): &(u32, f32)| [t, fraction.to_bits()];
                Ok([
                    maker.upload("gather", starts, || grid.gather.of_blocks(0..count).0)?,
                    maker.upload("gather", entries, || {
                        grid.gather.of_blocks(0..count).1.iter().map(entry).collect()
                    })?,
                ])
            };
            Ok(LevelBuffers {
                blocks: maker.upload("blocks", count, || block_records(grid, k, 0..count))?,
                lists: storage("lists", list_bytes(count as u64))?,
                nodes: maker.upload("nodes", count * node_planes(grid) * NODES, || {
                    block_nodes(grid, level, k, 0..count)
                })?,
                state: coarser("state", planes(state_planes(k)))?,
                metric: coarser("metric", planes(METRIC_PLANES))?,
                rows: storage("rows", planes(ROW_PLANES))?,
                vectors: storage("vectors", planes(VECTOR_PLANES))?,
                contributions: coarser("contributions", count as u64 * CONTRIBUTIONS)?
                    .unwrap_or_else(|| no_contributions.clone()),
                gather: (k == 1).then(gather).transpose()?,
            })
        };
        let levels = grid.levels.iter().enumerate().map(of_level).collect::<Result<_>>()?;
        let vertices = tiles.iter().flat_map(|tile| &tile.charts).map(|chart| chart.count()).sum();
        let (charts, triangle_count) = (grid.movable.len(), grid.triangles.len());
        let result = || storage("result", finest as u64 * RESULT_BLOCK);
        Ok(Buffers {
            levels,
            features: FeatureBuffers::new(maker, grid)?,
            triangles: maker.upload("triangles", triangle_count, || triangles(grid))?,
            corners: maker.upload("corners", 3 * triangle_count, || corners(tiles))?,
            positions: storage("positions", bytes_of::<[f32; 3]>(vertices))?,
            charts: storage("charts", bytes_of::<Chart>(charts))?,
            ranges: storage("ranges", bytes_of::<[u32; 2]>(charts * grid.levels.len()))?,
            partials: storage("partials", bytes_of::<[f32; SUMS as usize]>(finest))?,
            dispatch_sizes: storage("sizes", dispatch_size_bytes(grid.levels.len()))?,
            gate_open: storage("gates", bytes_of::<u32>(MAX_GATES as usize))?,
            no_contributions,
            results: Vec::of([result()?, result()?]),
        })
    }
}

/// Bytes of the indirect arguments of all gates.
fn indirect_bytes(grid: &Grid) -> u64 {
    GATE_SETS as u64 * 4 * dispatch_size_bytes(grid.levels.len())
}

impl Deref for Memory {
    type Target = Buffers;

    fn deref(&self) -> &Buffers {
        &self.buffers
    }
}

impl Memory {
    /// Allocates the memory for the grid of some tiles, and uploads its constants.
    pub fn new(context: &Arc<Context>, grid: &Arc<Grid>, tiles: &[&TileMesh]) -> Result<Memory> {
        let mut buffers = Buffers::new(&Uploader::new(context), grid, tiles)?;
        let blocks = buffers.levels[0].blocks.clone();
        let result = |state| Arc::new(ResultBuffers { state, blocks: blocks.clone() });
        let results = buffers.results.drain(..).map(result).collect();
        let indirect = wgpu::BufferUsages::STORAGE | wgpu::BufferUsages::INDIRECT;
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
            indirect_arguments: context.buffer("gates", indirect_bytes(grid), indirect)?,
            dispatch_size_count: 0,
            bytes: Memory::bytes_for(grid, tiles),
            recording: RecorderResources::new(context)?,
            results,
            lists: Vec::new(),
            listed_charts: None,
            bind_groups: HashMap::new(),
            context: context.clone(),
            buffers,
        };
        context.check()?;
        Ok(memory)
    }

    /// See `Gpu::solver_bytes`.
    pub fn bytes_for(grid: &Grid, tiles: &[&TileMesh]) -> u64 {
        let counter = Counter::default();
        // Counting cannot fail.
        let _ = Buffers::new(&counter, grid, tiles);
        counter.0.get() + padded(indirect_bytes(grid)) + RecorderResources::BYTES
    }

    /// Uploads the features of a grid with the same blocks, if they are others.
    pub fn follow_features(&mut self, grid: &Grid) -> Result<()> {
        if !std::ptr::eq(self.features.of.as_ptr(), &*grid.features) {
            self.buffers.features = FeatureBuffers::new(&Uploader::new(&self.context), grid)?;
            // They keep the old buffers alive.
            self.bind_groups.clear();
        }
        Ok(())
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
        let group = pipeline.bind_group(&self.context.device, kernel.source(), resources);
        let stored = bindings.iter().filter(|binding| **binding != Binding::Params);
        let uses =
            stored.map(|binding| (buffer(binding.number()).clone(), matches!(binding, Binding::Write(_))));
        Bound { group, uses: Arc::new(uses.collect()) }
    }
}
