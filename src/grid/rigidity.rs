//! Rigidity and mask at the nodes of a square (method §1), from a tile's maps or from values per vertex.

use super::cover::{Cover, Coverer, WIDE, at};
use super::node_set::NodeSet;
use super::vertex_mask;
use crate::grid::maps::{Mask, Rigidity, TileMaps};
use crate::grid::planes::SIDE;
use crate::grid::uv_triangle::UvTriangle;
use crate::image::map::{at_nodes, free_nodes};
use crate::mesh::NONE;

/// The sources of rigidity and mask of a tile, on a grid.
pub(crate) struct NodeRigidity<'a> {
    pub maps: &'a TileMaps,
    pub coverer: &'a Coverer<'a>,
    pub triangles: &'a [UvTriangle],
}

impl NodeRigidity<'_> {
    /// Rigidity at the nodes of a square's window (`cover::at`); 0 at nodes without a triangle.
    pub fn window(&self, square: [u32; 2], cover: &Cover) -> [f32; WIDE * WIDE] {
        let mut rigidity = [0.0; WIDE * WIDE];
        match &self.maps.rigidity {
            Rigidity::None => {}
            Rigidity::Map(map) => {
                let (first, count) = self.nodes(square, 1);
                let values = at_nodes(map, [self.coverer.nx, self.coverer.ny], first, count);
                let place = |axis: usize| first[axis] + 1 - square[axis] as usize * SIDE;
                for (row, line) in values.chunks_exact(count[0]).enumerate() {
                    rigidity[at(place(0), place(1) + row)..][..count[0]].copy_from_slice(line);
                }
                for (value, _) in rigidity.iter_mut().zip(cover.triangle).filter(|(_, t)| *t == NONE) {
                    *value = 0.0;
                }
            }
            Rigidity::Vertices(values) => {
                let place = |k: usize, axis: usize| (square[axis] as usize * SIDE + k) as f32 - 1.0;
                for (n, (value, t)) in rigidity.iter_mut().zip(cover.triangle).enumerate() {
                    if t != NONE {
                        *value =
                            self.on_triangle(values, t as usize, [place(n % WIDE, 0), place(n / WIDE, 1)]);
                    }
                }
            }
        }
        rigidity
    }

    /// The square's nodes that the mask leaves free.
    pub fn free(&self, square: [u32; 2]) -> NodeSet {
        let mask = match &self.maps.mask {
            Mask::None => return NodeSet([u16::MAX; SIDE]),
            Mask::Map(map) => map,
            Mask::Vertices(values) => return vertex_mask::free(self.coverer, values, square),
        };
        let (first, count) = self.nodes(square, 0);
        let values = free_nodes(mask, [self.coverer.nx, self.coverer.ny], first, count);
        let mut free = NodeSet::EMPTY;
        for (n, _) in values.iter().enumerate().filter(|(_, free)| **free) {
            free.insert(n % count[0], n / count[0]);
        }
        free
    }

    /// The nodes of the grid in a square and in a halo of `halo` nodes around it: the first node, and the numbers of
    /// nodes along u and v.
    fn nodes(&self, square: [u32; 2], halo: usize) -> ([usize; 2], [usize; 2]) {
        let start = square.map(|x| x as usize * SIDE);
        let cells = [self.coverer.nx, self.coverer.ny];
        let first = start.map(|x| x.saturating_sub(halo));
        let end = [0, 1].map(|axis| (start[axis] + SIDE + halo).min(cells[axis] + 1));
        (first, [0, 1].map(|axis| end[axis] - first[axis]))
    }

    /// Rigidity per vertex, interpolated linearly on a triangle, at a point in cells.
    fn on_triangle(&self, values: &[f32], t: usize, at: [f32; 2]) -> f32 {
        let uv = &self.triangles[t];
        let offset = [at[0] - uv.origin[0], at[1] - uv.origin[1]];
        let [l1, l2] = uv.barycentric.map(|row| row[0] * offset[0] + row[1] * offset[1]);
        let tile = self.coverer.tile;
        let chart = &tile.charts[self.coverer.charts[t] as usize];
        let [a, b, c] = tile.triangles[t].local.map(|v| values[chart.vertices[v as usize] as usize]);
        (a + l1 * (b - a) + l2 * (c - a)).clamp(0.0, 1.0)
    }
}
