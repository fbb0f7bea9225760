//! The one place that knows which backend solves a tile: its memory, a run, and where the result was left.

use std::cell::RefCell;
use std::sync::Arc;

use crate::device::Device;
use crate::error::Result;
use crate::memory::{boxed, zeroed};
use crate::mesh::TileMesh;
use crate::method::budget::Clock;
use crate::method::progress::Progress;
use crate::method::schedule::{self, ChartResult, Input, Plan, Stages, Summary};
use crate::report::GpuWork;
use crate::settings::Solver;
use crate::team::Team;
use crate::tile::Grid;
use crate::tile::blocks::Plane;
use crate::{cpu, gpu};

#[cfg(feature = "gpu")]
use super::on_gpu;

/// Displacements in cells, per block of the finest level.
#[derive(Debug)]
pub(super) enum Warp {
    Host(Vec<[Plane; 2]>),
    #[cfg_attr(not(feature = "gpu"), allow(dead_code))]
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

/// A tile's solver: the memory that a backend keeps from one solve to the next.
#[derive(Debug)]
pub(super) enum TileSolver {
    Cpu(cpu::Memory),
    Gpu(Box<gpu::Memory>),
}

impl TileSolver {
    /// Allocates for a grid.
    pub fn new(device: &Device, grid: &Arc<Grid>, tile: &TileMesh, solver: Solver) -> Result<TileSolver> {
        match device.gpu() {
            Some(context) => {
                gpu::Memory::new(context, grid, tile).map(|memory| TileSolver::Gpu(boxed(memory)))
            }
            None => Ok(TileSolver::Cpu(cpu::Memory::new(grid, solver))),
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
            TileSolver::Cpu(memory) => memory.is_for(grid, solver),
            TileSolver::Gpu(memory) => memory.is_for(grid),
        }
    }
}

/// One solve of one tile.
pub(super) struct Job<'a> {
    pub team: &'a Team,
    pub input: Input<'a>,
    pub grid: &'a Arc<Grid>,
    pub plan: &'a Plan,
    /// The time that there is.
    pub clock: RefCell<Clock>,
    /// How far it is.
    pub progress: RefCell<Progress>,
    /// The tile's last result on the same grid.
    pub last: Option<&'a Warp>,
    /// Charts that are not solved keep their last result if they are in here, and become the identity if not.
    pub keep: &'a [bool],
}

/// The result of a job.
pub(super) struct TileSolution {
    pub warp: Warp,
    /// Per chart; of those that were solved.
    pub charts: Vec<ChartResult>,
    pub summary: Summary,
    pub node_updates: u64,
    pub blocks_active: u64,
    /// The GPU's dispatches, submissions and transfers.
    pub work: Option<GpuWork>,
}

impl Job<'_> {
    /// True if a chart has to be solved.
    pub fn solves(&self) -> bool {
        self.input.charts.contains(&true)
    }

    /// The last result in host memory, if the solve starts from it or is pulled towards it; else nothing.
    pub fn anchor(&self) -> Result<&[[Plane; 2]]> {
        self.last.filter(|_| self.plan.warm).map_or(Ok(&[]), Warp::host)
    }

    /// Runs the schedule, if a chart has to be solved.
    pub fn run_schedule(&self, stages: &mut impl Stages) -> Summary {
        let warm = self.plan.warm && self.last.is_some();
        let clock = &mut self.clock.borrow_mut();
        if self.solves() {
            schedule::run(stages, self.plan, warm, clock, &mut self.progress.borrow_mut())
        } else {
            Summary::default()
        }
    }

    /// The last result of the charts that keep it and are not solved, the identity elsewhere, in host memory. The
    /// identity's pages are taken when they are written.
    pub fn initial_displacements(&self) -> Result<Vec<[Plane; 2]>> {
        let blocks = &self.grid.levels[0].blocks;
        let mut u = zeroed(blocks.list.len());
        let stays = |c: usize| self.keep[c] && !self.input.charts[c];
        if let Some(last) = self.last.filter(|_| (0..self.keep.len()).any(stays)) {
            let last = last.host()?;
            for (_, range) in blocks.of_chart.iter().enumerate().filter(|(c, _)| stays(*c)) {
                u[range.clone()].copy_from_slice(&last[range.clone()]);
            }
        }
        Ok(u)
    }
}

impl TileSolver {
    /// Solves the job's charts.
    pub fn run(&mut self, job: &Job) -> Result<TileSolution> {
        match self {
            TileSolver::Cpu(memory) => run_on_cpu(memory, job),
            TileSolver::Gpu(memory) => on_gpu::run(memory, job),
        }
    }
}

fn run_on_cpu(memory: &mut cpu::Memory, job: &Job) -> Result<TileSolution> {
    let mut u = job.initial_displacements()?;
    let mut run = cpu::Run::new(job.team, &job.input, memory, &mut u, job.anchor()?);
    let summary = job.run_schedule(&mut run);
    let (charts, node_updates) = (std::mem::take(&mut run.results), run.node_updates());
    let blocks_active = run.blocks_active();
    Ok(TileSolution { warp: Warp::Host(u), charts, summary, node_updates, blocks_active, work: None })
}

#[cfg(not(feature = "gpu"))]
mod on_gpu {
    use super::{Job, Result, TileSolution, gpu};

    /// Is never called: there is no such memory.
    pub fn run(memory: &mut gpu::Memory, _: &Job) -> Result<TileSolution> {
        memory.absent()
    }
}
