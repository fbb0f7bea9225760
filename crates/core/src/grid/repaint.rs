//! Updates a grid after some texels of its rigidity map changed, as by a brush stroke. Only what depends on these
//! texels is computed again; everything else is shared with the previous grid.

use std::borrow::Cow;

use super::Grid;
use super::blocks::Part;
use super::cover::{Coverer, WIDE};
use super::interpolation::{self, MARGIN, PATCH, Source, StiffnessPlanes};
use super::pyramid::{self, Relevant};
use super::rigid_nodes::{RigidNodes, rigid_nodes};
use super::rigidity::NodeRigidity;
use super::squares::Squares;
use super::survey::{SurveyLevel, has_rigidity, movable_of_charts};
use crate::allocation::{Vec, zeroed};
use crate::grid::maps::{MapsOfTile, TileMaps};
use crate::grid::planes::{NODES, SIDE};
use crate::image::map::{Map, TexelRect};
use crate::mesh::{NONE, TileMesh};
use crate::settings::Seams;
use crate::team::Team;

/// A rectangle of nodes of a level, from `first` to `last` along both axes.
#[derive(Clone, Copy, Debug)]
struct Nodes {
    first: [i64; 2],
    last: [i64; 2],
}

impl Nodes {
    /// The nodes whose rigidity depends on some texels.
    fn of_texels(map: &Map, cells: [usize; 2], texels: &TexelRect) -> Nodes {
        let bound = |axis: usize, texel: usize, reach: f64| {
            let per_cell = [map.width, map.height][axis] as f64 / cells[axis] as f64;
            (texel as f64 + reach * 0.5 * per_cell.max(1.0)) / per_cell
        };
        // Texels at the rim also represent those beyond it.
        let is_rim = |axis: usize| texels.end[axis] == [map.width, map.height][axis];
        Nodes {
            first: [0, 1].map(|axis| bound(axis, texels.first[axis], -1.0).floor() as i64),
            last: [0, 1].map(|axis| match is_rim(axis) {
                true => cells[axis] as i64,
                false => bound(axis, texels.end[axis], 1.0).ceil() as i64,
            }),
        }
    }

    /// The rectangle extended by `n` nodes in all directions.
    fn grown(self, n: i64) -> Nodes {
        Nodes { first: self.first.map(|x| x - n), last: self.last.map(|x| x + n) }
    }

    /// The nodes of the next coarser level on or next to these nodes.
    fn coarser(self) -> Nodes {
        Nodes { first: self.first.map(|x| x.div_euclid(2)), last: self.last.map(|x| (x + 1).div_euclid(2)) }
    }

    /// Whether the square at (x, y), of `side` nodes, contains one of these nodes.
    fn meet(self, [x, y]: [u32; 2], side: usize) -> bool {
        [x, y].into_iter().zip(self.first.into_iter().zip(self.last)).all(|(x, (first, last))| {
            let start = i64::from(x) * side as i64;
            start <= last && start + side as i64 > first
        })
    }

    /// The first and the last square of 16 by 16 nodes that contain one of these nodes.
    fn squares(self, cells: [usize; 2]) -> [[u32; 2]; 2] {
        let square = |x: i64, axis: usize| (x.clamp(0, cells[axis] as i64) / SIDE as i64) as u32;
        [self.first, self.last].map(|p| [0, 1].map(|axis| square(p[axis], axis)))
    }
}

/// A grid after a brush stroke.
pub struct Repainted {
    pub grid: Grid,
    /// Per chart, whether a rigidity value that it depends on may have changed.
    pub charts: Vec<bool>,
}

