//! The constants of a grid, which do not depend on the pose, in the layout of the shaders: blocks, nodes, triangles.

use super::bands::Band;
use super::layout::{BlockRecord, NODE_PLANES, Triangle};
use crate::memory::{Collect, Grow, with_capacity};
use crate::mesh::{NONE, TileMesh};
use crate::tile::blocks::NODES;
use crate::tile::codes::decode_rigidity;
use crate::tile::{Grid, Level};

/// Records of the blocks that a band of level `k` holds.
pub fn band_blocks(grid: &Grid, bands: &[Vec<Band>], k: usize, band: &Band) -> Vec<BlockRecord> {
    let level = &grid.levels[k];
    let list = &level.blocks.list;
    let coarser = bands.get(k + 1).map(|bands| &bands[band.coarser]);
    let finer = k.checked_sub(1).map(|k| &bands[k][band.finer.clone()]);
    band.held
        .clone()
        .map(|b| {
            let block = &list[b];
            let neighbours = level.blocks.neighbours[b];
            let active = neighbours.map(|b| if b != NONE && list[b as usize].active { b } else { NONE });
            let children = level.children[b].map(|child| {
                let band =
                    finer.and_then(|bands| bands.iter().find(|band| band.owned.contains(&(child as usize))));
                band.map_or(NONE, |band| band.place(child))
            });
            let chart = level.blocks.of_chart[block.chart as usize].clone();
            let (first, end) = (chart.start.max(band.held.start), chart.end.min(band.held.end));
            BlockRecord {
                neighbours: neighbours.map(|b| band.place(b)),
                active_neighbours: active.map(|b| band.place(b)),
                chart: block.chart,
                x: block.x,
                y: block.y,
                is_active: u32::from(block.active),
                parent: coarser.map_or(NONE, |coarser| coarser.place(level.parent[b])),
                children,
                chart_first: (first - band.held.start) as u32,
                chart_count: (end - first) as u32,
                continues: u32::from(chart.start < first) + 2 * u32::from(chart.end > end),
            }
        })
        .collected()
}

/// The constants of the nodes of the blocks that a band holds: `NODE_PLANES` planes per block.
pub fn constants(grid: &Grid, level: &Level, k: usize, band: &Band) -> Vec<u32> {
    let mut all = with_capacity(band.held.len() * NODE_PLANES * NODES);
    for b in band.held.clone() {
        let rigidity = level.rigidity[b].iter().zip(&level.movable[b]);
        all.put_all(
            rigidity.map(|(&r, &movable)| decode_rigidity(r).to_bits() | u32::from(movable == 0) << 31),
        );
        let lengths = level.lengths[level.blocks.list[b].chart as usize];
        for (plane, lengths) in level.rest_length[b].iter().zip(lengths) {
            all.put_all(plane.iter().map(|&code| lengths.length(code).to_bits()));
        }
        if k == 0 {
            all.put_all(grid.triangle[b]);
        } else {
            all.put_all(level.coverage[b].iter().map(|coverage| coverage.to_bits()));
        }
        match level.density.get(b) {
            Some(plane) => all.put_all(plane.iter().map(|density| density.to_bits())),
            None => all.put_all([0; NODES]),
        }
    }
    all
}

/// The triangles, with poses of 0.
pub fn triangles(grid: &Grid) -> Vec<Triangle> {
    grid.triangles
        .iter()
        .zip(grid.chart_of.iter())
        .map(|(t, &chart)| {
            let [[a, b], [c, d]] = t.barycentric;
            Triangle {
                corner: t.origin,
                barycentric: [a, b, c, d],
                neighbours: t.neighbours,
                chart,
                pose: [0.0; 9],
            }
        })
        .collected()
}

/// Per triangle, the indices of its three vertices among the vertices of all charts.
pub fn corners(grid: &Grid, tile: &TileMesh) -> Vec<u32> {
    let mut first_vertex = with_capacity(tile.charts.len());
    let mut vertices = 0u32;
    for chart in &tile.charts {
        first_vertex.put(vertices);
        vertices += chart.vertices.len() as u32;
    }
    tile.triangles
        .iter()
        .zip(grid.chart_of.iter())
        .flat_map(|(triangle, &chart)| triangle.local.map(|v| first_vertex[chart as usize] + v))
        .collected()
}
