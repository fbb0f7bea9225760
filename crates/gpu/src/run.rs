//! One solve of one tile on the GPU, from its start to the reading of its results.

use std::sync::Arc;

use super::context::Context;
use super::layout::{Chart, Params, node_planes};
use super::lists::{Gate, MAX_GATES};
use super::memory::Memory;
use super::recorder::Recorder;
use super::results::{Displacements, RESULT_BLOCK, ResultBuffers};
use vrtm_core::allocation::{Vec, boxed};
use vrtm_core::backend::{TileSolution, TileSolve, TileSolver, Warp};
use vrtm_core::clock::Instant;
use vrtm_core::control::Control;
use vrtm_core::error::{Error, Result};
use vrtm_core::grid::Grid;
use vrtm_core::grid::features::LEVELS;
use vrtm_core::method::law::{HOLD, MULTIPLIER_STEPS};
use vrtm_core::method::plan::{ChartResult, Input, Purpose, Summary};
use vrtm_core::unwind::caught;

/// One solve of one tile.
pub struct Run<'a> {
    pub(super) context: Arc<Context>,
    pub(super) grid: &'a Arc<Grid>,
    pub(super) memory: &'a mut Memory,
    pub(super) recorder: Recorder,
    /// Per chart, whether it is solved.
    pub(super) charts: &'a [bool],
    /// λ_k of each level.
    pub(super) smoothness: Vec<f32>,
    /// The weights from the settings; the parameters of every dispatch are derived from these.
    pub(super) params: Params,
    /// H of method §4, Harm, and whether the solve has weighed a level.
    pub(super) harm: f32,
    pub(super) weighed: [bool; LEVELS],
    /// True if the multipliers are those that the solve starts from, or its own.
    pub(super) has_multipliers: bool,
    /// Weight of the pull towards the last result, on level 0.
    pub(super) pull: f32,
    pub(super) last_result: Option<Arc<ResultBuffers>>,
    pub(super) result: Arc<ResultBuffers>,
    pub(super) node_updates: u64,
    pub(super) gate: Option<Gate>,
    /// Number of gates so far in this solve.
    pub(super) gates: u32,
    /// True while the present state of the paper's solver is the copy in the memory of the vectors.
    pub(super) state_in_vectors: bool,
    /// Nodes that an iteration of the paper's solver updates on the present level.
    pub(super) nodes_of_level: u64,
    upload_ms: f32,
    /// The time when recording began.
    recording: Instant,
    /// True if no chart takes part in further corrections of the present level.
    pub(super) settled: bool,
    /// The active blocks on level 0 of the charts that take part in the present correction, and of all charts that are
    /// solved; equal unless some charts are known to take no part.
    pub(super) share: [u64; 2],
    /// True if the records of the charts hold the energies of the present state.
    pub(super) energy_is_known: bool,
    /// The control of the call, by which it may be cancelled while it waits for the GPU.
    pub(super) control: Option<Arc<Control>>,
    /// The first error. After it, stages record no dispatches, and `finish` returns it.
    pub(super) error: Option<Error>,
}

impl TileSolver for Memory {
    fn is_for(&self, grid: &Arc<Grid>, _: Purpose) -> bool {
        self.blocks.upgrade().is_some_and(|own| Arc::ptr_eq(&own, &grid.triangle))
    }

