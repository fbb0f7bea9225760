//! prolong: bilinear interpolation of displacements to the next finer level. A quarter of a bilinear cell has its
//! corner Jacobians inside the cell's own range, so it cannot fold.

use super::lanes::{Kernel, Lanes, Truth, wide};
use crate::mesh::NONE;
use crate::tile::Level;
use crate::tile::blocks::{NODES, Plane, SIDE, slot};
use crate::tile::halo::{self, WINDOW_NODES, Window, place};

/// The coarse nodes over a finer block, and one more on two sides, row by row.
pub type CoarseNodes = [[f32; SIDE / 2 + 1]; SIDE / 2 + 1];

/// The coarse nodes over the finer block `b`, of which `coarse(b)` is the plane of coarse block `b`; `None` if there are
/// none.
#[inline]
pub fn coarse_nodes<'a, T: Copy + Default + Into<f32> + 'a>(
    finer: &Level,
    coarser: &Level,
    coarse: impl Fn(usize) -> &'a Plane<T>,
    b: usize,
) -> Option<CoarseNodes> {
    let parent = finer.parent[b];
    if parent == NONE {
        return None;
    }
    let block = &finer.blocks.list[b];
    let (x, y) = ((block.x % 2) as usize * SIDE / 2, (block.y % 2) as usize * SIDE / 2);
    let mut window: Window<T> = [T::default(); WINDOW_NODES];
    halo::load(&coarser.blocks.around[parent as usize], T::default(), coarse, &mut window);
    let mut nodes = [[0.0; SIDE / 2 + 1]; SIDE / 2 + 1];
    for (j, row) in nodes.iter_mut().enumerate() {
        for (i, node) in row.iter_mut().enumerate() {
            *node = window[place(x + i + 1, y + j + 1)].into();
        }
    }
    Some(nodes)
}

/// Interpolates the coarse values to the finer block `b`, in its own cells, of which a coarse one has two; fixed nodes get
/// 0. `coarse(b, c)` is plane c of coarse block `b`.
pub fn block<'a>(
    finer: &Level,
    coarser: &Level,
    coarse: impl Fn(usize, usize) -> &'a Plane,
    b: usize,
    out: &mut [Plane; 2],
) {
    for (c, plane) in out.iter_mut().enumerate() {
        match coarse_nodes(finer, coarser, |b| coarse(b, c), b) {
            None => *plane = [0.0; NODES],
            Some(nodes) => wide(Interpolate { nodes: &nodes, movable: &finer.movable[b], plane }),
        }
    }
}

/// One quantity of one block.
struct Interpolate<'a> {
    nodes: &'a CoarseNodes,
    movable: &'a Plane<u8>,
    plane: &'a mut Plane,
}

impl Kernel for Interpolate<'_> {
    type Output = ();

    #[inline(always)]
    fn run<V: Lanes>(self) {
        for j in 0..SIDE {
            let (low, high) = (&self.nodes[j / 2], &self.nodes[j / 2 + j % 2]);
            for ci in 0..2 {
                let s = slot(ci, j);
                let low = V::load(low, 0) + V::load(low, ci);
                let high = V::load(high, 0) + V::load(high, ci);
                let movable = V::zero().lt(V::load_u8(self.movable, s));
                let value = (low + high) * 0.5;
                movable.select(value, V::zero()).store(self.plane, s);
            }
        }
    }
}
