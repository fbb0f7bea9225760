//! Collects a solve's commands and submits them: as one submission where it is short enough, cut where a desktop's
//! watchdog might find it too long.

use std::collections::HashMap;
use std::sync::Arc;

use super::context::Context;
use super::layout::{Params, SPREAD};
use crate::error::Result;

/// What to run, in order.
#[derive(Debug)]
enum Command {
    Dispatch {
        pipeline: wgpu::ComputePipeline,
        group: wgpu::BindGroup,
        offset: u32,
        workgroups: [u32; 2],
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

/// Stages whose time is taken.
pub const STAGES: usize = 7;

/// Bytes between two parameter records: WebGPU's largest alignment of dynamic offsets.
const STRIDE: usize = 256;
/// Records of a submission.
const RECORDS: usize = 1024;
/// Blocks times passes of a submission: on a GPU with 50 GB/s, about a third of a second.
const WORK: u64 = 1 << 20;
/// Timestamps: two per pass.
const QUERIES: u32 = 4096;

/// What the recorders of one tile use, one after the other.
#[derive(Clone, Debug)]
pub struct Recording {
    pub params: wgpu::Buffer,
    queries: Option<wgpu::QuerySet>,
    resolved: wgpu::Buffer,
}

impl Recording {
    pub fn new(context: &Context) -> Result<Recording> {
        use wgpu::BufferUsages as Usage;
        let queries = context.timestamps.then(|| {
            context.device.create_query_set(&wgpu::QuerySetDescriptor {
                label: Some("stages"),
                ty: wgpu::QueryType::Timestamp,
                count: QUERIES,
            })
        });
        Ok(Recording {
            params: context.buffer("params", (RECORDS * STRIDE) as u64, Usage::UNIFORM | Usage::COPY_DST)?,
            resolved: context.buffer(
                "times",
                u64::from(QUERIES) * 8,
                Usage::QUERY_RESOLVE | Usage::COPY_SRC,
            )?,
            queries,
        })
    }

    /// Bytes held.
    pub const BYTES: u64 = (RECORDS * STRIDE) as u64 + QUERIES as u64 * 8;
}

/// One solve's commands.
pub struct Recorder {
    context: Arc<Context>,
    recording: Recording,
    commands: Vec<Command>,
    params: Vec<u8>,
    known: HashMap<[u8; size_of::<Params>()], u32>,
    work: u64,
    stage: usize,
    /// The stage of each pass that was timed.
    timed: Vec<usize>,
    pub dispatches: u64,
    pub submissions: u64,
}

impl Recorder {
    pub fn new(context: Arc<Context>, recording: Recording) -> Recorder {
        Recorder {
            context,
            recording,
            commands: Vec::new(),
            params: Vec::new(),
            known: HashMap::new(),
            work: 0,
            stage: 0,
            timed: Vec::new(),
            dispatches: 0,
            submissions: 0,
        }
    }

    /// Runs a kernel on `workgroups`.
    pub fn dispatch(
        &mut self,
        pipeline: &wgpu::ComputePipeline,
        group: &wgpu::BindGroup,
        params: &Params,
        workgroups: u32,
    ) {
        if workgroups == 0 {
            return;
        }
        if self.params.len() == RECORDS * STRIDE || self.work > WORK {
            self.flush();
        }
        let mut bytes = [0; size_of::<Params>()];
        bytes.copy_from_slice(bytemuck::bytes_of(params));
        let all = &mut self.params;
        let offset = *self.known.entry(bytes).or_insert_with(|| {
            let offset = all.len();
            all.extend_from_slice(&bytes);
            all.resize(offset + STRIDE, 0);
            offset as u32
        });
        let workgroups = [workgroups.min(SPREAD), workgroups.div_ceil(SPREAD)];
        self.work += u64::from(workgroups[0] * workgroups[1]);
        self.dispatches += 1;
        let (pipeline, group) = (pipeline.clone(), group.clone());
        self.commands.push(Command::Dispatch { pipeline, group, offset, workgroups });
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
        let mut commands = std::mem::take(&mut self.commands).into_iter().peekable();
        while let Some(command) = commands.next() {
            match command {
                Command::Stage(stage) => self.stage = stage,
                Command::Copy { source, from, target, to, bytes } => {
                    encoder.copy_buffer_to_buffer(&source, from, &target, to, Some(bytes));
                }
                Command::Clear { buffer, from, bytes } => encoder.clear_buffer(&buffer, from, Some(bytes)),
                Command::Dispatch { .. } => {
                    let queries = self.recording.queries.clone();
                    let timestamp_writes = queries.as_ref().and_then(|queries| self.time_pass(queries));
                    let mut pass = encoder.begin_compute_pass(&wgpu::ComputePassDescriptor {
                        label: Some("stage"),
                        timestamp_writes,
                    });
                    let mut next = Some(command);
                    while let Some(Command::Dispatch { pipeline, group, offset, workgroups: [x, y] }) = next {
                        pass.set_pipeline(&pipeline);
                        pass.set_bind_group(0, &group, &[offset]);
                        pass.dispatch_workgroups(x, y, 1);
                        next = commands.next_if(|c| matches!(c, Command::Dispatch { .. }));
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

    fn time_pass<'q>(
        &mut self,
        query_set: &'q wgpu::QuerySet,
    ) -> Option<wgpu::ComputePassTimestampWrites<'q>> {
        let first = 2 * self.timed.len() as u32;
        if first + 2 > QUERIES {
            return None;
        }
        self.timed.push(self.stage);
        Some(wgpu::ComputePassTimestampWrites {
            query_set,
            beginning_of_pass_write_index: Some(first),
            end_of_pass_write_index: Some(first + 1),
        })
    }

    /// Submits the rest, with what puts the times where they can be read. Gives the buffer and its bytes in use.
    pub fn finish(&mut self) -> (wgpu::Buffer, u64) {
        self.flush();
        let count = 2 * self.timed.len() as u32;
        let Recording { queries, resolved, .. } = &self.recording;
        if let Some(queries) = queries.as_ref().filter(|_| count > 0) {
            let label = wgpu::CommandEncoderDescriptor { label: Some("times") };
            let mut encoder = self.context.device.create_command_encoder(&label);
            encoder.resolve_query_set(queries, 0..count, resolved, 0);
            self.context.queue.submit([encoder.finish()]);
        }
        (resolved.clone(), u64::from(count) * 8)
    }

    /// Milliseconds per stage from the bytes of the times; `None` without timestamps.
    pub fn times(&self, bytes: &[u8]) -> Option<[f32; STAGES]> {
        self.recording.queries.as_ref()?;
        let period = f64::from(self.context.queue.get_timestamp_period());
        let mut times = [0.0; STAGES];
        for (pair, &stage) in bytes.chunks_exact(16).zip(&self.timed) {
            let [start, end] = [0, 8].map(|at| {
                let mut tick = [0; 8];
                tick.copy_from_slice(&pair[at..at + 8]);
                u64::from_le_bytes(tick)
            });
            times[stage] += (end.saturating_sub(start) as f64 * period * 1e-6) as f32;
        }
        Some(times)
    }
}
