//! The memory of one tile's solver: what a solve changes, kept from one solve to the next.

use std::sync::{Arc, Weak};

use crate::mesh::NONE;
use crate::tile::Grid;
use crate::tile::blocks::{NODES, Plane};

use super::correct::Systems;
use super::patch::State;
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
    pub(super) levels: Vec<Buffers>,
    pub(super) systems: Systems,
    pub(super) triangles: Vec<Record>,
    pub(super) metrics: Vec<[f32; 3]>,
}

impl Memory {
    /// Allocates for a grid.
    pub fn new(grid: &Arc<Grid>) -> Memory {
        let mut levels: Vec<Buffers> = Vec::with_capacity(grid.levels.len());
        for (k, level) in grid.levels.iter().enumerate() {
            let n = level.blocks.list.len();
            levels.push(Buffers {
                u: vec![[[0.0; NODES]; 2]; n],
                value: vec![[[0.0; NODES]; 3]; n],
                triangle: if k == 0 { vec![[NONE; NODES]; n] } else { Vec::new() },
                metric: if k > 0 { vec![[[0.0; NODES]; 3]; n] } else { Vec::new() },
            });
        }
        Memory {
            grid: Arc::downgrade(grid),
            levels,
            systems: Systems::new(grid),
            triangles: vec![Record::default(); grid.triangles.len()],
            metrics: vec![[0.0; 3]; grid.triangles.len()],
        }
    }

    /// Bytes that `new` takes for a grid.
    pub fn bytes_for(grid: &Grid) -> u64 {
        let plane = NODES * 4;
        let levels: usize =
            grid.levels.iter().map(|level| level.blocks.list.len() * (2 + 3 + 3) * plane).sum();
        // The finest level has triangles where the others have metrics.
        let finest = grid.levels[0].blocks.list.len() * 2 * plane;
        let triangles = grid.triangles.len() * (size_of::<Record>() + 12);
        (levels - finest + triangles) as u64 + Systems::bytes_for(grid)
    }

    /// True if this is the memory of a grid (grids of other sizes or maps have other blocks).
    pub fn is_for(&self, grid: &Arc<Grid>) -> bool {
        self.grid.upgrade().is_some_and(|own| Arc::ptr_eq(&own, grid))
    }
}
