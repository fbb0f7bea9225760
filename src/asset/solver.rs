//! A call that solves tiles, and the solvers of tiles: of one, or of several that share one.

use std::sync::{Arc, Mutex};

use super::given::Call;
use crate::device::Booked;
use vrtm_core::allocation::Vec;
use vrtm_core::backend::{TileSolution, TileSolve, TileSolver, Warp};
use vrtm_core::error::{ErrorKind, Result};
use vrtm_core::grid::Grid;
use vrtm_core::mesh::TileMesh;
use vrtm_core::method::deadline::Deadline;
use vrtm_core::method::plan::{Input, Plan};
use vrtm_core::method::progress::Progress;
use vrtm_core::unwind::caught;
use vrtm_core::view::Strided;

/// A call that solves a tile of an asset, or several.
#[derive(Clone, Copy)]
pub(crate) struct SolveCall<'a> {
    pub on: Call<'a>,
    pub positions: Strided<'a>,
    pub plan: &'a Plan,
    /// The time by which the call, or a tile of it, is to end.
    pub deadline: Deadline,
    /// True if tiles free their solver's memory once they are solved.
    pub release_solvers: bool,
    /// A tile's share of the progress.
    pub progress: f32,
}

/// A solver, which knows the grid that it is for, and its memory.
#[derive(Debug)]
pub(super) struct BookedSolver {
    pub solver: Box<dyn TileSolver>,
    pub booked: Booked,
}

impl BookedSolver {
    pub fn run(
        &mut self,
        call: &SolveCall,
        input: Input,
        progress: f32,
        lasts: &[Option<&Warp>],
        keep: &[bool],
    ) -> Result<TileSolution> {
        let SolveCall { on: Call { team, .. }, plan, deadline, .. } = *call;
        let progress = Progress::new(team.control(), progress);
        let mut solve = TileSolve { team, input, plan, deadline, progress, lasts, keep };
        caught(|| self.solver.run(&mut solve))
    }
}

/// True if a solver may be used again after this: a cancelled solve leaves its memory usable, since each solve writes
/// what it reads.
pub(super) fn is_usable_after(solution: &Result<TileSolution>) -> bool {
    solution.as_ref().err().is_none_or(|error| error.kind == ErrorKind::Cancelled)
}

/// Tiles that are solved together share this; `None` once it is of no more use to one of them.
pub(super) type Shared = Arc<Mutex<Option<Together>>>;

/// The solver of several tiles, kept from one call to the next.
#[derive(Debug)]
pub(super) struct Together {
    pub members: Vec<Member>,
    /// Their grids as one.
    pub grid: Arc<Grid>,
    pub solver: Option<BookedSolver>,
    /// The bytes of `grid`.
    pub booked: Booked,
}

#[derive(Debug)]
pub(super) struct Member {
    pub tile: usize,
    pub grid: Arc<Grid>,
    pub mesh: Arc<TileMesh>,
}

impl Member {
    pub fn blocks(&self) -> usize {
        self.grid.levels[0].blocks.list.len()
    }
}

impl Together {
    /// A tile's share of the bytes.
    pub fn bytes_of(&self, tile: usize) -> u64 {
        let all: usize = self.members.iter().map(Member::blocks).sum();
        let own: usize = self.members.iter().filter(|member| member.tile == tile).map(Member::blocks).sum();
        let solver = self.solver.as_ref().map_or(0, |solver| solver.booked.bytes());
        (self.booked.bytes() + solver) * own as u64 / all.max(1) as u64
    }
}
