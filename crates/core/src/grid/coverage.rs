//! Coverage, rigidity and mobility at all nodes of a tile, row by row, for the measurement of strain. The memory grows
//! with the size of the tile.

use super::cover::{Coverer, at};
use super::rigidity::NodeRigidity;
use super::survey::Survey;
use crate::allocation::{Vec, vec, zeroed};
use crate::grid::maps::{MapsOfTile, TileMaps};
use crate::grid::planes::SIDE;
use crate::mesh::{NONE, TileMesh};
use crate::team::Team;

/// Coverage, rigidity and mobility at all nodes of a grid of nx by ny cells. Node (i, j) lies at UV (i / nx, j / ny),
/// and has the index `j * (nx + 1) + i`.
#[derive(Debug, Default)]
pub struct NodeMaps {
    pub nx: usize,
    pub ny: usize,
    /// The triangle under each node, or `NONE`.
    pub triangle: Vec<u32>,
    /// True for nodes whose four cells all lie in the tile and inside one chart.
    pub interior: Vec<bool>,
    /// 0 at nodes without a triangle.
    pub rigidity: Vec<f32>,
    /// The chart of a movable node, `NONE` for a fixed one.
    pub chart: Vec<u32>,
}

/// The nodes of a tile on a grid of nx by ny cells.
pub fn node_maps(tile: &TileMesh, maps: &TileMaps, [nx, ny]: [usize; 2]) -> NodeMaps {
    let survey = Team::with(1, |team| Survey::new(team, tile, MapsOfTile::alone(maps), [nx, ny]));
    let rigidity = survey.rigidity(MapsOfTile::alone(maps));
    node_maps_of(&rigidity, &survey)
}

/// The nodes of a surveyed tile.
pub(super) fn node_maps_of(source: &NodeRigidity, survey: &Survey) -> NodeMaps {
    let Coverer { nx, ny, squares, .. } = &survey.coverer;
    let nodes = (nx + 1) * (ny + 1);
    let mut maps = NodeMaps {
        nx: *nx,
        ny: *ny,
        triangle: vec![NONE; nodes],
        interior: zeroed(nodes),
        rigidity: zeroed(nodes),
        chart: vec![NONE; nodes],
    };
    for square in 0..squares.list.len() {
        let cover = survey.coverer.cover(square);
        let values = source.at_square(squares.list[square].at, |n| cover.triangle_at(n));
        each_node(squares.list[square].at, *nx, *ny, |i, j, node| {
            maps.triangle[node] = cover.triangle[at(i + 1, j + 1)];
            maps.interior[node] = cover.interior.contains(i, j);
            maps.rigidity[node] = values[j * SIDE + i];
        });
    }
    let level = &survey.levels[0];
    for (block, movable) in level.blocks.list.iter().zip(&level.movable) {
        each_node([block.x, block.y], *nx, *ny, |i, j, node| {
            if movable.contains(i, j) {
                maps.chart[node] = block.chart;
            }
        });
    }
    maps
}

/// Calls `f(i, j, index)` for the nodes (i, j) of a square that lie in the grid; `index` is the node's index in the
/// grid.
fn each_node([x, y]: [u32; 2], nx: usize, ny: usize, mut f: impl FnMut(usize, usize, usize)) {
    let (x, y) = (x as usize * SIDE, y as usize * SIDE);
    for j in 0..SIDE.min(ny + 1 - y) {
        for i in 0..SIDE.min(nx + 1 - x) {
            f(i, j, (y + j) * (nx + 1) + x + i);
        }
    }
}
