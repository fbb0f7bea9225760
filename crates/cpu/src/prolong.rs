//! prolong: sets the initial state of a level. Displacements are interpolated bilinearly from the next coarser level;
//! this cannot fold, because the corner Jacobians of a quarter of a bilinear cell lie between the least and the
//! greatest of the whole cell (method §3). The coarsest level starts from the identity, a warm start from the previous
//! result (method §5).

use super::lanes::{Lanes, Mask, Vectorised, dispatch};
use super::run::Run;
use super::sampling::resample::Start;
use vrtm_core::allocation::Vec;
use vrtm_core::grid::Grid;
use vrtm_core::grid::planes::{NODES, Plane, SIDE, slot};
use vrtm_core::grid::window::{self, place};
use vrtm_core::mesh::NONE;
use vrtm_core::team::SharedSlice;

impl Run<'_> {
    /// Sets a level to the identity.
    pub(super) fn start_from_identity(&mut self, level: usize) {
        let state = self.memory.levels[level].state();
        let set = |_, u: &mut _| *u = [[0.0; NODES]; 2];
        self.move_and_resample(level, state, &self.work[level].stored, Start::Identity, set);
        if level == 0 {
            self.store_identity_energy(0);
            self.sum_identity();
        }
    }

    /// Sets the finest level to the previous result.
    pub(super) fn start_from_previous(&mut self) {
        self.start_from_identity(0);
        let (state, anchor) = (self.memory.levels[0].state(), self.anchor);
        let set = |b, u: &mut _| *u = anchor[b];
        self.move_and_resample(0, state, &self.work[0].active, Start::Nearest, set);
    }

    /// Sets a level to displacements interpolated from the next coarser level.
    pub(super) fn prolong_level(&mut self, level: usize) {
        if level == 0 {
            // This also computes the energy of the identity.
            self.start_from_identity(level);
        } else {
            let inactive = self.zero_inactive_blocks(level);
            let state = self.memory.levels[level].state();
            self.resample(level, state, &inactive, Start::Identity);
        }
        self.interpolate_active_blocks(level);
        let state = self.memory.levels[level].state();
        self.resample(level, state, &self.work[level].active, Start::Nearest);
    }

    /// Interpolates the displacements alone, for a level whose samples are not needed.
    pub(super) fn interpolate_level(&mut self, level: usize) {
        self.zero_inactive_blocks(level);
        self.interpolate_active_blocks(level);
    }

    fn interpolate_active_blocks(&mut self, level: usize) {
        let (finer, coarser) = self.memory.levels.split_at_mut(level + 1);
        let coarse = &coarser[0].u;
        let u = SharedSlice::new(&mut finer[level].u);
        let (fine_level, blocks) = (&self.grid.levels[level], &self.work[level].active);
        self.team.run(blocks.len(), |k| {
            let b = blocks[k] as usize;
            let nodes = coarse_nodes::<_, 2>(self.grid, level, b, |b, c| &coarse[b][c]);
            // SAFETY: each item has its own block.
            for (c, plane) in unsafe { u.get_mut(b) }.iter_mut().enumerate() {
                match &nodes {
                    None => *plane = [0.0; NODES],
                    Some(nodes) => {
                        dispatch(Interpolate { nodes: &nodes[c], movable: &fine_level.movable[b], plane })
                    }
                }
            }
        });
    }

    /// Sets the displacements of a level's stored inactive blocks to 0, since no stage visits them, and returns these
    /// blocks.
    fn zero_inactive_blocks(&mut self, level: usize) -> Vec<u32> {
        let list = &self.grid.levels[level].blocks.list;
        let inactive: Vec<u32> =
            self.work[level].stored.iter().copied().filter(|&b| !list[b as usize].active).collect();
        for &b in &inactive {
            self.memory.levels[level].u[b as usize] = [[0.0; NODES]; 2];
        }
        inactive
    }
}

/// Coarse nodes on a side over a fine block and its halo: the 8 over the block, and one on each side.
pub const REACH: usize = SIDE / 2 + 2;

/// Values at the coarse nodes (-1..=8, -1..=8) over a fine block, row-major.
pub type CoarseNodes = [[f32; REACH]; REACH];

/// Gathers values at the coarse nodes over the fine block `b` of level `finer`; `coarse(b, c)` is plane `c` of coarse
/// block `b`. `None` if no coarse block is stored over the fine one.
pub fn coarse_nodes<'a, T: Copy + Default + Into<f32> + 'a, const N: usize>(
    grid: &Grid,
    finer: usize,
    b: usize,
    coarse: impl Fn(usize, usize) -> &'a Plane<T>,
) -> Option<[CoarseNodes; N]> {
    let (fine_level, coarse_level) = (&grid.levels[finer], &grid.levels[finer + 1]);
    let (parent, block) = (fine_level.parent[b], &fine_level.blocks.list[b]);
    if parent == NONE {
        return None;
    }
    let (x, y) = ((block.x % 2) as usize * SIDE / 2, (block.y % 2) as usize * SIDE / 2);
    let mut nodes = [[[0.0; REACH]; REACH]; N];
    for (c, nodes) in nodes.iter_mut().enumerate() {
        let neighbours = &coarse_level.blocks.neighbours[parent as usize];
        let window = window::of(neighbours, T::default(), |b| coarse(b, c));
        for (j, row) in nodes.iter_mut().enumerate() {
            for (i, node) in row.iter_mut().enumerate() {
                *node = window[place(x + i, y + j)].into();
            }
        }
    }
    Some(nodes)
}

/// Interpolates one component of the displacements of one block bilinearly, multiplied by 2 for the change of cell
/// units; fixed nodes get 0.
struct Interpolate<'a> {
    nodes: &'a CoarseNodes,
    movable: &'a Plane<u8>,
    plane: &'a mut Plane,
}

impl Vectorised for Interpolate<'_> {
    type Output = ();

    #[inline(always)]
    fn run<V: Lanes>(self) {
        for j in 0..SIDE {
            // The first coarse column and row lie beside the block.
            let (low, high) = (&self.nodes[j / 2 + 1], &self.nodes[j / 2 + j % 2 + 1]);
            for ci in 0..2 {
                let s = slot(ci, j);
                let low = V::load(low, 1) + V::load(low, 1 + ci);
                let high = V::load(high, 1) + V::load(high, 1 + ci);
                let movable = V::zero().lt(V::load_u8(self.movable, s));
                let value = (low + high) * 0.5;
                movable.select(value, V::zero()).store(self.plane, s);
            }
        }
    }
}
