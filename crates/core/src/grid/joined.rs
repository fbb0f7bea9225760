//! Several tiles' grids as one, for a backend that solves the tiles together: charts, blocks and triangles of the first
//! tile come first. It has what backends read for a solve, and none of what the grids are built from.

use std::sync::Arc;

use super::blocks::{Block, Blocks};
use super::features::{Features, Pieces};
use super::gather::Gather;
use super::planes::Plane;
use super::uv_triangle::UvTriangle;
use super::{Grid, Level};
use crate::allocation::Vec;
use crate::mesh::NONE;

/// Numbers that follow others: `NONE` stays.
fn after<const N: usize>(numbers: &[u32; N], first: usize) -> [u32; N] {
    numbers.map(|number| if number == NONE { NONE } else { number + first as u32 })
}

/// The first number of each part, given how many each has, and the number of all.
fn firsts(counts: impl Iterator<Item = usize>) -> Vec<usize> {
    let mut next = 0;
    let mut firsts: Vec<usize> = [0].into_iter().collect();
    firsts.extend(counts.map(|count| {
        next += count;
        next
    }));
    firsts
}

/// The elements of all parts.
fn all<'a, T: Clone + 'a>(parts: impl Iterator<Item = &'a [T]>) -> Vec<T> {
    let mut all = Vec::new();
    parts.for_each(|part| all.extend_from_slice(part));
    all
}

/// Elements of all parts, in which numbers are made to follow those of the parts before.
fn renumbered<'a, T: 'a>(
    parts: impl Iterator<Item = &'a [T]>,
    firsts: &[usize],
    with: impl Fn(&T, usize) -> T,
) -> Vec<T> {
    let mut all = Vec::new();
    for (part, &first) in parts.zip(firsts) {
        all.extend(part.iter().map(|element| with(element, first)));
    }
    all
}

impl Grid {
    /// The grids of several tiles as one: all have as many levels. `before` is one of grids that differ from these in
    /// rigidity at most, whose other parts it shares.
    pub fn joined(grids: &[Arc<Grid>], before: Option<&Grid>) -> Grid {
        let charts = firsts(grids.iter().map(|grid| grid.movable.len()));
        let triangles = firsts(grids.iter().map(|grid| grid.triangles.len()));
        let blocks: Vec<Vec<usize>> = (0..grids[0].levels.len())
            .map(|k| firsts(grids.iter().map(|grid| grid.levels[k].blocks.list.len())))
            .collect();
        let level = |k: usize| {
            let levels = || grids.iter().map(move |grid| &grid.levels[k]);
            let rigidity = all(levels().map(|level| &level.rigidity[..]));
            let interpolation = all(levels().map(|level| &level.interpolation[..]));
            if let Some(before) = before {
                return Level { rigidity, interpolation, ..before.levels[k].clone() };
            }
            let own = &blocks[k];
            let [finer, coarser] =
                [k.wrapping_sub(1), k + 1].map(|k| blocks.get(k).map_or(&own[..], |blocks| blocks));
            Level {
                nx: grids[0].levels[k].nx,
                ny: grids[0].levels[k].ny,
                blocks: Arc::new(joined_blocks(grids, k, &charts, own)),
                rigidity,
                density: Arc::new(all(levels().map(|level| &level.density[..]))),
                hold: Arc::new(all(levels().map(|level| &level.hold[..]))),
                interpolation,
                movable: Arc::new(all(levels().map(|level| &level.movable[..]))),
                rest_length: Arc::new(all(levels().map(|level| &level.rest_length[..]))),
                lengths: all(levels().map(|level| &level.lengths[..])),
                floor: all(levels().map(|level| &level.floor[..])),
                coverage: Arc::new(all(levels().map(|level| &level.coverage[..]))),
                children: Arc::new(renumbered(levels().map(|level| &level.children[..]), finer, after)),
                parent: Arc::new(renumbered(
                    levels().map(|level| &level.parent[..]),
                    coarser,
                    |&parent, first| after(&[parent], first)[0],
                )),
                ..Level::default()
            }
        };
        let levels = (0..blocks.len()).map(level).collect();
        let movable = all(grids.iter().map(|grid| &grid.movable[..]));
        let features = Arc::new(joined_features(grids));
        if let Some(before) = before {
            return Grid { levels, movable, features, ..before.clone() };
        }
        Grid {
            levels,
            triangles: Arc::new(renumbered(
                grids.iter().map(|grid| &grid.triangles[..]),
                &triangles,
                |triangle, first| UvTriangle { neighbours: after(&triangle.neighbours, first), ..*triangle },
            )),
            chart_of: Arc::new(renumbered(
                grids.iter().map(|grid| &grid.chart_of[..]),
                &charts,
                |chart, first| chart + first as u32,
            )),
            triangle: Arc::new(renumbered(
                grids.iter().map(|grid| &grid.triangle[..]),
                &triangles,
                |plane: &Plane<u32>, first| after(plane, first),
            )),
            gather: Arc::new(Gather::joined(grids.iter().map(|grid| &*grid.gather), &triangles)),
            movable,
            features,
            has_extra: grids[0].has_extra,
            // The coarsest level of all of them.
            survey: grids[0].survey.clone(),
            ..Grid::default()
        }
    }
}

/// The blocks of all grids on a level.
fn joined_blocks(grids: &[Arc<Grid>], k: usize, charts: &[usize], firsts: &[usize]) -> Blocks {
    let of = || grids.iter().map(|grid| &*grid.levels[k].blocks);
    let chart = |block: &Block, first: usize| Block { chart: block.chart + first as u32, ..*block };
    Blocks {
        list: renumbered(of().map(|blocks| &blocks.list[..]), charts, chart),
        neighbours: renumbered(of().map(|blocks| &blocks.neighbours[..]), firsts, after),
        of_chart: renumbered(of().map(|blocks| &blocks.of_chart[..]), firsts, |range, first| {
            range.start + first..range.end + first
        }),
    }
}

/// The features of several grids as one.
fn joined_features(grids: &[Arc<Grid>]) -> Features {
    let mut joined = Features::default();
    for features in grids.iter().map(|grid| &grid.features) {
        joined.levels.resize(features.levels.len().max(joined.levels.len()), Pieces::default());
        for (to, from) in joined.levels.iter_mut().zip(&features.levels) {
            to.append(from, joined.count as u32);
        }
        joined.count += features.count;
    }
    joined
}
