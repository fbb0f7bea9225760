//! Updates a grid after its rigidity changed: in some texels, as by a brush stroke, or all of it. Only what depends on
//! rigidity is computed again, and of that only what is near a change; everything else is shared with the grid before.

use std::sync::Arc;

use super::blocks::Part;
use super::cover::Coverer;
use super::rigid_levels::{self, Nodes, OfBlock};
use super::rigid_nodes::{of_square, rigid_nodes};
use super::rigidity::NodeRigidity;
use super::square_nodes::{RigidSets, SquareNodes, SquaresOf};
use super::survey::{SurveyLevel, movable_of_charts};
use super::{Grid, labels};
use crate::allocation::{Vec, vec, zeroed};
use crate::grid::maps::{MapsOfTile, Values};
use crate::grid::planes::SIDE;
use crate::image::map::TexelRect;
use crate::mesh::TileMesh;
use crate::settings::Seams;
use crate::team::Team;

/// A grid with another rigidity.
pub struct Repainted {
    pub grid: Grid,
    /// Per chart, whether its rigidity may be another one.
    pub charts: Vec<bool>,
}

/// The grid for `maps`, whose rigidity has changed since `grid` was built: in some texels of its map, or anywhere.
///
/// # Returns
/// `None` if the grid has to be built from scratch: because a chart gained its first or lost its last rigidity, or
/// because the settings need the density of rigid material, or keep features at borders.
pub fn repaint(
    team: &Team,
    grid: &Grid,
    tile: &TileMesh,
    maps: MapsOfTile,
    texels: Option<TexelRect>,
) -> Option<Repainted> {
    let settings = &maps.own.settings;
    if settings.seams == Seams::Keep || settings.orientation_density > 0.0 {
        return None;
    }
    let cells = [grid.levels[0].nx, grid.levels[0].ny];
    let nodes = match (&maps.own.rigidity, texels) {
        // A collar shows texels that lie elsewhere.
        (Values::Map(map), Some(texels)) if tile.sources.is_empty() => Nodes::of_texels(map, cells, &texels),
        _ => Nodes::ALL,
    };
    let rigidity = NodeRigidity::new(maps, tile, cells, &grid.chart_of, &grid.triangles);
    let (survey, list) = (grid.survey.clone(), grid.squares.clone());
    let squares = SquaresOf::new(&list, tile);
    let mut grid = grid.clone();
    // The squares around those with a change tell whether its nodes are near rigidity.
    let reach = nodes.grown(SIDE as i64 + 1);
    let blocks =
        rigid_levels::finest(team, &rigidity, &survey[0], &grid.triangle, &mut grid.levels[0], reach);
    // A block has the triangles of its chart alone.
    let is_whole = rigidity.is_map_alone() || tile.charts.len() == 1;
    let of_blocks = sets_of_blocks(&survey[0], &squares, if is_whole { &blocks } else { &[] });
    let sets = sets_of_squares(team, &rigidity, &grid, (tile, maps), &squares, reach, of_blocks);
    let near = if nodes == Nodes::ALL { nodes } else { nodes.grown(1) };
    let rigid = team.map(grid.parts.len(), |k| {
        let part = &grid.parts[k];
        match near.meet([part.x, part.y], SIDE) {
            true => squares.is_near_rigidity(part, &sets),
            false => grid.rigid[k],
        }
    });
    if movable_of_charts(grid.movable.len(), &grid.parts, &rigid) != grid.movable {
        return None;
    }
    grid.rigid = rigid;
    if tile.sources.is_empty() {
        // One layer, so that each of these is of one square.
        let covered = list.iter().zip(&sets).filter(|(square, _)| !square.covered.is_empty());
        let near = |(square, _): &(&SquareNodes, _)| near.meet(square.square.at, SIDE);
        let now = covered.zip(&mut grid.rigid_nodes).filter(|(of, _)| near(of));
        now.for_each(|((square, sets), now)| *now = of_square(square, sets));
    } else {
        grid.rigid_nodes = rigid_nodes(&list, &sets);
    }
    let mut charts: Vec<bool> = zeroed(grid.movable.len());
    if near != Nodes::ALL {
        // The charts that a stroke touches are solved again.
        let touched = grid.parts.iter().filter(|part| near.meet([part.x, part.y], SIDE));
        touched.for_each(|part| charts[part.chart as usize] = true);
    }
    let mut changed: Option<Nodes> = None;
    for of in blocks.iter().filter(|of| of.changed) {
        let block = &survey[0].blocks.list[of.block];
        charts[block.chart as usize] = true;
        let nodes = Nodes::of_block(block);
        changed = Some(changed.map_or(nodes, |changed| changed.with(nodes)));
    }
    if let Some(changed) = changed {
        rigid_levels::coarser(team, &survey, &mut grid.levels, settings, changed);
        grid.features = Arc::new(labels::features(team, &grid.levels, &survey[0].movable, &grid.triangle));
    }
    Some(Repainted { grid, charts })
}

/// Per square, the nodes with some rigidity, where a block tells them.
fn sets_of_blocks(level: &SurveyLevel, squares: &SquaresOf, blocks: &[OfBlock]) -> Vec<Option<RigidSets>> {
    let mut sets = vec![None; squares.list.len()];
    for of in blocks {
        let block = &level.blocks.list[of.block];
        if let Some(square) = squares.find(block.chart, [block.x, block.y]) {
            sets[square] = Some(of.sets);
        }
    }
    sets
}

/// Per square, the nodes with some rigidity; for squares that have none of `nodes`, none.
fn sets_of_squares(
    team: &Team,
    rigidity: &NodeRigidity,
    grid: &Grid,
    (tile, maps): (&TileMesh, MapsOfTile),
    squares: &SquaresOf,
    nodes: Nodes,
    mut known: Vec<Option<RigidSets>>,
) -> Vec<RigidSets> {
    let is_wanted = |&k: &usize| known[k].is_none() && nodes.meet(squares.list[k].square.at, SIDE);
    let wanted = (0..known.len()).filter(is_wanted);
    let mut wanted: Vec<(usize, RigidSets)> = wanted.map(|k| (k, RigidSets::default())).collect();
    // Triangles are kept where blocks are. Elsewhere the map tells what is rigid, but not beside the borders of charts
    // that go on beyond them, and values of vertices tell nothing without triangles.
    let is_still = |part: &Part| grid.movable[part.chart as usize] == 0;
    let needs_triangles = match maps.own.rigidity {
        Values::Map(_) => {
            !tile.sources.is_empty() && (tile.charts.len() > 1 || grid.parts.iter().any(is_still))
        }
        _ => true,
    };
    let [nx, ny] = [grid.levels[0].nx, grid.levels[0].ny];
    let coverer = (needs_triangles && !wanted.is_empty())
        .then(|| Coverer::new(tile, nx, ny, maps.own.settings.overlap));
    team.fill(&mut wanted, |_, (k, sets)| {
        let square = squares.list[*k].square;
        let cover = coverer.as_ref().and_then(|of| Some(of.cover(of.squares.index(square)?)));
        *sets = RigidSets::new(&match cover {
            Some(cover) => rigidity.at_square(square.at, |n| cover.triangle_at(n)),
            None => rigidity.map_at_square(square.at),
        });
    });
    for (k, sets) in wanted {
        known[k] = Some(sets);
    }
    known.into_iter().map(Option::unwrap_or_default).collect()
}
