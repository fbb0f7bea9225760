//! The survey of a tile: which nodes may move on which level, and hence which blocks there are. It visits the squares
//! that the tile's triangles meet, holds a few bytes per square, and computes how much memory a grid will need before
//! any of it is allocated.

use std::sync::Arc;

use super::blocks::{Blocks, Part};
use super::cover::Coverer;
use super::keep::{self, RigidPart};
use super::node_set::NodeSet;
use super::rigid_nodes::{RigidNodes, rigid_nodes};
use super::rigidity::NodeRigidity;
use super::square_nodes::{RigidSets, SquareNodes, SquaresOf};
use crate::allocation::{Vec, zeroed};
use crate::grid::maps::MapsOfTile;
use crate::grid::planes::{NODES, SIDE};
use crate::grid::uv_triangle::{UvTriangle, uv_triangles};
use crate::mesh::{NONE, TileMesh};
use crate::settings::Seams;
use crate::team::Team;

/// The nodes of a tile that may move.
pub struct Survey<'a> {
    pub coverer: Coverer<'a>,
    pub triangles: Vec<UvTriangle>,
    /// The nodes that may move if their chart has rigidity, sorted by chart, y, x.
    pub parts: Vec<Part>,
    /// Per part, whether rigidity is nonzero at one of its nodes or next to one.
    pub rigid: Vec<bool>,
    pub levels: Vec<SurveyLevel>,
    /// Movable nodes of level 0, per chart; 0 for a chart without rigidity (method §1).
    pub movable: Vec<u64>,
    pub counts: Counts,
    /// The squares that triangles cover, sorted by layer, y, x.
    pub squares: Vec<SquareNodes>,
    /// The rigid nodes of these squares, sorted by y, x.
    pub rigid_nodes: Vec<RigidNodes>,
    /// True if nodes have a density, or something that holds them.
    pub has_extra: bool,
}

/// The blocks of one level.
#[derive(Debug)]
pub struct SurveyLevel {
    /// Cells along u and v.
    pub size: [usize; 2],
    pub blocks: Arc<Blocks>,
    /// Per block, its movable nodes.
    pub movable: Vec<NodeSet>,
    /// Greatest number of movable nodes of a chart.
    pub most_movable: u64,
}

/// Numbers of nodes of level 0.
#[derive(Clone, Copy, Debug, Default)]
pub struct Counts {
    /// Nodes that a triangle covers.
    pub covered: u64,
    /// Nodes that more than one layer covers.
    pub layered: u64,
    /// Nodes inside charts that gaps in the UVs fix.
    pub at_gaps: u64,
}

/// Squares that a thread surveys at once.
const CHUNK: usize = 16;

