//! The memory of one tile's solver: all arrays that a solve writes. It is kept from one solve to the next.

use std::sync::{Arc, Weak};

use vrtm_core::allocation::Vec;
use vrtm_core::grid::Grid;
use vrtm_core::grid::features::LEVELS;
use vrtm_core::grid::planes::Plane;
use vrtm_core::method::plan::Purpose;
use vrtm_core::settings::Solver;

use super::allocate::Allocator;
use super::buffers::Buffers;
use super::correct::workspace::Workspace;
use super::sampling::record::TriangleRecord;

/// The memory that a level's iterations of the paper's solver need in addition to its state.
#[derive(Debug, Default)]
pub(super) struct PbdBuffers {
    /// The copy of the state that a pass writes.
    pub next: Buffers,
    /// Displacements at the previous integration. The velocity is the difference between the present ones and these.
    pub previous: Vec<[Plane; 2]>,
}

impl PbdBuffers {
    /// Allocates the buffers of all levels.
    pub fn new(allocator: &mut Allocator, grid: &Grid) -> Vec<PbdBuffers> {
        let mut all = Vec::with_capacity(grid.levels.len());
        for (k, level) in grid.levels.iter().enumerate() {
            let blocks = level.blocks.list.len();
            let next = Buffers::new(allocator, blocks, k == 0);
            all.push(PbdBuffers { next, previous: allocator.zeros(blocks) });
        }
        all
    }
}

/// The blocks of one level that take part in a solve: those of the charts that are solved.
#[derive(Debug, Default)]
pub(super) struct Lists {
    /// Active blocks (those with movable nodes), by block colour.
    pub(super) colours: [Vec<u32>; 4],
    /// Active blocks in storage order.
    pub(super) active: Vec<u32>,
    /// All stored blocks: active ones, and inactive ones that hold neighbours of movable nodes.
    pub(super) stored: Vec<u32>,
}

impl Lists {
    pub(super) fn all(&mut self) -> [&mut Vec<u32>; 6] {
        let [a, b, c, d] = &mut self.colours;
        [a, b, c, d, &mut self.active, &mut self.stored]
    }

    /// Copies another level's lists, in the memory of these.
    pub fn copy_from(&mut self, other: &Lists) {
        let others = other.colours.iter().chain([&other.active, &other.stored]);
        for (list, other) in self.all().into_iter().zip(others) {
            list.clear();
            list.extend_from_slice(other);
        }
    }

    /// Keeps the blocks for which `f` is true.
    pub fn retain(&mut self, f: impl Fn(u32) -> bool) {
        self.all().into_iter().for_each(|list| list.retain(|&b| f(b)));
    }
}

/// The memory of one tile's solver.
#[derive(Debug, Default)]
pub struct Memory {
    /// The node planes of the grid that the memory is for, which identify that grid.
    pub(super) blocks: Weak<Vec<Plane<u32>>>,
    pub(super) purpose: Purpose,
    /// State and pose metrics per level.
    pub(super) levels: Vec<Buffers>,
    /// Memory of corrections; empty for the paper's solver.
    pub(super) workspace: Workspace,
    /// Buffers of the paper's solver per level; empty for `descent`.
    pub(super) pbd: Vec<PbdBuffers>,
    /// Per triangle, the record of its UVs and pose.
    pub(super) triangles: Vec<TriangleRecord>,
    /// Per triangle, its metric (E, F, G) in the pose.
    pub(super) metrics: Vec<[f32; 3]>,
    /// Per level, lists of blocks, twice.
    pub(super) lists: [Vec<Lists>; 2],
}

impl Memory {
    /// Allocates the memory for a grid.
    pub fn new(grid: &Arc<Grid>, purpose: Purpose) -> Memory {
        let memory = Memory::construct(&mut Allocator::default(), grid, purpose);
        Memory { blocks: Arc::downgrade(&grid.triangle), ..memory }
    }

    /// Number of bytes that `new` allocates for a grid.
    pub fn bytes_for(grid: &Grid, purpose: Purpose) -> u64 {
        let mut allocator = Allocator { only_counts: true, bytes: 0 };
        Memory::construct(&mut allocator, grid, purpose);
        allocator.bytes
    }

    fn construct(allocator: &mut Allocator, grid: &Grid, purpose: Purpose) -> Memory {
        let mut levels = Vec::with_capacity(grid.levels.len());
        for (k, level) in grid.levels.iter().enumerate() {
            let blocks = level.blocks.list.len();
            let metric = allocator.zeros(if k > 0 { blocks } else { 0 });
            let multiplier = allocator.zeros(if purpose.weighs && k < LEVELS { blocks } else { 0 });
            levels.push(Buffers { metric, multiplier, ..Buffers::new(allocator, blocks, k == 0) });
        }
        let (workspace, pbd) = if purpose.solver == Solver::Pbd {
            (Workspace::default(), PbdBuffers::new(allocator, grid))
        } else {
            (Workspace::new(allocator, grid), Vec::new())
        };
        let triangles = allocator.zeros(grid.triangles.len());
        let metrics = allocator.zeros(grid.triangles.len());
        Memory { purpose, levels, workspace, pbd, triangles, metrics, ..Memory::default() }
    }
}
