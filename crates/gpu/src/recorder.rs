//! The recorder of a solve, which collects its commands and submits them: in one submission if they are few enough,
//! otherwise in several, so that none exceeds the time limit of a desktop's watchdog.

use std::collections::HashMap;
use std::ops::Range;
use std::sync::Arc;
use std::sync::atomic::Ordering;

use super::context::Context;
use super::kernels::{Kernel, SOURCES};
use super::layout::{Params, SPREAD};
use super::timestamps::Timestamps;
use super::transfer::Readback;
use vrtm_core::allocation::{Vec, make_room_in, vec};
use vrtm_core::error::Result;
use vrtm_core::method::stage::{Stage, Time};
use vrtm_core::report::{GpuKernel, GpuWork, StageTimes, report};

/// A recorded command.
#[derive(Debug)]
enum Command {
    Dispatch {
        kernel: Kernel,
        pipeline: wgpu::ComputePipeline,
        group: wgpu::BindGroup,
        offset: u32,
        size: DispatchSize,
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
    /// The following commands, up to the next such mark, belong to this stage.
    Stage(Time),
}

/// A bind group of a kernel, and the storage buffers in it, each with whether the kernel may write it.
#[derive(Clone, Debug)]
pub struct Bound {
    pub group: wgpu::BindGroup,
    pub uses: Arc<Vec<(wgpu::Buffer, bool)>>,
}

/// The size of a dispatch.
#[derive(Clone, Debug)]
pub struct DispatchSize {
    pub workgroups: u32,
    /// Under a gate: the buffer and byte offset of the indirect arguments (0 workgroups if the gate is closed), and the
    /// gate's index.
    pub gate: Option<(wgpu::Buffer, u64, u32)>,
}

impl DispatchSize {
    /// The size of a dispatch that always runs.
    pub fn ungated(workgroups: u32) -> DispatchSize {
        DispatchSize { workgroups, gate: None }
    }
}

/// Bytes between two parameter records: WebGPU's largest alignment of dynamic offsets.
const STRIDE: usize = 256;
/// The maximum number of parameter records of a submission.
const RECORDS: usize = 1024;
/// The maximum number of bytes that a submission moves: half a second's worth on the slowest GPU of its kind. The
/// watchdogs of desktops allow two seconds.
fn max_submission_bytes(kind: wgpu::DeviceType) -> u64 {
    let per_second = if kind == wgpu::DeviceType::DiscreteGpu { 150 } else { 25 };
    per_second * 1_000_000_000 / 2
}

/// Resources shared in turn by the recorders of a tile's solves.
#[derive(Clone, Debug)]
pub struct RecorderResources {
    pub params: wgpu::Buffer,
    timestamps: Timestamps,
}

impl RecorderResources {
    pub fn new(context: &Context) -> Result<RecorderResources> {
        let usage = wgpu::BufferUsages::UNIFORM | wgpu::BufferUsages::COPY_DST;
        let params = context.buffer("params", (RECORDS * STRIDE) as u64, usage)?;
        Ok(RecorderResources { params, timestamps: Timestamps::default() })
    }

    /// Bytes of GPU memory in use.
    pub const BYTES: u64 = (RECORDS * STRIDE) as u64;
}

/// The recorder of one solve.
pub struct Recorder {
    context: Arc<Context>,
    recording: RecorderResources,
    commands: Vec<Command>,
    params: Vec<u8>,
    record_offsets: HashMap<[u8; size_of::<Params>()], u32>,
    /// Bytes moved by the dispatches recorded since the last submission, if all gates are open.
    bytes_recorded: u64,
    stage: Time,
    /// Per timed pass, its stage and, if each dispatch has its own pass, its kernel.
    timed: Vec<(Time, Option<Kernel>)>,
    submissions: u64,
    barriers: u64,
    /// The buffers that dispatches used, each with whether the last use may have written it.
    written: HashMap<wgpu::Buffer, bool>,
    /// Statistics per kernel: first of the dispatches without a gate, then of those under each gate.
    statistics: Vec<Vec<KernelStatistics>>,
}

/// Statistics of one kernel in a solve.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct KernelStatistics {
    pub dispatches: u64,
    /// Number of workgroups; for most kernels one per block.
    pub workgroups: u64,
    /// The least number of bytes moved.
    pub bytes: u64,
    /// Milliseconds on the GPU; 0 unless kernels are timed separately.
    pub ms: f32,
}