/// The grid for `maps`, whose rigidity map changed in some texels since `grid` was built.
///
/// # Returns
/// `None` if the grid has to be built from scratch: because a chart gained its first or lost its last rigidity, or
/// because the settings need the density of rigid material, or keep features at borders, or because the tile has collars,
/// in which other texels lie.
pub fn repaint(
    team: &Team,
    grid: &Grid,
    tile: &TileMesh,
    maps: &TileMaps,
    map: &Map,
    texels: &TexelRect,
) -> Option<Repainted> {
    let keeps = maps.settings.seams == Seams::Keep;
    if keeps || maps.settings.orientation_density > 0.0 || !tile.sources.is_empty() {
        return None;
    }
    let cells = [grid.levels[0].nx, grid.levels[0].ny];
    let nodes = Nodes::of_texels(map, cells, texels);
    let near = nodes.grown(1);
    let squares = Squares::new(tile, &grid.chart_of, cells[0], cells[1], Some(near.squares(cells)));
    let charts = Cow::Borrowed(&grid.chart_of[..]);
    let coverer =
        Coverer { tile, nx: cells[0], ny: cells[1], overlap: maps.settings.overlap, charts, squares };
    let rigidity =
        NodeRigidity { maps: MapsOfTile::alone(maps), coverer: &coverer, triangles: &grid.triangles };
    let rigid = parts_with_rigidity(&rigidity, &grid.parts, &grid.rigid, near);
    if movable_of_charts(grid.movable.len(), &grid.parts, &rigid) != grid.movable {
        return None;
    }
    let rigid_nodes = rigid_nodes_now(&rigidity, &grid.rigid_nodes, near);
    let mut grid = grid.with_rigidity(rigid, rigid_nodes);
    let mut charts = zeroed(grid.movable.len());
    let is_near = |part: &&Part| near.meet([part.x, part.y], SIDE);
    grid.parts.iter().filter(is_near).for_each(|part| charts[part.chart as usize] = true);
    update_rigidity(team, &mut grid, &rigidity, nodes);
    update_interpolation(team, &mut grid, maps, nodes);
    Some(Repainted { grid, charts })
}

/// Per part, whether it has rigidity after the stroke.
fn parts_with_rigidity(source: &NodeRigidity, parts: &[Part], before: &[bool], near: Nodes) -> Vec<bool> {
    let of_part = |(part, before): (&Part, &bool)| {
        if !near.meet([part.x, part.y], SIDE) {
            return *before;
        }
        let Some(square) = source.coverer.squares.find(part.chart, part.x, part.y) else { return *before };
        let cover = source.coverer.cover(square);
        let window: [f32; WIDE * WIDE] = source.window([part.x, part.y], &cover);
        let moves = |n: &usize| part.nodes.contains(n % SIDE, n / SIDE);
        (0..NODES).filter(moves).any(|n| has_rigidity(&window, n % SIDE, n / SIDE))
    };
    parts.iter().zip(before).map(of_part).collect()
}

/// The rigid nodes of each square after the stroke.
fn rigid_nodes_now(source: &NodeRigidity, before: &[RigidNodes], near: Nodes) -> Vec<RigidNodes> {
    let of_square = |before: &RigidNodes| {
        let [x, y] = before.square;
        match source.coverer.squares.find(0, x, y).filter(|_| near.meet([x, y], SIDE)) {
            Some(square) => {
                let cover = source.coverer.cover(square);
                let window = source.window([x, y], &cover);
                rigid_nodes([x, y], &cover, &source.free(square, &cover), &window)
            }
            None => *before,
        }
    };
    before.iter().map(of_square).collect()
}

/// The blocks of a level that contain one of the nodes.
fn blocks_with(level: &SurveyLevel, nodes: Nodes) -> Vec<usize> {
    let list = &level.blocks.list;
    (0..list.len()).filter(|&b| nodes.meet([list[b].x, list[b].y], SIDE)).collect()
}

