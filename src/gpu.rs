//! The GPU backend: the CPU's stages, twin by name, as compute shaders on wgpu.

pub(crate) mod adapters;
mod bands;
pub(crate) mod context;
mod correct;
mod kernels;
mod layout;
mod memory;
mod recorder;
mod results;
mod stages;
mod transfer;

use std::sync::Arc;

use crate::error::Result;
use crate::report::StageTimes;
use crate::solve::{ChartResult, Input};
use crate::tile::Grid;
use context::Context;
use kernels::Kernel;
use layout::{Chart, METRIC_PLANES, Params, ROW_PLANES, STATE_PLANES, VECTOR_PLANES};
pub(crate) use memory::Memory;
use memory::PLANE;
use recorder::Recorder;
use results::RESULT_BLOCK;
pub(crate) use results::{Displacements, ResultBuffers};
use stages::{Charts, Decision};

/// One solve of one tile.
pub(crate) struct Run<'a> {
    context: Arc<Context>,
    grid: &'a Grid,
    memory: &'a mut Memory,
    recorder: Recorder,
    /// The charts to solve.
    charts: &'a [bool],
    /// The settings' weights; every dispatch starts from these.
    params: Params,
    last: Option<Arc<ResultBuffers>>,
    result: Arc<ResultBuffers>,
    node_updates: u64,
    /// Bytes that the dispatches move at least.
    bytes_moved: u64,
}

/// What a solve gives when all of it has run.
#[derive(Debug)]
pub(crate) struct Finished {
    /// Per chart; of those that were solved.
    pub outcome: Vec<ChartResult>,
    pub result: Arc<ResultBuffers>,
    /// Measured on the GPU; `None` if it has no timestamps.
    pub times: Option<StageTimes>,
    pub node_updates: u64,
    pub work: Work,
}

/// What a solve had the GPU do.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(crate) struct Work {
    pub dispatches: u64,
    pub submissions: u64,
    /// Bytes that the dispatches move at least, each datum counted once per dispatch.
    pub bytes: u64,
}

/// Which of a band's buffers its neighbours have copies of.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Shared {
    State,
    Metric,
    Rows,
    Vectors,
    Result,
}

