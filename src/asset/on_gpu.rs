//! A job on a GPU: all of it, or the stages that a switch leaves to it.

use std::sync::Arc;

use crate::control::stoppable;
use crate::error::Result;
use crate::gpu::context::Context;
use crate::method::point::Switch;
use crate::method::schedule::Summary;
use crate::{cpu, gpu};

use super::backend::{Job, TileSolution, Warp};
use super::switched::Switched;

/// Solves the job's charts.
pub(super) fn run(memory: &mut gpu::Memory, job: &Job) -> Result<TileSolution> {
    let context = memory.context.clone();
    context.contain(|| {
        stoppable(|| match context.options.switch.filter(|_| job.solves()) {
            Some(switch) => run_on_both(switch, memory, job),
            None => run_on_gpu(memory, job),
        })
    })?
}

/// The last result, if it is on the GPU.
fn last_on_gpu(job: &Job) -> Option<Arc<gpu::ResultBuffers>> {
    match job.last {
        Some(Warp::Gpu(last)) => Some(last.buffers.clone()),
        _ => None,
    }
}

fn run_on_gpu(memory: &mut gpu::Memory, job: &Job) -> Result<TileSolution> {
    let context = memory.context.clone();
    let mut run = gpu::Run::new(&job.input, memory, last_on_gpu(job), job.keep, job.team.control())?;
    let summary = job.run_schedule(&mut run);
    let blocks_active = run.blocks_active();
    let done = run.finish()?;
    let summary = Summary { times: done.statistics.times(), ..summary };
    Ok(solution(context, job, done, summary, blocks_active))
}

/// Runs some stages on the CPU, the rest on the GPU.
fn run_on_both(switch: Switch, memory: &mut gpu::Memory, job: &Job) -> Result<TileSolution> {
    let context = memory.context.clone();
    let mut of_cpu = cpu::Memory::new(job.grid, job.plan.solver());
    let mut u = job.initial_displacements()?;
    let cpu = cpu::Run::new(job.team, &job.input, &mut of_cpu, &mut u, job.anchor()?);
    let gpu = gpu::Run::new(&job.input, memory, last_on_gpu(job), job.keep, job.team.control())?;
    let mut run = Switched::new(cpu, gpu, switch);
    let summary = job.run_schedule(&mut run);
    let blocks_active = run.gpu.blocks_active();
    let done = run.finish()?;
    Ok(solution(context, job, done, summary, blocks_active))
}

fn solution(
    context: Arc<Context>,
    job: &Job,
    done: gpu::Solution,
    summary: Summary,
    blocks_active: u64,
) -> TileSolution {
    TileSolution {
        work: Some(done.statistics.work()),
        warp: Warp::Gpu(gpu::Displacements::new(context, job.grid.clone(), done.result)),
        charts: done.charts,
        summary,
        node_updates: done.node_updates,
        blocks_active,
    }
}
