//! Rigidity and mask at the nodes of a square (method §1), from maps or from values per vertex. In a collar they are those
//! of the place that the surface has there.

use glam::DVec2;

use super::cover::{Cover, Coverer, WIDE, at};
use super::node_set::NodeSet;
use super::vertex_mask;
use crate::grid::maps::{MapsOfTile, TileMaps, Values};
use crate::grid::planes::SIDE;
use crate::grid::uv_triangle::UvTriangle;
use crate::image::map::{Map, at_nodes, at_point, free_nodes, is_free};
use crate::mesh::NONE;

/// The sources of rigidity and mask of a tile, on a grid.
pub struct NodeRigidity<'a> {
    pub maps: MapsOfTile<'a>,
    pub coverer: &'a Coverer<'a>,
    pub triangles: &'a [UvTriangle],
}

impl NodeRigidity<'_> {
    /// Rigidity at the nodes of a square's window (`cover::at`); 0 at nodes without a triangle.
    pub fn window(&self, square: [u32; 2], cover: &Cover) -> [f32; WIDE * WIDE] {
        let mut rigidity = [0.0; WIDE * WIDE];
        let place = |k: usize, axis: usize| (square[axis] as usize * SIDE + k) as f32 - 1.0;
        let node = |n: usize| [place(n % WIDE, 0), place(n / WIDE, 1)];
        match &self.maps.own.rigidity {
            Values::None => {}
            Values::Map(map) => {
                let (first, count) = self.nodes(square, 1);
                let place = |axis: usize| first[axis] + 1 - square[axis] as usize * SIDE;
                let mut put =
                    |i: usize, j: usize, value: f32| rigidity[at(place(0) + i, place(1) + j)] = value;
                at_nodes(map, [self.coverer.nx, self.coverer.ny], first, count, &mut put);
                for (value, _) in rigidity.iter_mut().zip(cover.triangle).filter(|(_, t)| *t == NONE) {
                    *value = 0.0;
                }
            }
            Values::Vertices(values) => {
                for (n, (value, t)) in rigidity.iter_mut().zip(cover.triangle).enumerate() {
                    if t != NONE {
                        *value = self.on_triangle(values, t as usize, node(n));
                    }
                }
            }
        }
        let tile = self.coverer.tile;
        if tile.own() == tile.triangles.len() {
            // There are no collars.
            return rigidity;
        }
        for (n, (value, t)) in rigidity.iter_mut().zip(cover.triangle).enumerate() {
            if let Some((maps, uv)) = self.beyond(t, node(n)) {
                *value = match &maps.rigidity {
                    Values::None => 0.0,
                    Values::Map(map) => at_point(map, maps.grid_size(), uv),
                    Values::Vertices(values) => self.on_triangle(values, t as usize, node(n)),
                };
            }
        }
        rigidity
    }

    /// The square's nodes that the mask leaves free.
    pub fn free(&self, square: usize, cover: &Cover) -> NodeSet {
        let at_square = self.coverer.squares.list[square].at;
        let mut free = match &self.maps.own.mask {
            Values::None => NodeSet([u16::MAX; SIDE]),
            Values::Map(map) => self.free_in(map, at_square),
            Values::Vertices(values) => return vertex_mask::free(self.coverer, values, square),
        };
        let place = |k: usize, axis: usize| (at_square[axis] as usize * SIDE + k) as f32;
        for (i, j) in (0..SIDE * SIDE).map(|n| (n % SIDE, n / SIDE)) {
            let triangle = cover.triangle[at(i + 1, j + 1)];
            if let Some((maps, uv)) = self.beyond(triangle, [place(i, 0), place(j, 1)]) {
                let is_fixed = matches!(&maps.mask, Values::Map(map) if !is_free(map, maps.grid_size(), uv));
                if is_fixed { free.remove(i, j) } else { free.insert(i, j) }
            }
        }
        free
    }

    fn free_in(&self, mask: &Map, square: [u32; 2]) -> NodeSet {
        let (first, count) = self.nodes(square, 0);
        let mut free = NodeSet::EMPTY;
        free_nodes(mask, [self.coverer.nx, self.coverer.ny], first, count, |i, j| free.insert(i, j));
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

    /// If a triangle belongs to a collar: the maps of the tile in which the surface has it, and the UV there of a point in
    /// cells.
    fn beyond(&self, triangle: u32, at: [f32; 2]) -> Option<(&TileMaps, [f64; 2])> {
        if triangle == NONE {
            return None;
        }
        let source = self.coverer.tile.source(triangle as usize)?;
        let [l1, l2] = self.triangles[triangle as usize].barycentrics(at).map(f64::from);
        let [a, b, c]: [DVec2; 3] = source.uv;
        Some((self.maps.of(source.tile)?, (a + l1 * (b - a) + l2 * (c - a)).into()))
    }

    /// Rigidity per vertex, interpolated linearly on a triangle, at a point in cells.
    fn on_triangle(&self, values: &[f32], t: usize, at: [f32; 2]) -> f32 {
        let tile = self.coverer.tile;
        let chart = &tile.charts[self.coverer.charts[t] as usize];
        let value = |v: u32| chart.value(v, |v| [f64::from(values[v as usize])])[0] as f32;
        self.triangles[t].interpolate(tile.triangles[t].local.map(value), at).clamp(0.0, 1.0)
    }
}
