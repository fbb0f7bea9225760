//! The memory of one tile's solver: what a solve changes, kept from one solve to the next.

use std::sync::{Arc, Weak};

use crate::mesh::NONE;
use crate::settings::Solver;
use crate::tile::Grid;
use crate::tile::blocks::{NODES, Plane};

use super::correct::Systems;
use super::patch::State;
use super::pbd::Scratch;
use super::record::Record;
use super::team::Shared;

/// The changing state of one level.
#[derive(Debug, Default)]
pub(super) struct Buffers {
    /// Displacements, in cells of this level.
    pub u: Vec<[Plane; 2]>,
    /// Positions (finest) or metrics at W(p).
    pub value: Vec<[Plane; 3]>,
    /// The triangle under W(p); finest level only.
    pub triangle: Vec<Plane<u32>>,
    /// Pose metrics at the nodes; coarser levels only.
    pub metric: Vec<[Plane; 3]>,
}

impl Buffers {
    /// Of `n` blocks, without metrics.
    pub fn new(n: usize, finest: bool) -> Buffers {
        Buffers {
            u: vec![[[0.0; NODES]; 2]; n],
            value: vec![[[0.0; NODES]; 3]; n],
            triangle: if finest { vec![[NONE; NODES]; n] } else { Vec::new() },
            metric: Vec::new(),
        }
    }

    pub fn state(&mut self) -> State {
        State {
            u: Shared::new(&mut self.u),
            value: Shared::new(&mut self.value),
            triangle: Shared::new(&mut self.triangle),
        }
    }
}

/// The memory of one tile's solver, kept between solves.
#[derive(Debug, Default)]
pub(crate) struct Memory {
    grid: Weak<Grid>,
    solver: Solver,
    pub(super) levels: Vec<Buffers>,
    pub(super) systems: Systems,
    /// Per level; of the paper's solver.
    pub(super) pbd: Vec<Scratch>,
    pub(super) triangles: Vec<Record>,
    pub(super) metrics: Vec<[f32; 3]>,
}

impl Memory {
    /// Allocates for a grid.
    pub fn new(grid: &Arc<Grid>, solver: Solver) -> Memory {
        let mut levels: Vec<Buffers> = Vec::with_capacity(grid.levels.len());
        for (k, level) in grid.levels.iter().enumerate() {
            let n = level.blocks.list.len();
            levels.push(Buffers {
                metric: if k > 0 { vec![[[0.0; NODES]; 3]; n] } else { Vec::new() },
                ..Buffers::new(n, k == 0)
            });
        }
        Memory {
            grid: Arc::downgrade(grid),
            solver,
            levels,
            systems: if solver == Solver::Descent { Systems::new(grid) } else { Systems::none(grid) },
            pbd: if solver == Solver::Pbd { Scratch::new(grid) } else { Vec::new() },
            triangles: vec![Record::default(); grid.triangles.len()],
            metrics: vec![[0.0; 3]; grid.triangles.len()],
        }
    }

    /// Bytes that `new` takes for a grid.
    pub fn bytes_for(grid: &Grid, solver: Solver) -> u64 {
        let plane = NODES * 4;
        let levels: usize =
            grid.levels.iter().map(|level| level.blocks.list.len() * (2 + 3 + 3) * plane).sum();
        // The finest level has triangles where the others have metrics.
        let finest = grid.levels[0].blocks.list.len() * 2 * plane;
        let triangles = grid.triangles.len() * (size_of::<Record>() + 12);
        let of_solver = match solver {
            Solver::Descent => Systems::bytes_for(grid),
            Solver::Pbd => Scratch::bytes_for(grid),
        };
        (levels - finest + triangles) as u64 + of_solver
    }

    /// True if this is the memory of a solver on a grid (grids of other sizes or maps have other blocks).
    pub fn is_for(&self, grid: &Arc<Grid>, solver: Solver) -> bool {
        self.solver == solver && self.grid.upgrade().is_some_and(|own| Arc::ptr_eq(&own, grid))
    }
}
