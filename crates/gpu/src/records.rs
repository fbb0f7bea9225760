//! A grid's records in the layout of the shaders: the data of its blocks, nodes and triangles that do not depend on the
//! pose.

use std::ops::Range;

use super::layout::{BlockRecord, Triangle, node_planes};
use vrtm_core::allocation::Vec;
use vrtm_core::grid::blocks::{Block, Blocks};
use vrtm_core::grid::features::Pieces;
use vrtm_core::grid::planes::NODES;
use vrtm_core::grid::{Grid, Level};
use vrtm_core::mesh::{NONE, TileMesh};

/// Records of some blocks of level `k`.
pub fn block_records(grid: &Grid, k: usize, blocks: Range<usize>) -> Vec<BlockRecord> {
    let level = &grid.levels[k];
    let list = &level.blocks.list;
    let record = |b: usize| {
        let block = &list[b];
        let neighbours = level.blocks.neighbours[b];
        let (parents, active_parents) = match grid.levels.get(k + 1) {
            Some(coarser) => parents(&coarser.blocks, level.parent[b], block),
            None => ([NONE; 4], 0),
        };
        let chart = &level.blocks.of_chart[block.chart as usize];
        let lengths = level.lengths[block.chart as usize];
        BlockRecord {
            neighbours,
            active_neighbours: neighbours
                .map(|b| if b != NONE && list[b as usize].active { b } else { NONE }),
            chart: block.chart,
            x: block.x,
            y: block.y,
            is_active: u32::from(block.active),
            parents,
            active_parents,
            children: level.children[b],
            chart_first: chart.start as u32,
            chart_count: chart.len() as u32,
            length_base: lengths.map(|of_edge| of_edge.base),
            length_shift: lengths.map(|of_edge| of_edge.shift),
            weights: packed_weights(level, b),
        }
    };
    blocks.map(record).collect()
}

/// The parents of `block` in the order of `BlockRecord`, and which of them are active: the coarser block over it, with
/// the index `own`, and that block's neighbours on the side of the quarter that `block` covers.
fn parents(blocks: &Blocks, own: u32, block: &Block) -> ([u32; 4], u32) {
    let (x, y) = ([3, 5][(block.x % 2) as usize], [1, 7][(block.y % 2) as usize]);
    let all = match blocks.neighbours.get(own as usize) {
        Some(neighbours) => [own, neighbours[x], neighbours[y], neighbours[x + y - 4]],
        None => [NONE; 4],
    };
    let active = |k: usize| all[k] != NONE && blocks.list[all[k] as usize].active;
    (all, (0..4).map(|k| u32::from(active(k)) << k).sum())
}

/// The codes of a block's interpolation weights, four to a word; 0 on the coarsest level, which has no weights.
pub fn packed_weights(level: &Level, b: usize) -> [u32; NODES / 4] {
    let codes = level.interpolation.get(b).unwrap_or(&[0; NODES]);
    std::array::from_fn(|k| u32::from_le_bytes(std::array::from_fn(|n| codes[4 * k + n])))
}

/// The constants of the nodes of blocks of level `k`: `node_planes` planes per block.
pub fn block_nodes(grid: &Grid, level: &Level, k: usize, blocks: Range<usize>) -> Vec<u32> {
    let mut all = Vec::with_capacity(blocks.len() * node_planes(grid) * NODES);
    for b in blocks {
        let rigidity = level.rigidity[b].iter().zip(&level.movable[b]);
        all.extend(rigidity.map(|(&code, &movable)| u32::from(code) | u32::from(movable == 0) << 31));
        for pair in level.rest_length[b].chunks(2) {
            all.extend(pair[0].iter().zip(&pair[1]).map(|(&a, &b)| u32::from(a) | u32::from(b) << 16));
        }
        if k == 0 {
            all.extend(grid.triangle[b]);
        } else {
            all.extend(level.coverage[b].iter().map(|coverage| coverage.to_bits()));
        }
        if let Some(plane) = level.density.get(b) {
            all.extend(plane.iter().map(|density| density.to_bits()));
        }
        all.extend(level.hold.get(b).into_iter().flatten().copied());
    }
    all
}

/// The features of a level, in the layout of `shaders/harm/features.wgsl`.
pub fn features(pieces: &Pieces) -> Vec<u32> {
    let counts = [pieces.tags.len(), pieces.feature.len(), pieces.edges.len()];
    let mut words = Vec::with_capacity(feature_words(pieces));
    words.extend(counts.map(|count| count as u32));
    let pairs = pieces.tags.as_flattened().chunks_exact(2);
    words.extend(pairs.map(|pair| u32::from(pair[0]) | u32::from(pair[1]) << 16));
    let lists = [&pieces.first, &pieces.feature, &pieces.first_of_feature, &pieces.of_feature, &pieces.edges];
    lists.iter().for_each(|list| words.extend_from_slice(list));
    words
}

/// The length of `features`.
pub fn feature_words(pieces: &Pieces) -> usize {
    let lists =
        pieces.first.len() + 2 * pieces.feature.len() + pieces.first_of_feature.len() + pieces.edges.len();
    3 + pieces.tags.len() * NODES / 2 + lists
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
        .collect()
}

/// Per triangle, the indices of its three vertices among the vertices of all charts.
pub fn corners(tiles: &[&TileMesh]) -> Vec<u32> {
    let (mut corners, mut vertices) = (Vec::new(), 0);
    for tile in tiles {
        let mut firsts = Vec::with_capacity(tile.charts.len());
        for chart in &tile.charts {
            firsts.push(vertices);
            vertices += chart.count() as u32;
        }
        let triangles = tile.triangles.iter().zip(tile.chart_of_triangles());
        corners.extend(
            triangles.flat_map(|(triangle, chart)| triangle.local.map(|v| firsts[chart as usize] + v)),
        );
    }
    corners
}

#[cfg(test)]
mod tests;
