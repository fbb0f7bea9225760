//! Collects a solve's commands and submits them: as one submission where it is short enough, cut where a desktop's
//! watchdog might find it too long.

use std::collections::HashMap;
use std::sync::Arc;

use super::clock::Clock;
use super::context::Context;
use super::kernels::{Kernel, SOURCES};
use super::layout::{Params, SPREAD};
use crate::error::Result;
use crate::report::{GpuKernel, GpuWork, StageTimes};

/// What to run, in order.
#[derive(Debug)]
enum Command {
    Dispatch {
        kernel: Kernel,
        pipeline: wgpu::ComputePipeline,
        group: wgpu::BindGroup,
        offset: u32,
        size: Size,
    },
    Copy {
        source: wgpu::Buffer,
        from: u64,
        target: wgpu::Buffer,
        to: u64,
        bytes: u64,
    },
    Clear {
        buffer: wgpu::Buffer,
        from: u64,
        bytes: u64,
    },
    /// The commands up to the next mark belong to this stage.
    Stage(usize),
}

/// How many workgroups run.
#[derive(Clone, Debug)]
pub struct Size {
    /// This many, ...
    pub most: u32,
    /// ... or as many as the arguments at a place of a buffer say, if there is a gate: its number comes last.
    pub gate: Option<(wgpu::Buffer, u64, u32)>,
}

impl Size {
    /// Whatever happens.
    pub fn of(most: u32) -> Size {
        Size { most, gate: None }
    }
}

/// Stages whose time is taken.
pub const STAGES: usize = 8;

/// Bytes between two parameter records: WebGPU's largest alignment of dynamic offsets.
const STRIDE: usize = 256;
/// Records of a submission.
const RECORDS: usize = 1024;
/// Bytes that a submission moves at most: half a second on the slowest GPU of its kind. Desktops kill what takes two.
fn most_bytes(kind: wgpu::DeviceType) -> u64 {
    let per_second = if kind == wgpu::DeviceType::DiscreteGpu { 150 } else { 25 };
    per_second * 1_000_000_000 / 2
}

/// What the recorders of one tile use, one after the other.
#[derive(Clone, Debug)]
pub struct Recording {
    pub params: wgpu::Buffer,
    clock: Clock,
}

impl Recording {
    pub fn new(context: &Context) -> Result<Recording> {
        let usage = wgpu::BufferUsages::UNIFORM | wgpu::BufferUsages::COPY_DST;
        let params = context.buffer("params", (RECORDS * STRIDE) as u64, usage)?;
        Ok(Recording { params, clock: Clock::default() })
    }

    /// Bytes held.
    pub const BYTES: u64 = (RECORDS * STRIDE) as u64;
}

/// One solve's commands.
pub struct Recorder {
    context: Arc<Context>,
    recording: Recording,
    commands: Vec<Command>,
    params: Vec<u8>,
    known: HashMap<[u8; size_of::<Params>()], u32>,
    /// Bytes that the commands move at most.
    work: u64,
    stage: usize,
    /// Stage and, if each dispatch has a pass of its own, kernel of each pass that was timed.
    timed: Vec<(usize, Option<Kernel>)>,
    submissions: u64,
    /// What was recorded without a gate, then under each.
    tallies: Vec<Vec<KernelTally>>,
}

/// What a solve had the GPU do.
#[derive(Clone, Debug, Default, PartialEq)]
pub(crate) struct Tally {
    /// On the host.
    pub upload_ms: f32,
    pub record_ms: f32,
    pub wait_ms: f32,
    pub submissions: u64,
    /// Dispatches that no chart needed.
    pub skipped: u64,
    /// In the order of `SOURCES`.
    pub kernels: Vec<KernelTally>,
    /// Milliseconds per stage; `None` without timestamps.
    pub stages: Option<[f32; STAGES]>,
}

impl Tally {
    /// Of the solve; all 0 where the GPU has no timestamps.
    pub fn times(&self) -> StageTimes {
        let [surface, pyramid, prolong, relax, correct, pbd, certify, _] = self.stages.unwrap_or_default();
        StageTimes { surface, pyramid, prolong, relax, correct, pbd, certify, ..StageTimes::default() }
    }
}

