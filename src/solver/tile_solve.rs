//! One solve of one tile, for either backend: its input and its output.

use std::cell::RefCell;
use std::sync::Arc;

use crate::gpu;
use vrtm_core::allocation::zeroed;
use vrtm_core::error::Result;
use vrtm_core::grid::Grid;
use vrtm_core::grid::planes::Plane;
use vrtm_core::method::deadline::Deadline;
use vrtm_core::method::plan::{ChartResult, Input, Plan, Summary};
use vrtm_core::method::progress::Progress;
use vrtm_core::method::schedule;
use vrtm_core::method::stage::Stages;
use vrtm_core::report::GpuWork;
use vrtm_core::team::Team;

/// Displacements in cells, per block of the finest level.
#[derive(Debug)]
pub(crate) enum Warp {
    Host(Vec<[Plane; 2]>),
    #[cfg_attr(not(feature = "gpu"), allow(dead_code))]
    Gpu(gpu::Displacements),
}

impl Warp {
    /// The displacements in host memory; read from the GPU on first use.
    pub fn host(&self) -> Result<&[[Plane; 2]]> {
        match self {
            Warp::Host(u) => Ok(u),
            Warp::Gpu(u) => u.host(),
        }
    }
}

/// One solve of one tile.
pub(crate) struct TileSolve<'a> {
    pub team: &'a Team,
    pub input: Input<'a>,
    pub grid: &'a Arc<Grid>,
    pub plan: &'a Plan,
    /// The time limit.
    pub deadline: RefCell<Deadline>,
    /// The progress of the solve.
    pub progress: RefCell<Progress>,
    /// The tile's last result on the same grid.
    pub last: Option<&'a Warp>,
    /// Charts that are not solved keep their last result if this is true for them, and become the identity otherwise.
    pub keep: &'a [bool],
}

/// The result of a solve.
pub(crate) struct TileSolution {
    pub warp: Warp,
    /// Per chart; meaningful for the solved charts.
    pub charts: Vec<ChartResult>,
    pub summary: Summary,
    pub node_updates: u64,
    pub blocks_active: u64,
    /// The GPU's dispatches, submissions and transfers.
    pub work: Option<GpuWork>,
}

impl TileSolve<'_> {
    /// True if a chart has to be solved.
    pub fn solves(&self) -> bool {
        self.input.charts.contains(&true)
    }

    /// The last result in host memory if the solve starts from it or is pulled towards it, otherwise empty.
    pub fn anchor(&self) -> Result<&[[Plane; 2]]> {
        self.last.filter(|_| self.plan.warm).map_or(Ok(&[]), Warp::host)
    }

    /// Runs the schedule, if a chart has to be solved.
    pub fn run_schedule(&self, stages: &mut impl Stages) -> Summary {
        let warm = self.plan.warm && self.last.is_some();
        let deadline = &mut self.deadline.borrow_mut();
        if self.solves() {
            schedule::run(stages, &self.input, self.plan, warm, deadline, &mut self.progress.borrow_mut())
        } else {
            Summary::default()
        }
    }

    /// The initial displacements in host memory: the last result for charts that keep it and are not solved, the identity
    /// elsewhere. Pages of the identity are not touched until they are written.
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
