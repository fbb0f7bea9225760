//! The state of one level: its arrays, and how the items of a job share them.

use vrtm_core::allocation::Vec;
use vrtm_core::grid::planes::Plane;
use vrtm_core::team::SharedSlice;

use super::allocate::Allocator;
use super::prefetch::prefetch;

/// The state of one level, and its pose metrics.
#[derive(Debug, Default)]
pub struct Buffers {
    /// Displacements, in cells of this level.
    pub u: Vec<[Plane; 2]>,
    /// Position f(W(p)) on the finest level, metric at W(p) on coarser ones.
    pub value: Vec<[Plane; 3]>,
    /// The triangle under W(p); finest level only. A solve writes it before it reads it.
    pub triangle: Vec<Plane<u32>>,
    /// Pose metrics at the nodes; coarser levels only.
    pub metric: Vec<[Plane; 3]>,
    /// Codes of the nodes' multipliers (`harm`), and whether this solve has weighed the level with them.
    pub multiplier: Vec<Plane<u16>>,
    pub is_weighed: bool,
}

impl Buffers {
    /// Allocates the state of `blocks` blocks, without pose metrics and multipliers.
    pub fn new(allocator: &mut Allocator, blocks: usize, finest: bool) -> Buffers {
        Buffers {
            u: allocator.zeros(blocks),
            value: allocator.zeros(blocks),
            triangle: allocator.zeros(if finest { blocks } else { 0 }),
            metric: Vec::new(),
            multiplier: Vec::new(),
            is_weighed: false,
        }
    }

    /// The state, shared by the items of a job.
    pub fn state(&mut self) -> State {
        State {
            u: SharedSlice::new(&mut self.u),
            value: SharedSlice::new(&mut self.value),
            triangle: SharedSlice::new(&mut self.triangle),
            multiplier: SharedSlice::new(if self.is_weighed { &mut self.multiplier } else { &mut [] }),
        }
    }
}

impl State {
    /// Prefetches the state of the next block.
    #[inline(always)]
    pub fn prefetch(self, b: usize) {
        // By address: another item may be writing the block.
        prefetch(self.u.address(b));
        prefetch(self.value.address(b));
        // Coarser levels have no triangles.
        if !self.triangle.is_empty() {
            prefetch(self.triangle.address(b));
        }
    }
}

/// The state of a level, per block, which sweeps change.
#[derive(Clone, Copy)]
pub struct State {
    /// Displacements, in cells of the level.
    pub u: SharedSlice<[Plane; 2]>,
    /// Position f(W(p)) on the finest level, metric (E, F, G) at W(p) on coarser ones.
    pub value: SharedSlice<[Plane; 3]>,
    /// The triangle under W(p) on the finest level; empty on coarser ones.
    pub triangle: SharedSlice<Plane<u32>>,
    /// Codes of the nodes' multipliers, which sweeps only read; empty where the level is not weighed.
    pub multiplier: SharedSlice<Plane<u16>>,
}