impl KernelStatistics {
    fn add(&mut self, other: &KernelStatistics) {
        self.dispatches += other.dispatches;
        self.workgroups += other.workgroups;
        self.bytes += other.bytes;
        self.ms += other.ms;
    }
}

impl Recorder {
    pub fn new(context: Arc<Context>, mut recording: RecorderResources) -> Recorder {
        recording.timestamps.reset();
        Recorder {
            context,
            recording,
            commands: Vec::new(),
            params: Vec::new(),
            record_offsets: HashMap::new(),
            bytes_recorded: 0,
            stage: Stage::Surface.time(),
            timed: Vec::new(),
            submissions: 0,
            barriers: 0,
            written: HashMap::new(),
            statistics: Vec::new(),
        }
    }

    /// The offset of a record among those of this submission; a new record is appended.
    fn offset_of(&mut self, record: [u8; size_of::<Params>()]) -> u32 {
        if let Some(&offset) = self.record_offsets.get(&record) {
            return offset;
        }
        let offset = self.params.len();
        self.params.extend(record);
        self.params.resize(offset + STRIDE, 0);
        make_room_in(&mut self.record_offsets, 1);
        #[expect(clippy::disallowed_methods, reason = "room was made above")]
        self.record_offsets.insert(record, offset as u32);
        offset as u32
    }

    /// Records a dispatch that moves at least `bytes` bytes.
    pub fn dispatch(
        &mut self,
        kernel: Kernel,
        pipeline: &wgpu::ComputePipeline,
        group: &Bound,
        params: &Params,
        size: DispatchSize,
        bytes: u64,
    ) {
        if self.params.len() == RECORDS * STRIDE
            || self.bytes_recorded > max_submission_bytes(self.context.adapter.device_type)
        {
            self.flush();
        }
        let mut record = [0; size_of::<Params>()];
        record.copy_from_slice(bytemuck::bytes_of(params));
        let offset = self.offset_of(record);
        self.bytes_recorded += bytes;
        let gate = size.gate.as_ref().map_or(0, |(_, _, number)| *number as usize + 1);
        if gate >= self.statistics.len() {
            let none = vec![KernelStatistics::default(); SOURCES.len()];
            self.statistics.resize(gate + 1, none);
        }
        self.statistics[gate][kernel as usize].add(&KernelStatistics {
            dispatches: 1,
            workgroups: u64::from(size.workgroups),
            bytes,
            ms: 0.0,
        });
        self.count_barrier(&group.uses);
        let (pipeline, group) = (pipeline.clone(), group.group.clone());
        self.commands.push(Command::Dispatch { kernel, pipeline, group, offset, size });
    }

    /// Counts a barrier if a dispatch that uses these buffers has to wait for earlier ones. As wgpu does, a use that
    /// may write waits for all earlier uses, and a use that reads waits for those that may have written.
    fn count_barrier(&mut self, uses: &[(wgpu::Buffer, bool)]) {
        let mut waits = false;
        make_room_in(&mut self.written, uses.len());
        for (buffer, writes) in uses {
            #[expect(clippy::disallowed_methods, reason = "room was made above")]
            let before = self.written.insert(buffer.clone(), *writes);
            waits |= before.is_some_and(|written| written || *writes);
        }
        self.barriers += u64::from(waits);
    }

    /// Records a copy of bytes between buffers.
    pub fn copy(&mut self, source: &wgpu::Buffer, from: u64, target: &wgpu::Buffer, to: u64, bytes: u64) {
        if bytes > 0 {
            let (source, target) = (source.clone(), target.clone());
            self.commands.push(Command::Copy { source, from, target, to, bytes });
        }
    }

    /// Records that bytes of a buffer are set to zero.
    pub fn clear(&mut self, buffer: &wgpu::Buffer, from: u64, bytes: u64) {
        if bytes > 0 {
            self.commands.push(Command::Clear { buffer: buffer.clone(), from, bytes });
        }
    }

    /// Marks the commands that follow as belonging to a stage.
    pub fn stage(&mut self, stage: Time) {
        self.commands.push(Command::Stage(stage));
    }