impl Tally {
    /// As it is told.
    pub fn work(&self) -> GpuWork {
        let kernels = SOURCES.iter().zip(&self.kernels).filter(|(_, tally)| tally.dispatches > 0);
        let kernels = kernels.map(|(source, tally)| GpuKernel {
            name: format!("{} ({})", source.entry, source.parts.join(", ")),
            dispatches: tally.dispatches,
            workgroups: tally.workgroups,
            bytes: tally.bytes,
            ms: (tally.ms > 0.0).then_some(tally.ms),
        });
        GpuWork {
            upload_ms: self.upload_ms,
            record_ms: self.record_ms,
            wait_ms: self.wait_ms,
            gpu_ms: self.stages.map(|stages| stages.iter().sum()),
            submissions: self.submissions,
            skipped: self.skipped,
            kernels: kernels.collect(),
        }
    }
}

/// What one kernel did in a solve.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(crate) struct KernelTally {
    pub dispatches: u64,
    /// Workgroups: blocks, for most kernels.
    pub workgroups: u64,
    /// That they move at least.
    pub bytes: u64,
    /// On the GPU, if kernels are timed one by one.
    pub ms: f32,
}

impl KernelTally {
    fn add(&mut self, other: &KernelTally) {
        self.dispatches += other.dispatches;
        self.workgroups += other.workgroups;
        self.bytes += other.bytes;
        self.ms += other.ms;
    }
}

impl Recorder {
    pub fn new(context: Arc<Context>, mut recording: Recording) -> Recorder {
        recording.clock.reset();
        Recorder {
            context,
            recording,
            commands: Vec::new(),
            params: Vec::new(),
            known: HashMap::new(),
            work: 0,
            stage: 0,
            timed: Vec::new(),
            submissions: 0,
            tallies: Vec::new(),
        }
    }

    /// Runs a kernel on workgroups that move so many bytes at least.
    pub fn dispatch(
        &mut self,
        kernel: Kernel,
        pipeline: &wgpu::ComputePipeline,
        group: &wgpu::BindGroup,
        params: &Params,
        size: Size,
        bytes: u64,
    ) {
        if self.params.len() == RECORDS * STRIDE || self.work > most_bytes(self.context.adapter.device_type) {
            self.flush();
        }
        let mut record = [0; size_of::<Params>()];
        record.copy_from_slice(bytemuck::bytes_of(params));
        let all = &mut self.params;
        let offset = *self.known.entry(record).or_insert_with(|| {
            let offset = all.len();
            all.extend_from_slice(&record);
            all.resize(offset + STRIDE, 0);
            offset as u32
        });
        self.work += bytes;
        let gate = size.gate.as_ref().map_or(0, |(_, _, number)| *number as usize + 1);
        if gate >= self.tallies.len() {
            self.tallies.resize_with(gate + 1, || vec![KernelTally::default(); SOURCES.len()]);
        }
        self.tallies[gate][kernel as usize].add(&KernelTally {
            dispatches: 1,
            workgroups: u64::from(size.most),
            bytes,
            ms: 0.0,
        });
        let (pipeline, group) = (pipeline.clone(), group.clone());
        self.commands.push(Command::Dispatch { kernel, pipeline, group, offset, size });
    }

    /// Copies bytes between buffers.
    pub fn copy(&mut self, source: &wgpu::Buffer, from: u64, target: &wgpu::Buffer, to: u64, bytes: u64) {
        if bytes > 0 {
            let (source, target) = (source.clone(), target.clone());
            self.commands.push(Command::Copy { source, from, target, to, bytes });
        }
    }

    /// Sets bytes of a buffer to zero.
    pub fn clear(&mut self, buffer: &wgpu::Buffer, from: u64, bytes: u64) {
        if bytes > 0 {
            self.commands.push(Command::Clear { buffer: buffer.clone(), from, bytes });
        }
    }