    fn run(&mut self, solve: &mut TileSolve) -> Result<TileSolution> {
        let lasts =
            solve.lasts.iter().map(|last| last.and_then(Warp::on_gpu).map(Displacements::of).transpose());
        let lasts: Vec<Option<&Displacements>> = lasts.collect::<Result<_>>()?;
        let stays = |(&keep, &solved): (&bool, &bool)| keep && !solved;
        let is_read = solve.plan.warm || solve.keep.iter().zip(solve.input.charts).any(stays);
        let context = self.context.clone();
        let run = || {
            let last = if is_read { self.last_result(&lasts)? } else { None };
            let mut run = Run::new(&solve.input, self, last, solve.keep, solve.team.control())?;
            let summary = solve.run_schedule(&mut run);
            run.finish(summary)
        };
        context.contain(|| caught(run))?
    }
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
        memory.follow(grid)?;
        memory.update_lists(grid, charts);
        let positions: Vec<f32> =
            pose.charts.iter().flat_map(|chart| chart.positions.as_flattened()).copied().collect();
        context.queue.write_buffer(&memory.positions, 0, bytemuck::cast_slice(&positions));
        let records: Vec<Chart> = charts
            .iter()
            .zip(&grid.levels[0].floor)
            .map(|(&solve, &floor)| Chart {
                solved: u32::from(solve),
                length_floor: floor,
                ..Chart::default()
            })
            .collect();
        context.queue.write_buffer(&memory.charts, 0, bytemuck::cast_slice(&records));
        let has_multipliers = input.multipliers.len() == grid.features.count && grid.features.count > 0;
        if has_multipliers {
            let start = bytemuck::cast_slice(input.multipliers);
            context.queue.write_buffer(&memory.features.multipliers, 0, start);
        }
        let params = Params {
            smoothness_floor: settings.smoothness_floor,
            orientation: settings.orientation,
            // A grid without densities is treated as having a density of 0.
            orientation_density: match grid.levels[0].density.is_empty() {
                true => 0.0,
                false => settings.orientation_density,
            },
            hold: if grid.levels[0].hold.is_empty() { 0.0 } else { HOLD },
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
            smoothness: (0..grid.levels.len()).map(|level| input.smoothness(level)).collect(),
            params,
            harm: input.harm,
            weighed: [false; LEVELS],
            has_multipliers,
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
            settled: false,
            share: [1, 1],
            energy_is_known: false,
            control: control.cloned(),
            error: None,
        };
        run.start_result(keep);
        run.upload_ms = milliseconds(start);
        run.recording = Instant::now();
        Ok(run)
    }

    /// Writes the result of charts that are not solved: the last one for those in `keep`, the identity for the others.
    /// In charts that are solved, each active block will be written, and inactive blocks are always 0.
    fn start_result(&mut self, keep: &[bool]) {
        let stays = |c: usize| keep[c] && self.last_result.is_some();
        let others: Vec<bool> =
            self.charts.iter().enumerate().map(|(c, &solve)| !solve && !stays(c)).collect();
        self.clear(&others);
        let Some(last_result) = self.last_result.clone() else { return };
        for [at, bytes] in self.ranges_of(|c| keep[c] && !self.charts[c]) {
            self.recorder.copy(&last_result.state, at, &self.result.state, at, bytes);
        }
    }

    /// Makes the result of these charts the identity.
    pub(super) fn clear(&mut self, charts: &[bool]) {
        for [at, bytes] in self.ranges_of(|c| charts[c]) {
            self.recorder.clear(&self.result.state, at, bytes);
        }
    }

    /// Offsets and lengths in bytes of the blocks of some charts in the result.
    fn ranges_of(&self, of: impl Fn(usize) -> bool) -> Vec<[u64; 2]> {
        let charts = self.grid.levels[0].blocks.of_chart.iter().enumerate().filter(|(c, _)| of(*c));
        let mut ranges: Vec<[u64; 2]> = Vec::new();
        for (_, blocks) in charts.filter(|(_, blocks)| !blocks.is_empty()) {
            let [at, bytes] = [blocks.start, blocks.len()].map(|n| n as u64 * RESULT_BLOCK);
            // Charts with consecutive blocks share one range.
            match ranges.last_mut() {
                Some(last) if last[0] + last[1] == at => last[1] += bytes,
                _ => ranges.push([at, bytes]),
            }
        }
        ranges
    }

    /// Submits the remaining commands, waits for the GPU, and reads the results. If the control is cancelled, it stops
    /// waiting; commands already submitted still finish before any that are submitted later.
    pub fn finish(mut self, summary: Summary) -> Result<TileSolution> {
        if let Some(error) = self.error {
            return Err(error);
        }
        let charts = self.memory.charts.clone();
        let size = (self.charts.len() * size_of::<Chart>()) as u64;
        let gate_open = self.memory.gate_open.clone();
        let gates = u64::from(self.gates.min(MAX_GATES)) * 4;
        let multipliers = self.memory.features.multipliers.clone();
        let count = if self.has_multipliers { self.grid.features.count } else { 0 };
        let read = [(&charts, 0..size), (&gate_open, 0..gates), (&multipliers, 0..count as u64 * 4)];
        let readback = self.recorder.read(&read, true)?;
        let record_ms = milliseconds(self.recording);
        let waiting = Instant::now();
        if let Some(control) = &self.control {
            self.context.wait_for(control)?;
        }
        let parts = self.context.taken(&readback)?;
        let wait_ms = milliseconds(waiting);
        let gates: Vec<u32> = parts[1].chunks_exact(4).map(bytemuck::pod_read_unaligned).collect();
        let times: Vec<u8> = parts[3..].iter().flatten().copied().collect();
        let (mut work, times, recording) = self.recorder.close(&gates, &times);
        self.memory.recording = recording;
        let records = parts[0].chunks_exact(size_of::<Chart>());
        let read = |bytes: &[u8]| chart_result(&bytemuck::pod_read_unaligned(bytes));
        (work.upload_ms, work.record_ms, work.wait_ms) = (self.upload_ms, record_ms, wait_ms);
        work.bytes_held = self.memory.bytes;
        Ok(TileSolution {
            charts: records.map(read).collect(),
            multipliers: parts[2].chunks_exact(4).map(bytemuck::pod_read_unaligned).collect(),
            warp: Warp::Gpu(boxed(Displacements::new(self.context, self.grid.clone(), self.result))),
            summary: Summary { times, ..summary },
            node_updates: self.node_updates,
            blocks_active: u64::from(self.memory.lists[0].active.count),
            work: Some(work),
        })
    }

    pub(super) fn at_level(&self, level: usize) -> Params {
        let is_weighed = self.weighed.get(level).is_some_and(|weighed| *weighed);
        Params {
            scale: (1u32 << level) as f32,
            smoothness: self.smoothness[level],
            multiplier: if is_weighed { 1.0 / MULTIPLIER_STEPS } else { 0.0 },
            ..self.params
        }
    }

    /// The parameters of kernels that pull level 0 towards the previous result.
    pub(super) fn with_pull(&self, level: usize) -> Params {
        Params {
            pull: if level == 0 { self.pull } else { 0.0 },
            anchor_is_identity: u32::from(self.last_result.is_none()),
            ..self.at_level(level)
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
