//! The data of all levels that depend on a tile's rigidity (method §3 and §7.5), for all nodes or within a rectangle of
//! them.

use super::Level;
use super::blocks::Block;
use super::codes::encode_rigidity;
use super::interpolation::{self, MARGIN, PATCH, Source, StiffnessPlanes};
use super::pyramid;
use super::rigidity::NodeRigidity;
use super::square_nodes::RigidSets;
use super::survey::SurveyLevel;
use crate::allocation::{Vec, zeroed};
use crate::grid::planes::{NODES, Plane, SIDE, slot};
use crate::image::map::{Map, TexelRect};
use crate::settings::TileSettings;
use crate::team::Team;

/// A rectangle of nodes of a level, from `first` to `last` along both axes.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Nodes {
    first: [i64; 2],
    last: [i64; 2],
}

impl Nodes {
    pub const ALL: Nodes = Nodes { first: [i64::MIN / 4; 2], last: [i64::MAX / 4; 2] };

    /// The nodes whose rigidity depends on some texels.
    pub fn of_texels(map: &Map, cells: [usize; 2], texels: &TexelRect) -> Nodes {
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
    pub fn grown(self, n: i64) -> Nodes {
        Nodes { first: self.first.map(|x| x - n), last: self.last.map(|x| x + n) }
    }

    /// The nodes of the next coarser level on or next to these nodes.
    pub fn coarser(self) -> Nodes {
        Nodes { first: self.first.map(|x| x.div_euclid(2)), last: self.last.map(|x| (x + 1).div_euclid(2)) }
    }

    pub fn of_block(block: &Block) -> Nodes {
        let first = [block.x, block.y].map(|x| i64::from(x) * SIDE as i64);
        Nodes { first, last: first.map(|x| x + SIDE as i64 - 1) }
    }

    /// The least rectangle that has these nodes, too.
    pub fn with(self, other: Nodes) -> Nodes {
        let axes = [0, 1];
        Nodes {
            first: axes.map(|axis| self.first[axis].min(other.first[axis])),
            last: axes.map(|axis| self.last[axis].max(other.last[axis])),
        }
    }

    /// The nodes that the patches of interpolation read in which some of these nodes are.
    fn read_by_patches(self) -> Nodes {
        let [side, margin, patch] = [2 * SIDE, MARGIN, PATCH].map(|n| n as i64);
        let first = |x: i64| x.div_euclid(side) * side - margin;
        Nodes { first: self.first.map(first), last: self.last.map(|x| first(x) + patch - 1) }
    }

    /// True if the square at (x, y), of `side` nodes, contains one of these nodes.
    pub fn meet(self, [x, y]: [u32; 2], side: usize) -> bool {
        [x, y].into_iter().zip(self.first.into_iter().zip(self.last)).all(|(x, (first, last))| {
            let start = i64::from(x) * side as i64;
            start <= last && start + side as i64 > first
        })
    }
}

/// Makes room for what `update` computes.
pub(super) fn allocate(levels: &mut [Level]) {
    let last = levels.len() - 1;
    for (k, level) in levels.iter_mut().enumerate() {
        let blocks = level.blocks.list.len();
        level.rigidity = zeroed(blocks);
        level.interpolation = zeroed(if k < last { blocks } else { 0 });
        // That of levels 0 and 1 is not kept.
        level.stiffness = zeroed(if k > 1 { blocks } else { 0 });
    }
}

/// Facts about a block of level 0.
pub(super) struct OfBlock {
    pub block: usize,
    /// The nodes of its square with some rigidity, of whatever chart.
    pub sets: RigidSets,
    /// True if a rigidity of its chart is another than before.
    pub changed: bool,
}

/// Computes the rigidity of level 0 in the blocks that have some of these nodes. `triangles` are those under each
/// block's nodes.
pub(super) fn finest(
    team: &Team,
    rigidity: &NodeRigidity,
    survey: &SurveyLevel,
    triangles: &[Plane<u32>],
    level: &mut Level,
    nodes: Nodes,
) -> Vec<OfBlock> {
    let list = &survey.blocks.list;
    let none = |block| OfBlock { block, sets: RigidSets::default(), changed: false };
    let wanted = level.rigidity.iter_mut().enumerate().map(|(b, codes)| (none(b), codes));
    let mut wanted: Vec<_> =
        wanted.filter(|(of, _)| nodes.meet([list[of.block].x, list[of.block].y], SIDE)).collect();
    team.fill(&mut wanted, |_, (of, codes)| {
        let (b, at) = (of.block, [list[of.block].x, list[of.block].y]);
        let values = match rigidity.is_map_alone() {
            // All nodes that matter have a triangle.
            true => rigidity.map_at_square(at),
            false => rigidity.at_square(at, |n| triangles[b][slot(n % SIDE, n / SIDE)]),
        };
        of.sets = RigidSets::new(&values);
        let relevant = pyramid::relevant_of(survey, b);
        let mut now = [0; NODES];
        for (j, row) in values.chunks_exact(SIDE).enumerate() {
            for (i, value) in row.iter().enumerate() {
                now[slot(i, j)] = if relevant.contains(i, j) { encode_rigidity(*value) } else { 0 };
            }
        }
        of.changed = **codes != now;
        **codes = now;
    });
    wanted.into_iter().map(|(of, _)| of).collect()
}

/// Computes all else that follows from the rigidity of level 0 at some nodes.
pub(super) fn coarser(
    team: &Team,
    survey: &[SurveyLevel],
    levels: &mut [Level],
    settings: &TileSettings,
    nodes: Nodes,
) {
    coarser_rigidity(team, survey, levels, nodes);
    // The nodes whose edges have another stiffness: on level 0 the changed nodes and their neighbours.
    stiffness(team, survey, levels, settings, nodes.grown(1));
}

fn coarser_rigidity(team: &Team, survey: &[SurveyLevel], levels: &mut [Level], mut nodes: Nodes) {
    let mut relevant = pyramid::relevant(team, &survey[0]);
    for k in 1..levels.len() {
        nodes = nodes.grown(1).coarser();
        let relevant_coarser = pyramid::relevant(team, &survey[k]);
        let (finer, level) = levels.split_at_mut(k);
        let (finer, level) = (&finer[k - 1], &mut level[0]);
        let list = &survey[k].blocks.list;
        let blocks = level.rigidity.iter_mut().enumerate();
        let mut blocks: Vec<_> = blocks.filter(|(b, _)| nodes.meet([list[*b].x, list[*b].y], SIDE)).collect();
        let (children, codes_finer) = (&level.children, &finer.rigidity);
        team.fill(&mut blocks, |_, (b, codes)| {
            let (children, here) = (&children[*b], relevant_coarser[*b]);
            pyramid::coarser_block(&survey[k - 1].blocks, &relevant, codes_finer, children, here, codes);
        });
        relevant = relevant_coarser;
    }
}

/// Computes the weights of interpolation, and the stiffness from which they follow, at the nodes whose edges have
/// another stiffness.
fn stiffness(
    team: &Team,
    survey: &[SurveyLevel],
    levels: &mut [Level],
    settings: &TileSettings,
    mut nodes: Nodes,
) {
    let mut of_level_1: Vec<StiffnessPlanes> = Vec::new();
    for k in 0..survey.len() - 1 {
        let [finer, coarser] = [&survey[k], &survey[k + 1]];
        let reach = nodes.grown(MARGIN as i64);
        nodes = nodes.grown(MARGIN as i64 / 2).coarser();
        // The stiffness of level 1 is not kept: that which the next level reads is computed again.
        let read = nodes.grown(MARGIN as i64).read_by_patches();
        let places = places(finer, |place| reach.meet(place, 2 * SIDE) || k == 0 && read.meet(place, SIDE));
        let (level, next) = levels.split_at_mut(k + 1);
        let (level, next) = (&mut level[k], &mut next[0]);
        let source = match k {
            0 => Source::Rigidity(&level.rigidity, settings),
            1 => Source::Stiffness(&of_level_1),
            _ => Source::Stiffness(&level.stiffness),
        };
        let mut of_next = match k {
            0 => zeroed(coarser.blocks.list.len()),
            _ => std::mem::take(&mut next.stiffness),
        };
        interpolation::patches(
            team,
            [finer, coarser],
            source,
            &places,
            &mut level.interpolation,
            &mut of_next,
        );
        if k == 0 { of_level_1 = of_next } else { next.stiffness = of_next }
    }
}

/// The positions (chart, y, x) of the next coarser level's blocks that cover blocks of `finer` and that `wanted`
/// accepts, sorted.
fn places(finer: &SurveyLevel, wanted: impl Fn([u32; 2]) -> bool) -> Vec<(u32, u32, u32)> {
    let places = finer.blocks.list.iter().filter(|b| wanted([b.x / 2, b.y / 2]));
    let mut places: Vec<_> = places.map(|b| (b.chart, b.y / 2, b.x / 2)).collect();
    places.sort_unstable();
    places.dedup();
    places
}