impl<'a> Run<'a> {
    /// `last` is the tile's last result on the same grid; charts in `keep` keep it, other charts that are not solved
    /// become the identity.
    pub fn new(
        input: &Input<'a>,
        memory: &'a mut Memory,
        last: Option<Arc<ResultBuffers>>,
        keep: &[bool],
    ) -> Result<Run<'a>> {
        let Input { grid, pose, settings, charts, .. } = *input;
        let context = memory.context.clone();
        memory.list(grid, charts);
        let positions: Vec<f32> =
            pose.charts.iter().flat_map(|chart| chart.positions.as_flattened()).copied().collect();
        context.queue.write_buffer(&memory.positions, 0, bytemuck::cast_slice(&positions));
        let records: Vec<Chart> = charts
            .iter()
            .zip(&grid.levels[0].floor)
            .map(|(&solve, &floor)| Chart { solve: u32::from(solve), floor, ..Chart::default() })
            .collect();
        context.queue.write_buffer(&memory.charts, 0, bytemuck::cast_slice(&records));
        let params = Params {
            smoothness: settings.smoothness,
            smoothness_floor: settings.smoothness_floor,
            orientation: settings.orientation,
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
            params,
            last,
            result,
            node_updates: 0,
            bytes_moved: 0,
        };
        run.begin(keep);
        Ok(run)
    }

    /// The result of charts that are not solved.
    fn begin(&mut self, keep: &[bool]) {
        let last = self.last.clone();
        for n in 0..self.result.bands.len() {
            let (band, to) = &self.result.bands[n];
            let at = |b: usize| (b - band.held.start) as u64 * RESULT_BLOCK;
            self.recorder.clear(to, 0, at(band.held.end));
            let Some(last) = &last else { continue };
            for (c, blocks) in
                self.grid.levels[0].blocks.of_chart.iter().enumerate().filter(|(c, _)| keep[*c])
            {
                let (first, end) = (blocks.start.max(band.held.start), blocks.end.min(band.held.end));
                if first < end && !self.charts[c] {
                    self.recorder.copy(&last.bands[n].1, at(first), to, at(first), at(end) - at(first));
                }
            }
        }
    }

    /// Waits for all of it, and reads what it came to.
    pub fn finish(mut self) -> Result<Finished> {
        let (times, bytes) = self.recorder.finish();
        let charts = self.memory.charts.clone();
        let size = (self.charts.len() * size_of::<Chart>()) as u64;
        let parts = self.context.read_all(&[(&charts, 0..size), (&times, 0..bytes)])?;
        let outcome = parts[0]
            .chunks_exact(size_of::<Chart>())
            .map(|bytes| outcome(&bytemuck::pod_read_unaligned(bytes)));
        Ok(Finished {
            outcome: outcome.collect(),
            result: self.result.clone(),
            times: self.recorder.times(&parts[1]).map(
                |[surface, pyramid, prolong, relax, correct, certify, _]| StageTimes {
                    surface,
                    pyramid,
                    prolong,
                    relax,
                    correct,
                    certify,
                    ..StageTimes::default()
                },
            ),
            node_updates: self.node_updates,
            work: Work {
                dispatches: self.recorder.dispatches,
                submissions: self.recorder.submissions,
                bytes: self.bytes_moved,
            },
        })
    }

    /// Blocks with movable nodes on the finest level.
    pub fn blocks_active(&self) -> u64 {
        self.memory.lists[0].iter().map(|lists| u64::from(lists.active.1)).sum()
    }

    fn at_level(&self, level: usize) -> Params {
        Params { scale: (1u32 << level) as f32, ..self.params }
    }

    fn select(&mut self, charts: Charts) {
        let params = Params { mode: charts as u32, ..self.params };
        self.dispatch(Kernel::SelectCharts, [0, 0], &[], &params, params.items.div_ceil(layout::THREADS));
    }

    /// Records one dispatch on the buffers of a band (level, index).
    fn dispatch(
        &mut self,
        kernel: Kernel,
        at: [usize; 2],
        own: &[wgpu::Buffer],
        params: &Params,
        workgroups: u32,
    ) {
        if workgroups == 0 {
            return;
        }
        let pipeline = self.context.pipelines.get(&self.context, kernel);
        let key = (kernel, at, own.to_vec());
        let group = match self.memory.groups.get(&key) {
            Some(group) => group.clone(),
            None => {
                let group = self.memory.group(kernel, &pipeline.layout, at, own);
                self.memory.groups.insert(key, group.clone());
                group
            }
        };
        self.recorder.dispatch(&pipeline.pipeline, &group, params, workgroups);
    }

    /// Runs a kernel on a list of a band's blocks.
    fn run_list(
        &mut self,
        kernel: Kernel,
        at: [usize; 2],
        own: &[wgpu::Buffer],
        (first, count): (u32, u32),
        params: Params,
    ) {
        self.bytes_moved += u64::from(kernel.source().bytes_per_node) * u64::from(count) * 256;
        self.dispatch(kernel, at, own, &Params { first, count, ..params }, count);
    }

    /// Runs a kernel on all active blocks of a level; then the copies of what it wrote are renewed.
    fn each_active(&mut self, kernel: Kernel, level: usize, params: Params, written: Option<Shared>) {
        for band in 0..self.memory.bands[level].len() {
            let active = self.memory.lists[level][band].active;
            self.run_list(kernel, [level, band], &[], active, params);
        }
        if let Some(written) = written {
            self.exchange(level, written);
        }
    }

    /// The same, block colour by block colour.
    fn each_colour(
        &mut self,
        kernel: Kernel,
        level: usize,
        backwards: bool,
        params: Params,
        written: Shared,
    ) {
        for k in 0..4 {
            for band in 0..self.memory.bands[level].len() {
                let list = self.memory.lists[level][band].colours[if backwards { 3 - k } else { k }];
                self.run_list(kernel, [level, band], &[], list, params);
            }
            self.exchange(level, written);
        }
    }

    /// Runs a kernel that gives a sum per active block, adds them up chart by chart, and decides.
    fn reduce(&mut self, kernel: Kernel, level: usize, params: Params, decision: Decision) {
        for band in 0..self.memory.bands[level].len() {
            let (active, partial) =
                (self.memory.lists[level][band].active, self.memory.lists[level][band].partial);
            self.run_list(kernel, [level, band], &[], active, Params { partial, ..params });
        }
        let params = Params { mode: decision as u32, level: level as u32, ..params };
        let own = [self.memory.ranges.clone()];
        self.dispatch(Kernel::Decide, [0, 0], &own, &params, params.items);
    }

    /// Renews the copies that bands have of each other's blocks.
    fn exchange(&mut self, level: usize, what: Shared) {
        let bands = &self.memory.bands[level];
        if bands.len() == 1 {
            return;
        }
        let buffer = |band: usize| {
            let buffers = &self.memory.buffers[level][band];
            match what {
                Shared::State => Some((&buffers.state, STATE_PLANES)),
                Shared::Metric => buffers.metric.as_ref().map(|metric| (metric, METRIC_PLANES)),
                Shared::Rows => Some((&buffers.rows, ROW_PLANES)),
                Shared::Vectors => Some((&buffers.vectors, VECTOR_PLANES)),
                Shared::Result => Some((&self.result.bands[band].1, layout::RESULT_PLANES)),
            }
        };
        for (a, source) in bands.iter().enumerate() {
            for (b, target) in bands.iter().enumerate().filter(|&(b, _)| b != a) {
                let (first, end) =
                    (source.own.start.max(target.held.start), source.own.end.min(target.held.end));
                if let (true, Some((from, planes)), Some((to, _))) = (first < end, buffer(a), buffer(b)) {
                    let at = |b: usize, start: usize| (b - start) as u64 * planes as u64 * PLANE;
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

fn outcome(chart: &Chart) -> ChartResult {
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
