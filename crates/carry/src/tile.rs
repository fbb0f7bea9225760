//! A tile as a result has it, and its warp at points.

use glam::DVec2;

use vrtm_core::grid::Grid;
use vrtm_core::grid::maps::TileMaps;
use vrtm_core::grid::planes::{NODES, Plane, SIDE, slot};
use vrtm_core::mesh::{NONE, TileMesh};
use vrtm_core::settings::Overlap;

#[derive(Clone, Copy, Debug)]
pub struct Tile<'a> {
    /// As it hangs together in the pose.
    pub mesh: &'a TileMesh,
    /// With collars, if it was solved with them.
    pub extended: Option<&'a TileMesh>,
    /// `None` for a tile that was never solved.
    pub grid: Option<&'a Grid>,
    pub maps: &'a TileMaps,
    /// Displacements in cells, per block; none where they are not needed.
    pub u: &'a [[Plane; 2]],
}

impl<'a> Tile<'a> {
    /// The tile with what lies beyond its charts.
    pub fn surface(&self) -> &'a TileMesh {
        self.extended.unwrap_or(self.mesh)
    }

    pub fn cells(&self) -> [usize; 2] {
        self.grid.map_or([1; 2], |grid| [grid.levels[0].nx, grid.levels[0].ny])
    }

    /// The nodes of a chart's cell, (0, 0), (1, 0), (0, 1) and (1, 1), as `node` has them.
    fn corners(&self, chart: u32, i: i64, j: i64) -> [u32; 4] {
        let first = self.node(chart, i, j);
        [(0, 0), (1, 0), (0, 1), (1, 1)].map(|(di, dj)| {
            let [x, y] = [i + di, j + dj];
            match first {
                // Most cells lie in one block.
                _ if first != NONE && x >> 4 == i >> 4 && y >> 4 == j >> 4 => {
                    first - first % NODES as u32 + slot(x as usize % SIDE, y as usize % SIDE) as u32
                }
                _ => self.node(chart, x, y),
            }
        })
    }

    /// The place of a chart's node in the arrays of displacements; `NONE` where nothing is stored.
    pub fn node(&self, chart: u32, i: i64, j: i64) -> u32 {
        let Some(grid) = self.grid else { return NONE };
        let b = grid.levels[0].blocks.find(chart, i >> 4, j >> 4);
        if b == NONE { NONE } else { b * NODES as u32 + slot(i as usize % SIDE, j as usize % SIDE) as u32 }
    }

    fn is_movable(&self, node: u32) -> bool {
        let of = |grid: &Grid| grid.levels[0].movable[node as usize / NODES][node as usize % NODES] != 0;
        node != NONE && self.grid.is_some_and(of)
    }

    /// The triangle under a node of a chart at rest.
    pub fn under(&self, chart: u32, i: i64, j: i64) -> Option<u32> {
        let node = self.node(chart, i, j) as usize;
        let triangle = self.grid?.triangle.get(node / NODES)?[node % NODES];
        (triangle != NONE).then_some(triangle)
    }

    /// A displacement, in cells.
    pub fn displacement(&self, node: u32) -> DVec2 {
        if node == NONE {
            return DVec2::ZERO;
        }
        let ([u, v], s) = (&self.u[node as usize / NODES], node as usize % NODES);
        DVec2::new(u[s].into(), v[s].into())
    }

    /// Weights of the nodes' displacements at a UV of a chart. Where charts share texels that the first face
    /// owns, another chart may move there.
    pub fn mean(&self, chart: u32, uv: DVec2) -> Mean {
        let cells = self.cells().map(|n| n as f64);
        let at = uv * DVec2::from(cells);
        let cell = at.floor().clamp(DVec2::ZERO, DVec2::from(cells) - 1.0);
        let [s, t] = (at - cell).to_array();
        let (i, j) = (cell.x as i64, cell.y as i64);
        let is_inside = |x: f64| (0.0..=1.0).contains(&x);
        let is_upper = s < t;
        let shares = [s.max(t) as f32, s.min(t) as f32];
        let still = Mean { nodes: [NONE; 3], shares, is_upper };
        if !is_inside(s) || !is_inside(t) {
            return still;
        }
        let has_collar = |chart: &u32| !self.surface().charts[*chart as usize].collar.is_empty();
        let shares_texels = self.maps.settings.overlap == Overlap::FirstFace && !has_collar(&chart);
        let others = if shares_texels { self.mesh.charts.len() as u32 } else { 0 };
        std::iter::once(chart)
            .chain((0..others).filter(|other| !has_collar(other)))
            .map(|chart| self.corners(chart, i, j))
            .find(|corners| corners.iter().any(|&node| self.is_movable(node)))
            .map_or(still, |[near, right, above, far]| {
                let third = if is_upper { above } else { right };
                Mean { nodes: [near, third, far], ..still }
            })
    }
}

/// The mean of the displacements of a cell's triangle: of the node at (0, 0), of the third one, and of that at (1, 1).
#[derive(Clone, Copy, Debug)]
pub struct Mean {
    nodes: [u32; 3],
    /// The part of the way to the third node, and that from there to the last.
    shares: [f32; 2],
    /// The third node is (0, 1), not (1, 0).
    is_upper: bool,
}

impl Mean {
    /// Of what never moves.
    pub const STILL: Mean = Mean { nodes: [NONE; 3], shares: [0.0; 2], is_upper: false };

    /// The displacements of the nodes, in cells; `None` where nothing moves.
    #[inline(always)]
    fn displacements(&self, tile: &Tile) -> Option<[DVec2; 3]> {
        if self.nodes == [NONE; 3] {
            return None;
        }
        let all = self.nodes.map(|node| tile.displacement(node));
        (all != [DVec2::ZERO; 3]).then_some(all)
    }

    /// Their mean, in UV.
    #[inline(always)]
    fn mean(&self, [near, third, far]: [DVec2; 3], cells: DVec2) -> DVec2 {
        let [first, second] = self.shares.map(f64::from);
        (near + first * (third - near) + second * (far - third)) / cells
    }

    /// The displacement in UV; `None` where nothing moves.
    #[inline]
    pub fn moved(&self, tile: &Tile) -> Option<DVec2> {
        let cells = DVec2::from(tile.cells().map(|n| n as f64));
        self.displacements(tile).map(|of_nodes| self.mean(of_nodes, cells))
    }

    /// The displacement in UV, and the derivatives of the warp by u and v; `None` where nothing moves.
    #[inline]
    pub fn warp(&self, tile: &Tile) -> Option<(DVec2, [DVec2; 2])> {
        let of_nodes = self.displacements(tile)?;
        let [near, third, far] = of_nodes;
        let [mut du, mut dv] = [third - near, far - third];
        if self.is_upper {
            (du, dv) = (dv, du);
        }
        let [nx, ny] = tile.cells().map(|n| n as f64);
        // By UV, of UV: components along u are in cells of 1/nx, and so are steps along u.
        let (du, dv) = (DVec2::new(1.0 + du.x, du.y * nx / ny), DVec2::new(dv.x * ny / nx, 1.0 + dv.y));
        // A folded cell, which only the paper's solver leaves, says nothing of how its surroundings turn.
        let derivatives = if du.perp_dot(dv) > 0.0 { [du, dv] } else { [DVec2::X, DVec2::Y] };
        Some((self.mean(of_nodes, DVec2::new(nx, ny)), derivatives))
    }
}
