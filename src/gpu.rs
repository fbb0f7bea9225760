//! The GPU backend: the stages of `cpu`, under the same names, as compute shaders on wgpu.

pub(crate) mod adapters;
mod bands;
mod clock;
mod constants;
pub(crate) mod context;
mod correct;
pub(crate) mod external;
mod generated;
mod identity;
mod inspect;
mod invert;
mod kernels;
pub(crate) mod layout;
mod lists;
mod memory;
mod pbd;
mod recorder;
mod results;
mod sizes;
mod stages;
mod transfer;
mod upload;

use std::sync::Arc;
use std::time::Instant;

use crate::control::Control;
use crate::error::{Error, Result};
use crate::memory::{Collect, copied, make_room_in};
use crate::method::schedule::{ChartResult, Input};
use crate::tile::Grid;
use crate::tile::blocks::NODES;
use context::Context;
pub(crate) use invert::Output;
use kernels::Kernel;
use layout::{Chart, METRIC_PLANES, Params, ROW_PLANES, VECTOR_PLANES, node_planes, state_planes};
use lists::{List, MAX_GATES};
pub(crate) use memory::Memory;
use memory::PLANE;
pub(crate) use recorder::Statistics;
use recorder::{DispatchSize, Recorder};
use results::RESULT_BLOCK;
pub(crate) use results::{Displacements, ResultBuffers};
use sizes::CONTRIBUTIONS;

/// One solve of one tile.
pub(crate) struct Run<'a> {
    context: Arc<Context>,
    grid: &'a Grid,
    memory: &'a mut Memory,
    recorder: Recorder,
    /// Per chart, whether it is solved.
    charts: &'a [bool],
    /// λ_k of each level.
    smoothness: Vec<f32>,
    /// The weights from the settings; the parameters of every dispatch are derived from these.
    params: Params,
    /// Weight of the pull towards the last result, on level 0.
    pull: f32,
    last_result: Option<Arc<ResultBuffers>>,
    result: Arc<ResultBuffers>,
    node_updates: u64,
    gate: Option<Gate>,
    /// Number of gates so far in this solve.
    gates: u32,
    /// True while the present state of the paper's solver is the copy in the vectors.
    state_in_vectors: bool,
    /// Nodes that an iteration of the paper's solver updates on the present level.
    nodes_of_level: u64,
    upload_ms: f32,
    /// When recording began.
    recording: Instant,
    /// Whether the result is the identity for want of time.
    gave_up: bool,
    /// Whether no chart takes part in further corrections of the present level.
    settled: bool,
    /// Whether the blocks' energies on level 0 are those that its last accepted trials summed.
    energy_is_known: bool,
    /// Of the call, which may be cancelled while the GPU is waited for.
    control: Option<Arc<Control>>,
    /// The first error. Stages record no dispatches after it, and `finish` returns it.
    error: Option<Error>,
}

/// The condition under which dispatches run: that a chart was at work when the kernel `gate` ran.
#[derive(Clone, Copy, Debug)]
struct Gate {
    set: GateSet,
    /// Number of the gate in the solve.
    number: u32,
}

/// Gates that are in use at the same time; each has indirect arguments of its own.
#[derive(Clone, Copy, Debug)]
enum GateSet {
    StepLimit,
    Trial,
}

/// The outcome of a solve.
#[derive(Debug)]
pub(crate) struct Solution {
    /// Per chart; meaningful for charts that were solved.
    pub charts: Vec<ChartResult>,
    pub result: Arc<ResultBuffers>,
    pub node_updates: u64,
    pub statistics: Statistics,
}

/// The buffers of a band of which its neighbour bands hold copies of blocks.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum BandBuffer {
    State,
    Metric,
    Rows,
    Vectors,
    Contributions,
}