    /// Submits the commands recorded so far.
    pub fn flush(&mut self) {
        if !self.commands.is_empty() {
            let encoder = self.encode();
            self.submit(encoder);
        }
    }

    /// Submits the commands recorded so far and, in the same submission, copies of ranges of bytes for the host. With
    /// `times`, the timestamps are copied, too.
    pub fn read(&mut self, ranges: &[(&wgpu::Buffer, Range<u64>)], times: bool) -> Result<Readback> {
        let mut encoder = self.encode();
        let times = if times { self.recording.timestamps.resolve(&mut encoder) } else { Vec::new() };
        let times = times.iter().map(|(buffer, bytes)| (buffer, 0..*bytes));
        let all: Vec<_> = ranges.iter().cloned().chain(times).collect();
        let readback = self.context.readback(&all, &mut encoder)?;
        self.submit(encoder);
        Ok(readback)
    }

    fn submit(&mut self, encoder: wgpu::CommandEncoder) {
        self.context.queue.submit([encoder.finish()]);
        self.submissions += 1;
    }

    /// Encodes the commands recorded so far.
    fn encode(&mut self) -> wgpu::CommandEncoder {
        let context = self.context.clone();
        let Context { device, queue, .. } = &*context;
        queue.write_buffer(&self.recording.params, 0, &self.params);
        let mut encoder =
            device.create_command_encoder(&wgpu::CommandEncoderDescriptor { label: Some("solve") });
        let one_by_one = context.time_kernels.load(Ordering::Relaxed);
        let mut commands = std::mem::take(&mut self.commands).into_iter().peekable();
        while let Some(command) = commands.next() {
            match command {
                Command::Stage(stage) => self.stage = stage,
                Command::Copy { source, from, target, to, bytes } => {
                    encoder.copy_buffer_to_buffer(&source, from, &target, to, Some(bytes));
                }
                Command::Clear { buffer, from, bytes } => encoder.clear_buffer(&buffer, from, Some(bytes)),
                Command::Dispatch { kernel, .. } => {
                    let queries = self.recording.timestamps.next(&context);
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
                                    size.workgroups.min(SPREAD),
                                    size.workgroups.div_ceil(SPREAD),
                                    1,
                                );
                            }
                        }
                        next = commands.next_if(|c| !one_by_one && matches!(c, Command::Dispatch { .. }));
                    }
                }
            }
        }
        self.params.clear();
        self.record_offsets.clear();
        self.bytes_recorded = 0;
        encoder
    }

    /// The GPU's work and the times of the stages, all 0 without timestamps, from the gates' states and the bytes of
    /// the timestamps; and the resources for the next solve.
    pub fn close(self, gate_open: &[u32], times: &[u8]) -> (GpuWork, StageTimes, RecorderResources) {
        let mut kernels = vec![KernelStatistics::default(); SOURCES.len()];
        let mut skipped = 0;
        for (gate, statistics) in self.statistics.iter().enumerate() {
            if gate > 0 && gate_open.get(gate - 1) == Some(&0) {
                skipped += statistics.iter().map(|kernel| kernel.dispatches).sum::<u64>();
                continue;
            }
            kernels.iter_mut().zip(statistics).for_each(|(sum, kernel)| sum.add(kernel));
        }
        let (mut of_stages, mut all) = (StageTimes::default(), 0.0);
        for (ms, (stage, kernel)) in
            Timestamps::milliseconds(&self.context, times).into_iter().zip(&self.timed)
        {
            *stage(&mut of_stages) += ms;
            all += ms;
            if let Some(kernel) = kernel {
                kernels[*kernel as usize].ms += ms;
            }
        }
        let used = SOURCES.iter().zip(&kernels).filter(|(_, kernel)| kernel.dispatches > 0);
        let used = used.map(|(source, kernel)| {
            report!(GpuKernel {
                name: format!("{} ({})", source.entry, source.parts.join(", ")),
                dispatches: kernel.dispatches,
                workgroups: kernel.workgroups,
                bytes: kernel.bytes,
                ms: (kernel.ms > 0.0).then_some(kernel.ms),
            })
        });
        let work = report!(GpuWork {
            gpu_ms: self.context.timestamps.then_some(all),
            submissions: self.submissions,
            skipped: skipped,
            barriers: self.barriers,
            kernels: used.collect(),
        });
        (work, of_stages, self.recording)
    }
}
