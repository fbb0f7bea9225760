//! The memory of one tile's solver: all arrays that a solve writes, kept from one solve to the next.

use std::sync::{Arc, Weak};

use crate::allocation::{Grow, with_capacity};
use crate::grid::Grid;
use crate::grid::planes::Plane;
use crate::settings::Solver;

use super::allocate::{Allocate, Count, Heap};
use super::correct::Workspace;
use super::patch::State;
use super::pbd::PbdBuffers;
use super::sampling::TriangleRecord;
use crate::team::SharedSlice;

/// The state of one level, and its pose metrics.
#[derive(Debug, Default)]
pub(super) struct Buffers {
    /// Displacements, in cells of this level.
    pub u: Vec<[Plane; 2]>,
    /// Position f(W(p)) on the finest level, metric at W(p) on coarser ones.
    pub value: Vec<[Plane; 3]>,
    /// The triangle under W(p); finest level only. A solve writes it before it reads it.
    pub triangle: Vec<Plane<u32>>,
    /// Pose metrics at the nodes; coarser levels only.
    pub metric: Vec<[Plane; 3]>,
}

impl Buffers {
    /// Allocates the state of `blocks` blocks, without pose metrics.
    pub fn new(allocator: &mut impl Allocate, blocks: usize, finest: bool) -> Buffers {
        Buffers {
            u: allocator.zeros(blocks),
            value: allocator.zeros(blocks),
            triangle: allocator.zeros(if finest { blocks } else { 0 }),
            metric: Vec::new(),
        }
    }

    /// The state, shared by the items of a job.
    pub fn state(&mut self) -> State {
        State {
            u: SharedSlice::new(&mut self.u),
            value: SharedSlice::new(&mut self.value),
            triangle: SharedSlice::new(&mut self.triangle),
        }
    }
}

/// The memory of one tile's solver.
#[derive(Debug, Default)]
pub(crate) struct Memory {
    /// The blocks that it is for.
    blocks: Weak<Vec<Plane<u32>>>,
    solver: Solver,
    /// Per level.
    pub(super) levels: Vec<Buffers>,
    /// Memory of corrections; empty for the paper's solver.
    pub(super) workspace: Workspace,
    /// Per level; empty for `descent`.
    pub(super) pbd: Vec<PbdBuffers>,
    /// Per triangle, the record of its UVs and pose.
    pub(super) triangles: Vec<TriangleRecord>,
    /// Per triangle, its metric (E, F, G) in the pose.
    pub(super) metrics: Vec<[f32; 3]>,
}

impl Memory {
    /// Allocates the memory for a grid.
    pub fn new(grid: &Arc<Grid>, solver: Solver) -> Memory {
        Memory { blocks: Arc::downgrade(&grid.triangle), ..Memory::construct(&mut Heap, grid, solver) }
    }

    /// Number of bytes that `new` allocates for a grid.
    pub fn bytes_for(grid: &Grid, solver: Solver) -> u64 {
        let mut count = Count::default();
        Memory::construct(&mut count, grid, solver);
        count.bytes
    }

    /// Constructs the memory with an allocator.
    fn construct(allocator: &mut impl Allocate, grid: &Grid, solver: Solver) -> Memory {
        let mut levels = with_capacity(grid.levels.len());
        for (k, level) in grid.levels.iter().enumerate() {
            let blocks = level.blocks.list.len();
            let metric = allocator.zeros(if k > 0 { blocks } else { 0 });
            levels.put(Buffers { metric, ..Buffers::new(allocator, blocks, k == 0) });
        }
        let (workspace, pbd) = match solver {
            Solver::Descent => (Workspace::new(allocator, grid), Vec::new()),
            Solver::Pbd => {
                (Workspace::without_corrections(allocator, grid), PbdBuffers::new(allocator, grid))
            }
        };
        let triangles = allocator.zeros(grid.triangles.len());
        let metrics = allocator.zeros(grid.triangles.len());
        Memory { blocks: Weak::new(), solver, levels, workspace, pbd, triangles, metrics }
    }

    /// Whether this is the memory of the given solver on the given grid (grids of other sizes or maps have other
    /// blocks).
    pub fn is_for(&self, grid: &Arc<Grid>, solver: Solver) -> bool {
        self.solver == solver && self.blocks.upgrade().is_some_and(|own| Arc::ptr_eq(&own, &grid.triangle))
    }
}