impl<'a> Survey<'a> {
    /// Surveys a tile on a grid of `size` cells.
    pub fn new(team: &Team, tile: &'a TileMesh, maps: MapsOfTile, [nx, ny]: [usize; 2]) -> Survey<'a> {
        let coverer = Coverer::new(tile, nx, ny, maps.own.settings.overlap);
        let triangles = uv_triangles(tile, nx, ny);
        let rigidity = NodeRigidity::new(maps, tile, [nx, ny], &coverer.charts, &triangles);
        let count = coverer.squares.list.len();
        let keeps = maps.own.settings.seams == Seams::Keep;
        let found = team.map(count.div_ceil(CHUNK), |chunk| {
            let mut found = Found { keeps, ..Found::default() };
            for square in chunk * CHUNK..((chunk + 1) * CHUNK).min(count) {
                found.add_square(&coverer, &rigidity, square);
            }
            found
        });
        let mut counts = Counts::default();
        let count = |of: fn(&Found) -> usize| found.iter().map(of).sum();
        let mut squares = Vec::with_capacity(count(|f| f.squares.len()));
        let mut sets: Vec<RigidSets> = Vec::with_capacity(squares.capacity());
        let mut parts: Vec<Part> = Vec::with_capacity(count(|f| f.parts.len()));
        let mut of_features: Vec<RigidPart> = Vec::with_capacity(count(|f| f.of_features.len()));
        for of_chunk in found {
            counts.covered += of_chunk.counts.covered;
            counts.layered += of_chunk.counts.layered;
            counts.at_gaps += of_chunk.counts.at_gaps;
            squares.extend(of_chunk.squares);
            sets.extend(of_chunk.sets);
            parts.extend(of_chunk.parts);
            of_features.extend(of_chunk.of_features);
        }
        parts.sort_unstable_by_key(Part::key);
        let by_place = SquaresOf::new(&squares, tile);
        let near = team.map(parts.len(), |k| by_place.is_near_rigidity(&parts[k], &sets));
        let mut parts: Vec<(Part, bool)> = parts.into_iter().zip(near).collect();
        let mut rigid_nodes = rigid_nodes(&squares, &sets);
        keep::spread(&mut of_features);
        keep::fix(&of_features, &mut parts, &mut rigid_nodes);
        let rigid: Vec<bool> = parts.iter().map(|(_, rigid)| *rigid).collect();
        let parts: Vec<Part> = parts.into_iter().map(|(part, _)| part).collect();
        let movable = movable_of_charts(tile.charts.len(), &parts, &rigid);
        let levels = levels(team, [nx, ny], &movable, &parts);
        let has_extra = maps.own.settings.orientation_density > 0.0 || tile.has_images();
        Survey { coverer, triangles, parts, rigid, levels, movable, counts, squares, rigid_nodes, has_extra }
    }

    /// The sources of the tile's rigidity and mask.
    pub fn rigidity<'b>(&'b self, maps: MapsOfTile<'b>) -> NodeRigidity<'b> {
        let Coverer { tile, nx, ny, charts, .. } = &self.coverer;
        NodeRigidity::new(maps, tile, [*nx, *ny], charts, &self.triangles)
    }

    /// Bytes of the survey that the grid does not keep.
    pub fn bytes(&self) -> u64 {
        (self.coverer.squares.bytes() + self.squares.len() * size_of::<RigidSets>()) as u64
    }

    /// Fraction of the covered nodes that more than one layer covers.
    pub fn overlap(&self) -> f32 {
        self.counts.layered as f32 / self.counts.covered.max(1) as f32
    }
}

/// The number of movable nodes of each chart; 0 for charts without a rigid part.
pub(super) fn movable_of_charts(charts: usize, parts: &[Part], rigid: &[bool]) -> Vec<u64> {
    let mut movable = zeroed::<u64>(charts);
    let mut is_rigid = zeroed::<bool>(charts);
    for (part, rigid) in parts.iter().zip(rigid) {
        movable[part.chart as usize] += part.nodes.count();
        is_rigid[part.chart as usize] |= rigid;
    }
    for (count, is_rigid) in movable.iter_mut().zip(is_rigid) {
        *count *= u64::from(is_rigid);
    }
    movable
}

/// The blocks of all levels. A coarse node may move only if all of the 3x3 finer nodes around it may (the paper's eq.
/// 8), so that bilinear prolongation never moves a fixed node, nor one of another chart. An odd last column or row of
/// cells is dropped; the nodes at its inner side are fixed by the same rule.
pub(super) fn levels(team: &Team, size: [usize; 2], movable: &[u64], parts: &[Part]) -> Vec<SurveyLevel> {
    let parts: Vec<Part> = parts.iter().filter(|part| movable[part.chart as usize] > 0).copied().collect();
    let charts = movable.len();
    let level = |size, parts: &[Part]| {
        let mut nodes = zeroed::<u64>(charts);
        parts.iter().for_each(|part| nodes[part.chart as usize] += part.nodes.count());
        let most_movable = nodes.iter().copied().max().unwrap_or(0);
        let (blocks, movable) = Blocks::new(team, charts, parts);
        SurveyLevel { size, blocks: Arc::new(blocks), movable, most_movable }
    };
    let mut levels = Vec::new();
    levels.push(level(size, &parts));
    loop {
        let finer = &levels[levels.len() - 1];
        let size = finer.size.map(|n| n / 2);
        let parts = coarser_parts(team, finer);
        if size.contains(&0) || parts.is_empty() {
            return levels;
        }
        levels.push(level(size, &parts));
    }
}

/// The movable nodes of the next coarser level.
fn coarser_parts(team: &Team, finer: &SurveyLevel) -> Vec<Part> {
    let blocks = &finer.blocks;
    let mut parents: Vec<(u32, u32, u32)> =
        blocks.list.iter().filter(|b| b.active).map(|b| (b.chart, b.y / 2, b.x / 2)).collect();
    parents.sort_unstable();
    parents.dedup();
    let mut parts = team.map(parents.len(), |k| {
        let (chart, y, x) = parents[k];
        let mut part = Part { chart, x, y, nodes: NodeSet::EMPTY };
        for quarter in 0..4u32 {
            let (qx, qy) = (quarter % 2, quarter / 2);
            let child = blocks.find(chart, i64::from(2 * x + qx), i64::from(2 * y + qy));
            if child == NONE {
                continue;
            }
            let inner = blocks.window(&finer.movable, child as usize).eroded();
            for j in 0..SIDE / 2 {
                for i in 0..SIDE / 2 {
                    if inner.contains(2 * i, 2 * j) {
                        part.nodes.insert(qx as usize * 8 + i, qy as usize * 8 + j);
                    }
                }
            }
        }
        part
    });
    parts.retain(|part| !part.nodes.is_empty());
    parts
}

/// Findings of a thread in some squares.
#[derive(Default)]
struct Found {
    parts: Vec<Part>,
    counts: Counts,
    squares: Vec<SquareNodes>,
    /// Of each square.
    sets: Vec<RigidSets>,
    /// True if features at borders are kept; and then the rigid nodes of charts.
    keeps: bool,
    of_features: Vec<RigidPart>,
}

impl Found {
    fn add_square(&mut self, coverer: &Coverer, rigidity: &NodeRigidity, square: usize) {
        let cover = coverer.cover(square);
        if (0..NODES).all(|n| cover.triangle_at(n) == NONE) {
            return;
        }
        let place = coverer.squares.list[square];
        let sets = RigidSets::new(&rigidity.at_square(place.at, |n| cover.triangle_at(n)));
        let nodes = SquareNodes::new(place, &cover, rigidity.free(coverer, square, &cover));
        let chart = |n: usize| coverer.charts[cover.triangle_at(n) as usize];
        let (first, first_feature) = (self.parts.len(), self.of_features.len());
        for (n, [i, j]) in (0..NODES).map(|n| (n, [n % SIDE, n / SIDE])) {
            if self.keeps && cover.covered.contains(i, j) && sets.rigid.contains(i, j) {
                self.add_rigid(first_feature, chart(n), place.at, [i, j], !cover.interior.contains(i, j));
            }
            if !nodes.free.contains(i, j) {
                continue;
            }
            let chart = chart(n);
            let known = self.parts[first..].iter().position(|part| part.chart == chart);
            let index = known.map_or(self.parts.len(), |k| first + k);
            if known.is_none() {
                let [x, y] = place.at;
                self.parts.push(Part { chart, x, y, nodes: NodeSet::EMPTY });
            }
            self.parts[index].nodes.insert(i, j);
        }
        self.counts.covered += cover.covered.count();
        self.counts.layered += cover.layered.count();
        if !(cover.covered.is_empty() && cover.interior.is_empty()) {
            self.counts.at_gaps += cover.at_gaps.count();
        }
        self.squares.push(nodes);
        self.sets.push(sets);
    }

    /// Adds a rigid node of a chart to a square. The parts of the square begin at `first` in `of_features`.
    fn add_rigid(&mut self, first: usize, chart: u32, [x, y]: [u32; 2], [i, j]: [usize; 2], at_border: bool) {
        let known = self.of_features[first..].iter().position(|of| of.part.chart == chart);
        let index = known.map_or(self.of_features.len(), |k| first + k);
        if known.is_none() {
            let part = Part { chart, x, y, nodes: NodeSet::EMPTY };
            self.of_features.push(RigidPart { part, fixed: NodeSet::EMPTY });
        }
        let RigidPart { part, fixed } = &mut self.of_features[index];
        part.nodes.insert(i, j);
        if at_border {
            fixed.insert(i, j);
        }
    }
}
