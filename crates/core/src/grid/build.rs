//! Builds the grid of a surveyed tile, with everything that its blocks hold.

use std::sync::Arc;

use super::blocks::Block;
use super::codes::Lengths;
use super::gather::Gather;
use super::node_set::NodeSet;
use super::pose::Pose;
use super::rigid_levels::{self, Nodes};
use super::survey::{Survey, SurveyLevel};
use super::{Grid, Level, cover, coverage, density, labels, mirrors, rest};
use crate::allocation::{Vec, vec, zeroed};
use crate::grid::maps::{MapsOfTile, TileMaps};
use crate::grid::planes::{NODES, Plane, SIDE, slot};
use crate::mesh::{Mesh, NONE};
use crate::team::Team;

/// Builds the grid of a surveyed tile.
pub fn grid(team: &Team, mesh: &Mesh, maps: MapsOfTile, survey: Survey) -> Grid {
    let tile = survey.coverer.tile;
    let charts = tile.charts.len();
    let mut levels = levels_of(&survey.levels, charts);
    let triangle = triangles_of_nodes(team, &survey);
    let rigidity = survey.rigidity(maps);
    rigid_levels::allocate(&mut levels);
    rigid_levels::finest(team, &rigidity, &survey.levels[0], &triangle, &mut levels[0], Nodes::ALL);
    rigid_levels::coarser(team, &survey.levels, &mut levels, &maps.own.settings, Nodes::ALL);
    if maps.own.settings.orientation_density > 0.0 {
        let density = density::density(&coverage::node_maps_of(&rigidity, &survey));
        let width = survey.coverer.nx + 1;
        for (k, level) in levels.iter_mut().enumerate() {
            level.density = Arc::new(planes(level, |i, j| density[(j << k) * width + (i << k)]));
        }
    }
    let cells = [survey.coverer.nx, survey.coverer.ny];
    for (k, level) in levels.iter_mut().enumerate() {
        level.hold = Arc::new(mirrors::hold(tile, &survey.coverer.charts, &level.blocks, k, cells));
    }
    let mut gather = Gather::default();
    if let Some(level) = levels.get_mut(1) {
        let (of_level, coverage) =
            Gather::new(team, &survey.coverer, &level.blocks.list, [level.nx, level.ny]);
        (gather, level.coverage) = (of_level, Arc::new(coverage));
    }
    let features = Arc::new(labels::features(team, &levels, &survey.levels[0].movable, &triangle));
    let rest = Arc::new(Pose::new(tile, |v| mesh.rest[v as usize], None));
    let (triangle, gather) = (Arc::new(triangle), Arc::new(gather));
    let mut grid = Grid { triangle, gather, rest, features, ..empty(survey, levels) };
    rest::rest_lengths(team, &mut grid, mesh, tile);
    grid
}

#[doc(hidden)]
impl Grid {
    /// Builds a tile's grid.
    pub fn new(mesh: &Mesh, tile: &crate::mesh::TileMesh, maps: &TileMaps) -> Grid {
        Team::with(2, |team| {
            let survey = Survey::new(team, tile, MapsOfTile::alone(maps), maps.grid_size());
            grid(team, mesh, MapsOfTile::alone(maps), survey)
        })
    }
}

/// A surveyed tile's grid with empty blocks. Its sizes are those of the complete grid, except for the triangles
/// gathered at the nodes of level 1.
pub fn skeleton(survey: Survey) -> Grid {
    let levels = levels_of(&survey.levels, survey.coverer.tile.charts.len());
    let blocks = levels.get(1).map_or(0, |level| level.blocks.list.len());
    let gather = Arc::new(Gather { starts: zeroed(blocks * NODES + 1), ..Gather::default() });
    Grid { gather, ..empty(survey, levels) }
}

/// A surveyed tile's grid with these levels, without what its blocks hold besides.
fn empty(survey: Survey, levels: Vec<Level>) -> Grid {
    Grid {
        levels,
        overlap: survey.overlap(),
        triangles: Arc::new(survey.triangles),
        chart_of: Arc::new(survey.coverer.charts.into_owned().into()),
        movable: survey.movable,
        at_gaps: survey.counts.at_gaps,
        has_extra: survey.has_extra,
        survey: Arc::new(survey.levels),
        parts: Arc::new(survey.parts),
        squares: Arc::new(survey.squares),
        rigid: survey.rigid,
        rigid_nodes: survey.rigid_nodes,
        ..Grid::default()
    }
}

/// The levels of a grid with their blocks and mobility; their other fields are empty.
pub(super) fn levels_of(survey: &[SurveyLevel], charts: usize) -> Vec<Level> {
    let mut levels: Vec<Level> = Vec::with_capacity(survey.len());
    for SurveyLevel { size, blocks, movable, .. } in survey {
        let mut children = vec![[NONE; 4]; blocks.list.len()];
        if let Some(finer) = levels.last_mut() {
            let mut parents = vec![NONE; finer.blocks.list.len()];
            for (b, block) in finer.blocks.list.iter().enumerate() {
                let parent = blocks.find(block.chart, i64::from(block.x / 2), i64::from(block.y / 2));
                parents[b] = parent;
                if parent != NONE {
                    children[parent as usize][(block.y % 2 * 2 + block.x % 2) as usize] = b as u32;
                }
            }
            finer.parent = Arc::new(parents);
        }
        levels.push(Level {
            nx: size[0],
            ny: size[1],
            movable: Arc::new(movable.iter().map(mobility).collect()),
            lengths: vec![[Lengths::default(); 4]; charts],
            floor: zeroed(charts),
            children: Arc::new(children),
            parent: Arc::new(vec![NONE; blocks.list.len()]),
            blocks: blocks.clone(),
            ..Level::default()
        });
    }
    levels
}

/// 1 for the nodes of a set, 0 for the others.
fn mobility(nodes: &NodeSet) -> Plane<u8> {
    let mut plane = [0; NODES];
    for n in (0..NODES).filter(|n| nodes.contains(n % SIDE, n / SIDE)) {
        plane[slot(n % SIDE, n / SIDE)] = 1;
    }
    plane
}

/// The triangle under each node of the blocks of level 0.
fn triangles_of_nodes(team: &Team, survey: &Survey) -> Vec<Plane<u32>> {
    let blocks = &survey.levels[0].blocks.list;
    let mut triangles = vec![[NONE; NODES]; blocks.len()];
    team.fill(&mut triangles, |b, plane| {
        let block = &blocks[b];
        if let Some(square) = survey.coverer.squares.find(block.chart, block.x, block.y) {
            let cover = survey.coverer.cover(square);
            for j in 0..SIDE {
                for i in 0..SIDE {
                    plane[slot(i, j)] = cover.triangle[cover::at(i + 1, j + 1)];
                }
            }
        }
    });
    triangles
}

/// A plane per block of a level, with the values of `f` at its nodes (i, j); 0 at nodes beyond the level.
fn planes(level: &Level, f: impl Fn(usize, usize) -> f32) -> Vec<Plane> {
    let plane = |block: &Block| {
        let mut plane = [0.0; NODES];
        let (x, y) = (block.x as usize * SIDE, block.y as usize * SIDE);
        for j in 0..SIDE.min(level.ny + 1 - y) {
            for i in 0..SIDE.min(level.nx + 1 - x) {
                plane[slot(i, j)] = f(x + i, y + j);
            }
        }
        plane
    };
    level.blocks.list.iter().map(plane).collect()
}
