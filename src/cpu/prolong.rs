//! prolong: bilinear interpolation of displacements to the next finer level. A quarter of a bilinear cell has its
//! corner Jacobians inside the cell's own range, so it cannot fold.

use crate::mesh::NONE;
use crate::tile::Level;
use crate::tile::blocks::{NODES, Plane, SIDE, node_at};
use crate::tile::halo::{self, WINDOW_NODES, Window, place};

/// Interpolates the coarse values to the finer block `b`, times `factor`; fixed nodes get 0. `coarse(b)` is the plane
/// of coarse block `b`.
pub fn block<'a>(
    finer: &Level,
    coarser: &Level,
    coarse: impl Fn(usize, usize) -> &'a Plane,
    b: usize,
    factor: f32,
    out: &mut [Plane; 2],
) {
    let parent = finer.parent[b];
    let mut window: Window = [0.0; WINDOW_NODES];
    for (c, plane) in out.iter_mut().enumerate() {
        *plane = [0.0; NODES];
        if parent == NONE {
            continue;
        }
        halo::load(&coarser.blocks.around[parent as usize], 0.0, |b| coarse(b, c), &mut window);
        let block = &finer.blocks.list[b];
        let (x, y) = ((block.x % 2) as usize * SIDE / 2, (block.y % 2) as usize * SIDE / 2);
        for (s, value) in plane.iter_mut().enumerate() {
            if finer.movable[b][s] == 0 {
                continue;
            }
            let (i, j) = node_at(s);
            let (x0, y0) = (x + i / 2 + 1, y + j / 2 + 1);
            let (x1, y1) = (x0 + i % 2, y0 + j % 2);
            let low = window[place(x0, y0)] + window[place(x1, y0)];
            let high = window[place(x0, y1)] + window[place(x1, y1)];
            *value = (low + high) * (0.25 * factor);
        }
    }
}
