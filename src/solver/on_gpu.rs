//! Solves a tile on a GPU.

use std::sync::Arc;

use crate::gpu;
use crate::gpu::context::Context;
use vrtm_core::error::Result;
use vrtm_core::method::plan::Summary;
use vrtm_core::unwind::caught;

use super::tile_solve::{TileSolution, TileSolve, Warp};

/// Solves the requested charts.
pub(crate) fn run(memory: &mut gpu::Memory, solve: &TileSolve) -> Result<TileSolution> {
    let context = memory.context.clone();
    context.contain(|| caught(|| run_on_gpu(memory, solve)))?
}

/// The last result, if it is on the GPU.
fn last_on_gpu(solve: &TileSolve) -> Option<Arc<gpu::ResultBuffers>> {
    match solve.last {
        Some(Warp::Gpu(last)) => Some(last.buffers.clone()),
        _ => None,
    }
}

fn run_on_gpu(memory: &mut gpu::Memory, solve: &TileSolve) -> Result<TileSolution> {
    let context = memory.context.clone();
    let mut run = gpu::Run::new(&solve.input, memory, last_on_gpu(solve), solve.keep, solve.team.control())?;
    let summary = solve.run_schedule(&mut run);
    let blocks_active = run.blocks_active();
    let done = run.finish()?;
    let summary = Summary { times: done.statistics.times(), ..summary };
    Ok(solution(context, solve, done, summary, blocks_active))
}

fn solution(
    context: Arc<Context>,
    solve: &TileSolve,
    done: gpu::Solution,
    summary: Summary,
    blocks_active: u64,
) -> TileSolution {
    TileSolution {
        work: Some(done.statistics.work()),
        warp: Warp::Gpu(gpu::Displacements::new(context, solve.grid.clone(), done.result)),
        charts: done.charts,
        summary,
        node_updates: done.node_updates,
        blocks_active,
    }
}
