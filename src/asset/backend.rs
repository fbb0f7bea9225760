//! The one place that knows which backend solves a tile: its memory, a run, and where the result was left.

use std::sync::Arc;
use std::time::Instant;

use crate::cpu::Team;
use crate::device::Device;
use crate::error::Result;
use crate::mesh::TileMesh;
use crate::parity::Switch;
use crate::parity::switched::Switched;
use crate::report::GpuWork;
use crate::settings::Solver;
use crate::solve::{self, ChartResult, Input, Outcome, Plan};
use crate::tile::Grid;
use crate::tile::blocks::{NODES, Plane};
use crate::{cpu, gpu};

/// Displacements in cells, per block of the finest level.
#[derive(Debug)]
pub(super) enum Warp {
    Host(Vec<[Plane; 2]>),
    Gpu(gpu::Displacements),
}

impl Warp {
    /// In host memory: read from the GPU the first time.
    pub fn host(&self) -> Result<&[[Plane; 2]]> {
        match self {
            Warp::Host(u) => Ok(u),
            Warp::Gpu(u) => u.host(),
        }
    }
}

/// A tile's solver.
#[derive(Debug)]
pub(super) enum Memory {
    Cpu(cpu::Memory),
    Gpu(Box<gpu::Memory>),
}

impl Memory {
    /// Allocates for a grid.
    pub fn new(device: &Device, grid: &Arc<Grid>, tile: &TileMesh, solver: Solver) -> Result<Memory> {
        match device.gpu() {
            Some(context) => {
                gpu::Memory::new(context, grid, tile).map(|memory| Memory::Gpu(Box::new(memory)))
            }
            None => Ok(Memory::Cpu(cpu::Memory::new(grid, solver))),
        }
    }

    /// Bytes that `new` takes for a grid.
    pub fn bytes_for(device: &Device, grid: &Grid, tile: &TileMesh, solver: Solver) -> Result<u64> {
        match device.gpu() {
            Some(context) => gpu::Memory::bytes_for(context, grid, tile),
            None => Ok(cpu::Memory::bytes_for(grid, solver)),
        }
    }

    /// True if this is the memory of a solver on a grid (grids of other sizes or maps have other blocks).
    pub fn is_for(&self, grid: &Arc<Grid>, solver: Solver) -> bool {
        match self {
            Memory::Cpu(memory) => memory.is_for(grid, solver),
            Memory::Gpu(memory) => memory.is_for(grid),
        }
    }
}

/// What a run gave.
pub(super) struct Ran {
    pub warp: Warp,
    /// Per chart; of those that were solved.
    pub charts: Vec<ChartResult>,
    pub outcome: Outcome,
    pub node_updates: u64,
    pub blocks_active: u64,
    /// What a GPU had to do.
    pub work: Option<GpuWork>,
}

impl Memory {
    /// Solves the input's charts. Others keep their last result if they are in `keep`, and become the identity if not.
    #[allow(clippy::too_many_arguments, reason = "one caller, and a struct for it would only rename them")]
    pub fn run(
        &mut self,
        team: &Team,
        input: &Input,
        grid: &Arc<Grid>,
        plan: &Plan,
        called: Instant,
        last: Option<&Warp>,
        keep: &[bool],
    ) -> Result<Ran> {
        let any = input.charts.contains(&true);
        let warm = plan.warm && last.is_some();
        match self {
            Memory::Cpu(memory) => {
                let mut u = start(grid, last, keep)?;
                let mut run = cpu::Run::new(team, input, memory, &mut u);
                let outcome = if any { solve::run(&mut run, plan, warm, called) } else { Outcome::default() };
                let (charts, node_updates) = (std::mem::take(&mut run.outcome), run.node_updates());
                let blocks_active = run.blocks_active();
                let warp = Warp::Host(u);
                Ok(Ran { warp, charts, outcome, node_updates, blocks_active, work: None })
            }
            Memory::Gpu(memory) => {
                let context = memory.context.clone();
                if let (Some(switch), true) = (context.options.switch, any) {
                    return switched(switch, memory, team, input, grid, plan, called, last, keep);
                }
                context.contain(|| {
                    let last = match last {
                        Some(Warp::Gpu(last)) => Some(last.buffers.clone()),
                        _ => None,
                    };
                    let mut run = gpu::Run::new(input, memory, last, keep)?;
                    let mut outcome =
                        if any { solve::run(&mut run, plan, warm, called) } else { Outcome::default() };
                    let blocks_active = run.blocks_active();
                    let done = run.finish()?;
                    outcome.times = done.tally.times();
                    let warp = Warp::Gpu(gpu::Displacements::new(context.clone(), grid.clone(), done.result));
                    Ok(Ran {
                        warp,
                        charts: done.outcome,
                        outcome,
                        node_updates: done.node_updates,
                        blocks_active,
                        work: Some(done.tally.work()),
                    })
                })?
            }
        }
    }
}

/// The same with some stages on the CPU.
#[allow(clippy::too_many_arguments, reason = "those of Memory::run")]
fn switched(
    switch: Switch,
    memory: &mut gpu::Memory,
    team: &Team,
    input: &Input,
    grid: &Arc<Grid>,
    plan: &Plan,
    called: Instant,
    last: Option<&Warp>,
    keep: &[bool],
) -> Result<Ran> {
    let context = memory.context.clone();
    context.contain(|| {
        let mut of_cpu = cpu::Memory::new(grid, plan.solver());
        let mut u = start(grid, last, keep)?;
        let warm = plan.warm && last.is_some();
        let cpu = cpu::Run::new(team, input, &mut of_cpu, &mut u);
        let last = match last {
            Some(Warp::Gpu(last)) => Some(last.buffers.clone()),
            _ => None,
        };
        let gpu = gpu::Run::new(input, memory, last, keep)?;
        let mut run = Switched::new(cpu, gpu, switch);
        let outcome = solve::run(&mut run, plan, warm, called);
        let blocks_active = run.gpu.blocks_active();
        let done = run.finish()?;
        let warp = Warp::Gpu(gpu::Displacements::new(context.clone(), grid.clone(), done.result));
        let (charts, node_updates, work) = (done.outcome, done.node_updates, Some(done.tally.work()));
        Ok(Ran { warp, charts, outcome, node_updates, blocks_active, work })
    })?
}

/// The last result of charts in `keep`, the identity elsewhere.
fn start(grid: &Grid, last: Option<&Warp>, keep: &[bool]) -> Result<Vec<[Plane; 2]>> {
    let blocks = &grid.levels[0].blocks;
    let Some(last) = last else { return Ok(vec![[[0.0; NODES]; 2]; blocks.list.len()]) };
    let mut u = last.host()?.to_vec();
    for (range, _) in blocks.of_chart.iter().zip(keep).filter(|(_, keep)| !**keep) {
        u[range.clone()].fill([[0.0; NODES]; 2]);
    }
    Ok(u)
}
