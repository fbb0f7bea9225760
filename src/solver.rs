//! Selects the backend that solves a tile: its memory, a run, and where the result is stored.

#[cfg(feature = "gpu")]
mod on_gpu;
pub(crate) mod solved;
pub(crate) mod tile_solve;

use std::sync::Arc;

use crate::device::Device;
use crate::gpu;
use tile_solve::{TileSolution, TileSolve, Warp};
use vrtm_core::allocation::boxed;
use vrtm_core::cpu;
use vrtm_core::error::Result;
use vrtm_core::grid::Grid;
use vrtm_core::mesh::TileMesh;
use vrtm_core::method::plan::Purpose;

/// A tile's solver: the memory that a backend keeps from one solve to the next.
#[derive(Debug)]
pub(crate) enum TileSolver {
    Cpu(Box<cpu::Memory>),
    Gpu(Box<gpu::Memory>),
}

impl TileSolver {
    /// Allocates the memory for a grid.
    pub fn new(device: &Device, grid: &Arc<Grid>, tile: &TileMesh, purpose: Purpose) -> Result<TileSolver> {
        match device.gpu() {
            Some(context) => {
                gpu::Memory::new(context, grid, tile).map(|memory| TileSolver::Gpu(boxed(memory)))
            }
            None => Ok(TileSolver::Cpu(boxed(cpu::Memory::new(grid, purpose)))),
        }
    }

    /// Bytes that `new` allocates for a grid.
    pub fn bytes_for(device: &Device, grid: &Grid, tile: &TileMesh, purpose: Purpose) -> Result<u64> {
        match device.gpu() {
            Some(context) => gpu::Memory::bytes_for(context, grid, tile),
            None => Ok(cpu::Memory::bytes_for(grid, purpose)),
        }
    }

    /// True if this memory is for this purpose on this grid (grids of other sizes or maps have other blocks).
    pub fn is_for(&self, grid: &Arc<Grid>, purpose: Purpose) -> bool {
        match self {
            TileSolver::Cpu(memory) => memory.is_for(grid, purpose),
            TileSolver::Gpu(memory) => memory.is_for(grid),
        }
    }

    /// Solves the requested charts.
    pub fn run(&mut self, solve: &TileSolve) -> Result<TileSolution> {
        match self {
            TileSolver::Cpu(memory) => run_on_cpu(memory, solve),
            TileSolver::Gpu(memory) => on_gpu::run(memory, solve),
        }
    }
}

fn run_on_cpu(memory: &mut cpu::Memory, solve: &TileSolve) -> Result<TileSolution> {
    let mut u = solve.initial_displacements()?;
    let mut run = cpu::Run::new(solve.team, &solve.input, memory, &mut u, solve.anchor()?);
    let summary = solve.run_schedule(&mut run);
    let (charts, node_updates) = (std::mem::take(&mut run.results), run.node_updates());
    let blocks_active = run.blocks_active();
    run.end();
    Ok(TileSolution { warp: Warp::Host(u), charts, summary, node_updates, blocks_active, work: None })
}

#[cfg(not(feature = "gpu"))]
mod on_gpu {
    use super::{Result, TileSolution, TileSolve, gpu};

    /// Never called: in this build GPU memory is uninhabited.
    pub fn run(memory: &mut gpu::Memory, _: &TileSolve) -> Result<TileSolution> {
        memory.absent()
    }
}
