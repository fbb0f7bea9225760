//! Rigidity and mask at the nodes of a square (method §1), from maps or from values per vertex. In a collar they are
//! those of the place that the surface has there.

use glam::DVec2;

use super::cover::{Cover, Coverer, at};
use super::node_set::NodeSet;
use super::vertex_mask;
use crate::grid::maps::{MapsOfTile, TileMaps, Values};
use crate::grid::planes::{NODES, SIDE};
use crate::grid::uv_triangle::UvTriangle;
use crate::image::map::{Map, free_nodes, is_free};
use crate::image::resample::{Resampled, at_point};
use crate::mesh::{NONE, TileMesh};

/// The sources of rigidity and mask of a tile, on a grid.
pub struct NodeRigidity<'a> {
    maps: MapsOfTile<'a>,
    tile: &'a TileMesh,
    cells: [usize; 2],
    /// The chart of each triangle.
    charts: &'a [u32],
    triangles: &'a [UvTriangle],
    /// The tile's own map, if it has one.
    map: Option<Resampled<'a>>,
}

impl<'a> NodeRigidity<'a> {
    pub fn new(
        maps: MapsOfTile<'a>,
        tile: &'a TileMesh,
        cells: [usize; 2],
        charts: &'a [u32],
        triangles: &'a [UvTriangle],
    ) -> NodeRigidity<'a> {
        let map = match &maps.own.rigidity {
            Values::Map(map) => Some(Resampled::new(map, cells)),
            _ => None,
        };
        NodeRigidity { maps, tile, cells, charts, triangles, map }
    }

    /// True if rigidity is the map's wherever a triangle is.
    pub fn is_map_alone(&self) -> bool {
        self.map.is_some() && self.tile.own() == self.tile.triangles.len()
    }

    /// Rigidity at the nodes of a square, row by row; 0 at nodes for which `triangle` has none.
    pub fn at_square(&self, square: [u32; 2], triangle: impl Fn(usize) -> u32) -> [f32; NODES] {
        let mut rigidity = match &self.map {
            Some(_) => self.map_at_square(square),
            None => [0.0; NODES],
        };
        let place = |k: usize, axis: usize| (square[axis] as usize * SIDE + k) as f32;
        let node = |n: usize| [place(n % SIDE, 0), place(n / SIDE, 1)];
        let own = self.tile.own() as u32;
        for (n, value) in rigidity.iter_mut().enumerate() {
            let t = triangle(n);
            if t == NONE {
                *value = 0.0;
                continue;
            }
            if let Values::Vertices(values) = &self.maps.own.rigidity {
                *value = self.on_triangle(values, t as usize, node(n));
            }
            if t >= own {
                *value = self.in_collar(t, node(n)).unwrap_or(*value);
            }
        }
        rigidity
    }

    /// The tile's map at the nodes of a square, row by row, whatever triangles are there; 0 without a map.
    pub fn map_at_square(&self, square: [u32; 2]) -> [f32; NODES] {
        let mut rigidity = [0.0; NODES];
        if let Some(map) = &self.map {
            let (first, count) = self.nodes(square);
            map.at_nodes(first, count, |i, j, value| rigidity[j * SIDE + i] = value);
        }
        rigidity
    }

    /// Rigidity at a point of a collar.
    fn in_collar(&self, t: u32, at: [f32; 2]) -> Option<f32> {
        let (maps, uv) = self.beyond(t, at)?;
        Some(match &maps.rigidity {
            Values::None => 0.0,
            Values::Map(map) => at_point(map, maps.grid_size(), uv),
            Values::Vertices(values) => self.on_triangle(values, t as usize, at),
        })
    }

    /// The square's nodes that the mask leaves free.
    pub fn free(&self, coverer: &Coverer, square: usize, cover: &Cover) -> NodeSet {
        let at_square = coverer.squares.list[square].at;
        let mut free = match &self.maps.own.mask {
            Values::None => NodeSet([u16::MAX; SIDE]),
            Values::Map(map) => self.free_in(map, at_square),
            Values::Vertices(values) => return vertex_mask::free(coverer, values, square),
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
        let (first, count) = self.nodes(square);
        let mut free = NodeSet::EMPTY;
        free_nodes(mask, self.cells, first, count, |i, j| free.insert(i, j));
        free
    }

    /// The nodes of the grid in a square: the first node, and the numbers of nodes along u and v.
    fn nodes(&self, square: [u32; 2]) -> ([usize; 2], [usize; 2]) {
        let first = square.map(|x| x as usize * SIDE);
        (first, [0, 1].map(|axis| SIDE.min((self.cells[axis] + 1).saturating_sub(first[axis]))))
    }

    /// If a triangle belongs to a collar: the maps of the tile in which the surface has it, and the UV there of a point
    /// in cells.
    fn beyond(&self, triangle: u32, at: [f32; 2]) -> Option<(&TileMaps, [f64; 2])> {
        if triangle == NONE {
            return None;
        }
        let source = self.tile.source(triangle as usize)?;
        let [l1, l2] = self.triangles[triangle as usize].barycentrics(at).map(f64::from);
        let [a, b, c]: [DVec2; 3] = source.uv;
        Some((self.maps.of(source.tile)?, (a + l1 * (b - a) + l2 * (c - a)).into()))
    }

    /// Rigidity per vertex, interpolated linearly on a triangle, at a point in cells.
    fn on_triangle(&self, values: &[f32], t: usize, at: [f32; 2]) -> f32 {
        let chart = &self.tile.charts[self.charts[t] as usize];
        let value = |v: u32| chart.value(v, |v| [f64::from(values[v as usize])])[0] as f32;
        self.triangles[t].interpolate(self.tile.triangles[t].local.map(value), at).clamp(0.0, 1.0)
    }
}