    /// What follows belongs to a stage.
    pub fn stage(&mut self, stage: usize) {
        self.commands.push(Command::Stage(stage));
    }

    /// Submits what has been collected.
    pub fn flush(&mut self) {
        let context = self.context.clone();
        let Context { device, queue, .. } = &*context;
        queue.write_buffer(&self.recording.params, 0, &self.params);
        let mut encoder =
            device.create_command_encoder(&wgpu::CommandEncoderDescriptor { label: Some("solve") });
        let one_by_one = context.times_kernels();
        let mut commands = std::mem::take(&mut self.commands).into_iter().peekable();
        while let Some(command) = commands.next() {
            match command {
                Command::Stage(stage) => self.stage = stage,
                Command::Copy { source, from, target, to, bytes } => {
                    encoder.copy_buffer_to_buffer(&source, from, &target, to, Some(bytes));
                }
                Command::Clear { buffer, from, bytes } => encoder.clear_buffer(&buffer, from, Some(bytes)),
                Command::Dispatch { kernel, .. } => {
                    let queries = self.recording.clock.next(&context);
                    if queries.is_some() {
                        self.timed.push((self.stage, one_by_one.then_some(kernel)));
                    }
                    let timestamp_writes =
                        queries.as_ref().map(|(query_set, first)| wgpu::ComputePassTimestampWrites {
                            query_set,
                            beginning_of_pass_write_index: Some(*first),
                            end_of_pass_write_index: Some(first + 1),
                        });
                    let mut pass = encoder.begin_compute_pass(&wgpu::ComputePassDescriptor {
                        label: Some("stage"),
                        timestamp_writes,
                    });
                    let mut next = Some(command);
                    while let Some(Command::Dispatch { pipeline, group, offset, size, .. }) = next {
                        pass.set_pipeline(&pipeline);
                        pass.set_bind_group(0, &group, &[offset]);
                        match &size.gate {
                            Some((arguments, at, _)) => pass.dispatch_workgroups_indirect(arguments, *at),
                            None => {
                                pass.dispatch_workgroups(
                                    size.most.min(SPREAD),
                                    size.most.div_ceil(SPREAD),
                                    1,
                                );
                            }
                        }
                        next = commands.next_if(|c| !one_by_one && matches!(c, Command::Dispatch { .. }));
                    }
                }
            }
        }
        queue.submit([encoder.finish()]);
        self.submissions += 1;
        self.params.clear();
        self.known.clear();
        self.work = 0;
    }

    /// Submits the rest, with what makes the times readable: gives their buffers and bytes in use.
    pub fn finish(&mut self) -> Vec<(wgpu::Buffer, u64)> {
        self.flush();
        let label = wgpu::CommandEncoderDescriptor { label: Some("times") };
        let mut encoder = self.context.device.create_command_encoder(&label);
        let times = self.recording.clock.resolve(&mut encoder);
        self.context.queue.submit([encoder.finish()]);
        times
    }

    /// What was done, given which gates opened and the bytes of the times, and the recording for the next solve.
    pub fn close(self, opened: &[u32], times: &[u8]) -> (Tally, Recording) {
        let mut kernels = vec![KernelTally::default(); SOURCES.len()];
        let mut skipped = 0;
        for (gate, tallies) in self.tallies.iter().enumerate() {
            if gate > 0 && opened.get(gate - 1) == Some(&0) {
                skipped += tallies.iter().map(|tally| tally.dispatches).sum::<u64>();
                continue;
            }
            kernels.iter_mut().zip(tallies).for_each(|(sum, tally)| sum.add(tally));
        }
        let mut stages = self.context.timestamps.then_some([0.0; STAGES]);
        for (ms, (stage, kernel)) in Clock::milliseconds(&self.context, times).into_iter().zip(&self.timed) {
            if let Some(stages) = &mut stages {
                stages[*stage] += ms;
            }
            if let Some(kernel) = kernel {
                kernels[*kernel as usize].ms += ms;
            }
        }
        let submissions = self.submissions;
        (Tally { submissions, skipped, kernels, stages, ..Tally::default() }, self.recording)
    }
}