/// Updates the rigidity of all levels.
fn update_rigidity(team: &Team, grid: &mut Grid, rigidity: &NodeRigidity, mut nodes: Nodes) {
    let survey = grid.survey.clone();
    let mut relevant = pyramid::relevant(&survey[0]);
    let blocks = blocks_with(&survey[0], nodes);
    let codes = team.map(blocks.len(), |k| {
        let mut codes = [0; NODES];
        pyramid::finest_block(rigidity, &survey[0], &relevant, blocks[k], &mut codes);
        codes
    });
    blocks.iter().zip(codes).for_each(|(&b, codes)| grid.levels[0].rigidity[b] = codes);
    for k in 1..survey.len() {
        nodes = nodes.grown(1).coarser();
        let relevant_coarser = pyramid::relevant(&survey[k]);
        let (finer, coarser) = (
            Relevant { level: &survey[k - 1], relevant: &relevant },
            Relevant { level: &survey[k], relevant: &relevant_coarser },
        );
        for b in blocks_with(&survey[k], nodes) {
            let children = &grid.levels[k].children[b];
            let codes = pyramid::coarser_block(&finer, &grid.levels[k - 1].rigidity, &coarser, children, b);
            grid.levels[k].rigidity[b] = codes;
        }
        relevant = relevant_coarser;
    }
}

/// Updates the interpolation weights of all levels, and the stiffness from which they are computed.
fn update_interpolation(team: &Team, grid: &mut Grid, maps: &TileMaps, nodes: Nodes) {
    let survey = grid.survey.clone();
    let settings = &maps.settings;
    // The nodes whose edges have a changed stiffness: on level 0 the changed nodes and their neighbours.
    let mut nodes = nodes.grown(1);
    for k in 0..survey.len() - 1 {
        let levels = [&survey[k], &survey[k + 1]];
        let reach = nodes.grown(MARGIN as i64);
        let places = places(levels[0], |place| reach.meet(place, 2 * SIDE));
        let level_1 = if k == 1 { stiffness_of_level_1(team, grid, settings, &places) } else { Vec::new() };
        let mut weights = std::mem::take(&mut grid.levels[k].interpolation);
        // The stiffness of level 1 is not kept.
        let mut next = match k {
            0 => zeroed(levels[1].blocks.list.len()),
            _ => std::mem::take(&mut grid.levels[k + 1].stiffness),
        };
        let source = match k {
            0 => Source::Rigidity(&grid.levels[0].rigidity, settings),
            1 => Source::Stiffness(&level_1),
            _ => Source::Stiffness(&grid.levels[k].stiffness),
        };
        interpolation::patches(team, levels, source, &places, Some(&mut weights), &mut next);
        grid.levels[k].interpolation = weights;
        if k > 0 {
            grid.levels[k + 1].stiffness = next;
        }
        nodes = nodes.grown(MARGIN as i64 / 2).coarser();
    }
}

/// The wanted positions (chart, y, x) on the next coarser level over the blocks of a level.
fn places(finer: &SurveyLevel, wanted: impl Fn([u32; 2]) -> bool) -> Vec<(u32, u32, u32)> {
    let places = finer.blocks.list.iter().filter(|b| wanted([b.x / 2, b.y / 2]));
    let mut places: Vec<_> = places.map(|b| (b.chart, b.y / 2, b.x / 2)).collect();
    places.sort_unstable();
    places.dedup();
    places
}

/// The stiffness of those blocks of level 1 that patches over `places` of level 2 read; 0 in the other blocks.
fn stiffness_of_level_1(
    team: &Team,
    grid: &Grid,
    settings: &crate::settings::TileSettings,
    places: &[(u32, u32, u32)],
) -> Vec<StiffnessPlanes> {
    let level = &grid.survey[1];
    let mut read: Vec<(u32, u32, u32)> = Vec::new();
    let side = SIDE as i64;
    for &(chart, y, x) in places {
        let first = [x, y].map(|x| i64::from(x) * 2 * side - MARGIN as i64);
        let blocks = first.map(|first| first.div_euclid(side)..=(first + PATCH as i64 - 1).div_euclid(side));
        for y in blocks[1].clone() {
            for x in blocks[0].clone() {
                if level.blocks.find(chart, x, y) != NONE {
                    read.push((chart, y as u32, x as u32));
                }
            }
        }
    }
    read.sort_unstable();
    read.dedup();
    let mut stiffness = zeroed(level.blocks.list.len());
    let source = Source::Rigidity(&grid.levels[0].rigidity, settings);
    interpolation::patches(team, [&grid.survey[0], level], source, &read, None, &mut stiffness);
    stiffness
}
