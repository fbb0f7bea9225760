//! Charts that go on beyond their seams have their surfaces in common there: each says where a point goes. Their warps
//! are blended, so that both sides of a seam say the same.
//!
//! The part that each warp has of the blend depends on the place on the surface alone: at a seam all charts that meet
//! there have equal parts, and a chart's part falls to nothing where its collar ends (method §16).

mod copies;
mod depths;
mod limit;
mod nodes;
mod places;

use std::sync::Arc;

use glam::DVec2;

pub use copies::Copies;
use copies::{Node, NodeCopy};
pub use depths::Depths;
use depths::smooth;
pub use limit::Limited;
pub use places::Places;
use vrtm_core::grid::planes::{NODES, Plane, slot};
use vrtm_core::grid::{Grid, Level};
use vrtm_core::mesh::triangle::{barycentrics, point};
use vrtm_core::mesh::{NONE, TileMesh};
use vrtm_core::team::Team;

/// A tile's result, as it was solved.
pub struct Side<'a> {
    pub tile: &'a Arc<TileMesh>,
    pub grid: &'a Grid,
    pub u: &'a [[Plane; 2]],
}

/// Blends the warp of a tile with those of what its charts have in common with others. `sides` are the results of all
/// tiles of the mesh, if they are there. Places of one point that are `farthest` apart, in UV, are no longer brought
/// together.
pub fn blend(
    team: &Team,
    places: &Places,
    copies: &Copies,
    sides: &[Option<Side>],
    tile: usize,
    farthest: f64,
) -> Option<Limited> {
    let side = sides[tile].as_ref()?;
    let blocks = copies.blocks();
    let blending = Blending { places, sides, tile, farthest };
    let changes = team.map(blocks.len(), |k| {
        let mut change: [Plane; 2] = [[0.0; NODES]; 2];
        for node in copies.of_block(k) {
            let moved = blending.change(side, blocks[k], node, copies.of_node(node));
            let s = node.slot as usize;
            [change[0][s], change[1][s]] = moved.to_array().map(|x| x as f32);
        }
        change
    });
    Some(limit::add(team, &side.grid.levels[0], side.u, blocks, &changes))
}

struct Blending<'a> {
    places: &'a Places,
    sides: &'a [Option<Side<'a>>],
    tile: usize,
    farthest: f64,
}

impl Blending<'_> {
    /// By how much the blend moves a node further, in cells.
    fn change(&self, side: &Side, block: u32, node: &Node, copies: &[NodeCopy]) -> DVec2 {
        let level = &side.grid.levels[0];
        let of_block = &level.blocks.list[block as usize];
        let s = node.slot as usize;
        let at = nodes::place_of(level, block as usize, s);
        let moved = DVec2::from(side.u[block as usize].each_ref().map(|plane| f64::from(plane[s])));
        let cells = level.cells();
        let mut change = DVec2::ZERO;
        for copy in copies {
            let there = self.through(copy, of_block.chart, side.grid.triangle[block as usize][s], at / cells);
            if let Some(there) = there {
                let apart = there - (at + moved) / cells;
                // A place far away is on another sheet of the surface.
                let near = smooth(2.0 - 2.0 * (apart.length() / self.farthest) as f32);
                change += f64::from(copy.part * near) * (apart * cells);
            }
        }
        f64::from(node.fade) * change
    }

    /// Target of a copy under its chart's warp, as a UV in the plane of the chart of the node, which lies at
    /// `at` on the triangle `home`.
    fn through(&self, copy: &NodeCopy, chart: u32, home: u32, at: DVec2) -> Option<DVec2> {
        let there = self.sides[copy.tile as usize].as_ref()?;
        let triangle = &there.tile.triangles[copy.triangle as usize];
        let from = point(triangle.uv, copy.at.map(f64::from));
        let level = &there.grid.levels[0];
        let of_chart = there.grid.chart_of[copy.triangle as usize];
        let moved = displacement(level, there.u, of_chart, copy.block, from * level.cells());
        if moved == DVec2::ZERO {
            return Some(at);
        }
        let to = from + moved / level.cells();
        let here = self.sides[self.tile].as_ref()?;
        let index = self.tile as u32;
        let exactly = || {
            let end = walk(there.tile, copy.triangle, to)?;
            let mut place = places::on_surface(there.tile, copy.tile, end, to);
            place.image ^= copy.mirrored;
            self.places.in_chart(here.tile, index, chart, home, place, at)
        };
        // Beyond the end of either collar, as if the triangle of the node went on.
        let nearly = || {
            let place = places::on_surface(there.tile, copy.tile, copy.triangle, to);
            places::seen_by(here.tile, index, home, place).map(|(_, uv)| uv)
        };
        exactly().or_else(nearly)
    }
}

/// Displacement of a chart's warp at a point, both in cells: affine on the two triangles of each cell (method §9).
/// `holder` is the block of the cell's lower left node, or a neighbour.
fn displacement(level: &Level, u: &[[Plane; 2]], chart: u32, holder: u32, at: DVec2) -> DVec2 {
    let cell = at.floor();
    let (i, j) = (cell.x as i64, cell.y as i64);
    let node = |i: i64, j: i64| {
        let b = match holder {
            NONE => level.blocks.find(chart, i >> 4, j >> 4),
            holder => level.blocks.holding(holder as usize, i, j),
        };
        if b == NONE {
            return DVec2::ZERO;
        }
        let s = slot((i & 15) as usize, (j & 15) as usize);
        DVec2::from(u[b as usize].each_ref().map(|plane| f64::from(plane[s])))
    };
    let DVec2 { x: s, y: t } = at - cell;
    let (near, far) = (node(i, j), node(i + 1, j + 1));
    let (third, first, second) = if s >= t { (node(i + 1, j), s, t) } else { (node(i, j + 1), t, s) };
    near + first * (third - near) + second * (far - third)
}

/// Barycentric coordinates of at least minus this count as inside.
const SLACK: f64 = 1e-9;
const STEPS: usize = 256;

/// The triangle of the same chart that contains a point, found across sides from `start`. `None` beyond the chart.
fn walk(tile: &TileMesh, start: u32, at: DVec2) -> Option<u32> {
    let mut t = start;
    for _ in 0..STEPS {
        let triangle = &tile.triangles[t as usize];
        let [s, r] = barycentrics(triangle.uv, at);
        let inside = [1.0 - s - r, s, r];
        let beyond = (0..3).filter(|&k| inside[k] < -SLACK && triangle.neighbours[k] != NONE);
        match beyond.min_by(|&a, &b| inside[a].total_cmp(&inside[b])) {
            Some(k) => t = triangle.neighbours[k],
            None => return inside.iter().all(|&x| x >= -SLACK).then_some(t),
        }
    }
    None
}