impl<'a> Run<'a> {
    /// Begins a solve. `last_result` is the tile's last result on the same grid; charts in `keep` keep it, and other
    /// charts that are not solved become the identity.
    pub fn new(
        input: &Input<'a>,
        memory: &'a mut Memory,
        last_result: Option<Arc<ResultBuffers>>,
        keep: &[bool],
        control: Option<&Arc<Control>>,
    ) -> Result<Run<'a>> {
        let start = Instant::now();
        let Input { grid, pose, settings, charts, .. } = *input;
        let context = memory.context.clone();
        memory.update_lists(grid, charts);
        let positions: Vec<f32> =
            pose.charts.iter().flat_map(|chart| chart.positions.as_flattened()).copied().collected();
        context.queue.write_buffer(&memory.positions, 0, bytemuck::cast_slice(&positions));
        let records: Vec<Chart> = charts
            .iter()
            .zip(&grid.levels[0].floor)
            .map(|(&solve, &floor)| Chart {
                solved: u32::from(solve),
                length_floor: floor,
                ..Chart::default()
            })
            .collected();
        context.queue.write_buffer(&memory.charts, 0, bytemuck::cast_slice(&records));
        let params = Params {
            smoothness_floor: settings.smoothness_floor,
            orientation: settings.orientation,
            // A grid without density counts as one with a density of 0.
            orientation_density: match grid.levels[0].density.is_empty() {
                true => 0.0,
                false => settings.orientation_density,
            },
            node_planes: node_planes(grid) as u32,
            room: settings.room,
            room_threshold: settings.room_threshold,
            items: charts.len() as u32,
            ..Params::default()
        };
        let result = memory.free_result()?;
        let recorder = Recorder::new(context.clone(), memory.recording.clone());
        let mut run = Run {
            context,
            grid,
            memory,
            recorder,
            charts,
            smoothness: (0..grid.levels.len()).map(|level| input.smoothness(level)).collected(),
            params,
            pull: input.pull,
            last_result,
            result,
            node_updates: 0,
            gate: None,
            gates: 0,
            state_in_vectors: false,
            nodes_of_level: 0,
            upload_ms: 0.0,
            recording: start,
            gave_up: false,
            settled: false,
            energy_is_known: false,
            control: control.cloned(),
            error: None,
        };
        run.start_result(keep);
        run.upload_ms = milliseconds(start);
        run.recording = Instant::now();
        Ok(run)
    }

    /// Writes the result of charts that are not solved: the last one for those in `keep`, the identity for the others. In
    /// charts that are solved, each active block will be written, and the other blocks are never anything but 0.
    fn start_result(&mut self, keep: &[bool]) {
        let kept = |c: usize| keep[c] && self.last_result.is_some();
        let others: Vec<bool> =
            self.charts.iter().enumerate().map(|(c, &solve)| !solve && !kept(c)).collected();
        self.clear(&others);
        let Some(last_result) = self.last_result.clone() else { return };
        for (n, (_, from)) in last_result.bands.iter().enumerate() {
            let ranges = self.ranges_of(n, |c| keep[c] && !self.charts[c]);
            let to = &self.result.bands[n].1;
            ranges.iter().for_each(|&[at, bytes]| self.recorder.copy(from, at, to, at, bytes));
        }
    }

    /// Makes the result of these charts the identity.
    fn clear(&mut self, charts: &[bool]) {
        for n in 0..self.result.bands.len() {
            let ranges = self.ranges_of(n, |c| charts[c]);
            let to = &self.result.bands[n].1;
            ranges.iter().for_each(|&[at, bytes]| self.recorder.clear(to, at, bytes));
        }
    }

    /// Offsets and lengths in bytes of the blocks of some charts in a band of the result.
    fn ranges_of(&self, band: usize, of: impl Fn(usize) -> bool) -> Vec<[u64; 2]> {
        let held = &self.result.bands[band].0.held;
        let charts = self.grid.levels[0].blocks.of_chart.iter().enumerate().filter(|(c, _)| of(*c));
        let range = |blocks: &std::ops::Range<usize>| {
            let (first, end) = (blocks.start.max(held.start), blocks.end.min(held.end));
            (first < end).then(|| [first - held.start, end - first].map(|n| n as u64 * RESULT_BLOCK))
        };
        charts.filter_map(|(_, blocks)| range(blocks)).collected()
    }

    /// Submits the rest, waits for the GPU, and reads the outcome. With a control that is cancelled, it stops waiting: what
    /// was submitted is done before anything that is submitted later.
    pub fn finish(mut self) -> Result<Solution> {
        if let Some(error) = self.error {
            return Err(error);
        }
        let charts = self.memory.charts.clone();
        let size = (self.charts.len() * size_of::<Chart>()) as u64;
        let gate_open = self.memory.gate_open.clone();
        let gates = u64::from(self.gates.min(MAX_GATES)) * 4;
        let readback = self.recorder.read(&[(&charts, 0..size), (&gate_open, 0..gates)], true)?;
        let record_ms = milliseconds(self.recording);
        let waiting = Instant::now();
        if let Some(control) = &self.control {
            self.context.wait_for(control)?;
        }
        let parts = self.context.taken(&readback)?;
        let wait_ms = milliseconds(waiting);
        let gates: Vec<u32> = parts[1].chunks_exact(4).map(bytemuck::pod_read_unaligned).collected();
        let times: Vec<u8> = parts[2..].iter().flatten().copied().collected();
        let (statistics, recording) = self.recorder.close(&gates, &times);
        self.memory.recording = recording;
        let records = parts[0].chunks_exact(size_of::<Chart>());
        let identity = ChartResult { min_jacobian: 1.0, fallback: true, ..ChartResult::default() };
        let read = |bytes: &[u8]| match self.gave_up {
            true => identity,
            false => chart_result(&bytemuck::pod_read_unaligned(bytes)),
        };
        Ok(Solution {
            charts: records.map(read).collected(),
            result: self.result,
            node_updates: self.node_updates,
            statistics: Statistics {
                upload_ms: self.upload_ms,
                record_ms,
                wait_ms,
                bytes_held: self.memory.bytes,
                ..statistics
            },
        })
    }

    /// Number of active blocks of the solved charts on level 0.
    pub fn blocks_active(&self) -> u64 {
        self.memory.lists[0].iter().map(|lists| u64::from(lists.active.count)).sum()
    }

    fn at_level(&self, level: usize) -> Params {
        Params { scale: (1u32 << level) as f32, smoothness: self.smoothness[level], ..self.params }
    }

    /// The parameters of kernels that pull level 0 towards the previous result.
    fn with_pull(&self, level: usize) -> Params {
        Params { pull: if level == 0 { self.pull } else { 0.0 }, ..self.at_level(level) }
    }

    /// The extra buffer of kernels that may pull: the previous result. Without one, and on coarser levels, it is not read.
    fn anchor(&self, level: usize, band: usize) -> wgpu::Buffer {
        match &self.last_result {
            Some(result) if level == 0 => result.bands[band].1.clone(),
            _ => self.memory.no_contributions.clone(),
        }
    }

    /// The state of a band: on level 0 the result that this solve makes.
    fn state_buffer(&self, level: usize, band: usize) -> &wgpu::Buffer {
        self.memory.buffers[level][band].state.as_ref().unwrap_or_else(|| &self.result.bands[band].1)
    }

    /// Chooses the charts that the following kernels work on; `mode` is one of `SELECT_`.
    fn select(&mut self, mode: u32) {
        let params = Params { mode, ..self.params };
        let size = DispatchSize::ungated(params.items.div_ceil(layout::THREADS));
        self.dispatch(Kernel::SelectCharts, [0, 0], &[], &params, size, 0);
    }

    /// The size of a dispatch: under a gate it becomes 0 if the gate is closed. `size_index` is its index among the
    /// dispatch sizes.
    fn dispatch_size(&self, size_index: u32, workgroups: u32) -> DispatchSize {
        let gate = self.gate.map(|gate| {
            let arguments = gate.set as u32 * self.memory.dispatch_size_count + size_index;
            (self.memory.indirect_arguments.clone(), u64::from(arguments) * 16, gate.number)
        });
        DispatchSize { workgroups, gate }
    }

    /// Records a gate: dispatches that follow run only if a chart is at work at this point that at least `limited`
    /// dispatches of the step limit found limited, until `self.gate` is reset.
    fn open_gate(&mut self, set: GateSet, limited: u32) {
        let count = self.memory.dispatch_size_count;
        let number = self.gates.min(MAX_GATES - 1);
        self.gates += 1;
        self.gate = None;
        let first = set as u32 * count;
        let params = Params { first, count, partial: number, mode: limited, ..self.params };
        let extra = [
            self.memory.dispatch_sizes.clone(),
            self.memory.indirect_arguments.clone(),
            self.memory.gate_open.clone(),
        ];
        self.dispatch(Kernel::Gate, [0, 0], &extra, &params, DispatchSize::ungated(1), 0);
        self.gate = Some(Gate { set, number });
    }

    /// Records one dispatch on the buffers of band `at` (level, index) and the kernel's extra buffers. `bytes` is the
    /// least number of bytes that it moves.
    fn dispatch(
        &mut self,
        kernel: Kernel,
        at: [usize; 2],
        extra: &[wgpu::Buffer],
        params: &Params,
        size: DispatchSize,
        bytes: u64,
    ) {
        if size.workgroups == 0 {
            return;
        }
        if self.error.is_some() {
            return;
        }
        let context = self.context.clone();
        let pipeline = match context.pipelines.get(&context, kernel) {
            Ok(pipeline) => pipeline,
            Err(error) => {
                self.error = Some(error);
                return;
            }
        };
        let key = (kernel, at, self.state_buffer(at[0], at[1]).clone(), copied(extra));
        let bind_group = match self.memory.bind_groups.get(&key) {
            Some(bind_group) => bind_group.clone(),
            None => {
                let bind_group = self.memory.bind_group(kernel, &pipeline.layout, at, &key.2, extra);
                make_room_in(&mut self.memory.bind_groups, 1);
                #[expect(clippy::disallowed_methods, reason = "there is room")]
                self.memory.bind_groups.insert(key, bind_group.clone());
                bind_group
            }
        };
        self.recorder.dispatch(kernel, &pipeline.pipeline, &bind_group, params, size, bytes);
    }

    /// Dispatches a kernel over a list of a band's blocks.
    fn dispatch_list(
        &mut self,
        kernel: Kernel,
        at: [usize; 2],
        extra: &[wgpu::Buffer],
        list: List,
        params: Params,
    ) {
        let base = self.memory.buffers[at[0]][at[1]].base.unwrap_or(0);
        let List { first, count, size_index } = list;
        let bytes = u64::from(kernel.source().bytes_per_node) * u64::from(count) * NODES as u64
            + self.triangle_bytes(kernel, at[0], count);
        let size = self.dispatch_size(size_index, count);
        let state_planes = state_planes(at[0]) as u32;
        let params = Params { first, count, base, state_planes, ..params };
        self.dispatch(kernel, at, extra, &params, size, bytes);
    }

    /// Bytes of triangles that a dispatch over `count` blocks of a level reads: those of the same share of the
    /// triangles as the blocks are of the level's active blocks.
    fn triangle_bytes(&self, kernel: Kernel, level: usize, count: u32) -> u64 {
        let active = self.memory.active_blocks[level].max(1);
        let triangles = self.grid.triangles.len() as u64 * u64::from(count).min(active) / active;
        u64::from(kernel.bytes_per_triangle()) * triangles
    }

    /// Dispatches a kernel over all active blocks of a level, then updates the copies of the buffer that it wrote.
    fn dispatch_active(&mut self, kernel: Kernel, level: usize, params: Params, written: Option<BandBuffer>) {
        for band in 0..self.memory.bands[level].len() {
            let active = self.memory.lists[level][band].active;
            self.dispatch_list(kernel, [level, band], &[], active, params);
        }
        if let Some(written) = written {
            self.exchange(level, written);
        }
    }

    /// Calls `f` with each band's list of blocks of each block colour in turn, and updates the copies after each
    /// colour.
    fn each_colour(
        &mut self,
        level: usize,
        backwards: bool,
        written: BandBuffer,
        f: impl Fn(&mut Run, usize, List),
    ) {
        for k in 0..4 {
            for band in 0..self.memory.bands[level].len() {
                let list = self.memory.lists[level][band].colours[if backwards { 3 - k } else { k }];
                f(self, band, list);
            }
            self.exchange(level, written);
        }
    }

    /// Dispatches a kernel that writes partial sums per active block.
    fn sums(&mut self, kernel: Kernel, level: usize, params: Params) {
        for band in 0..self.memory.bands[level].len() {
            let (active, partial) =
                (self.memory.lists[level][band].active, self.memory.lists[level][band].partial);
            let params = Params { partial, ..params };
            if matches!(kernel, Kernel::EnergyChords | Kernel::EnergyMetrics) {
                let extra = [self.anchor(level, band)];
                self.dispatch_list(kernel, [level, band], &extra, active, params);
            } else {
                self.dispatch_list(kernel, [level, band], &[], active, params);
            }
        }
    }

    /// Dispatches a kernel that writes partial sums per active block, then `decide`, which adds them chart by chart and
    /// takes the decision `decision`, one of `DECIDE_`.
    fn reduce(&mut self, kernel: Kernel, level: usize, params: Params, decision: u32) {
        self.sums(kernel, level, params);
        self.decide(level, params, decision);
    }

    /// Dispatches `decide`: takes the decision `decision` from the sums of a level's blocks, chart by chart.
    fn decide(&mut self, level: usize, params: Params, decision: u32) {
        let params = Params { mode: decision, level: level as u32, ..params };
        let extra = [self.memory.ranges.clone()];
        let size = self.dispatch_size(0, params.items);
        self.dispatch(Kernel::Decide, [0, 0], &extra, &params, size, 0);
    }

    /// Updates the copies that the bands of a level hold of one another's blocks.
    fn exchange(&mut self, level: usize, what: BandBuffer) {
        let Some(bands) = self.memory.bands.get(level) else { return };
        if bands.len() == 1 {
            return;
        }
        let buffer = |band: usize| {
            let buffers = &self.memory.buffers[level][band];
            let (buffer, planes) = match what {
                BandBuffer::State => (self.state_buffer(level, band), state_planes(level)),
                BandBuffer::Metric => (buffers.metric.as_ref()?, METRIC_PLANES),
                BandBuffer::Rows => (&buffers.rows, ROW_PLANES),
                BandBuffer::Vectors => (&buffers.vectors, VECTOR_PLANES),
                BandBuffer::Contributions => (&buffers.contributions, 1),
            };
            Some((buffer.clone(), planes))
        };
        let buffers: Vec<_> = (0..bands.len()).map(buffer).collected();
        for (a, source) in bands.iter().enumerate() {
            for (b, target) in bands.iter().enumerate().filter(|&(b, _)| b != a) {
                let (first, end) =
                    (source.owned.start.max(target.held.start), source.owned.end.min(target.held.end));
                if let (true, Some((from, planes)), Some((to, _))) = (first < end, &buffers[a], &buffers[b]) {
                    let block = match what {
                        BandBuffer::Contributions => CONTRIBUTIONS,
                        _ => *planes as u64 * PLANE,
                    };
                    let at = |b: usize, start: usize| (b - start) as u64 * block;
                    let bytes = at(end, first);
                    self.recorder.copy(
                        from,
                        at(first, source.held.start),
                        to,
                        at(first, target.held.start),
                        bytes,
                    );
                }
            }
        }
    }
}

fn milliseconds(since: Instant) -> f32 {
    since.elapsed().as_secs_f32() * 1000.0
}

fn chart_result(chart: &Chart) -> ChartResult {
    let fallback = chart.fallback != 0;
    ChartResult {
        energy_before: f64::from(chart.identity),
        energy: f64::from(if fallback { chart.identity } else { chart.energy }),
        min_jacobian: if fallback { 1.0 } else { f64::from(chart.min_jacobian) },
        folds: if fallback { 0 } else { u64::from(chart.folds) },
        max_displacement: if fallback { 0.0 } else { chart.max_displacement },
        fallback,
    }
}
