//! The survey of a tile: which nodes may move on which level, and hence which blocks there are. It visits the squares
//! that the tile's triangles meet, holds a few bytes per square, and computes how much memory a grid will need before
//! any of it is allocated.

use std::sync::Arc;

use super::blocks::{Blocks, Part};
use super::cover::{Coverer, WIDE, at};
use super::keep::{self, RigidPart};
use super::node_set::NodeSet;
use super::rigid_nodes::{RIGID, RigidNodes, merged, rigid_nodes};
use super::rigidity::NodeRigidity;
use crate::allocation::{Vec, zeroed};
use crate::grid::maps::MapsOfTile;
use crate::grid::planes::SIDE;
use crate::grid::uv_triangle::{UvTriangle, uv_triangles};
use crate::mesh::{NONE, TileMesh};
use crate::settings::Seams;
use crate::team::Team;

/// Which nodes of a tile may move.
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
    /// The rigid nodes of the squares that triangles cover, sorted by y, x.
    pub rigid_nodes: Vec<RigidNodes>,
    /// Whether nodes have a density, or something that holds them.
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
        let rigidity = NodeRigidity { maps, coverer: &coverer, triangles: &triangles };
        let squares = coverer.squares.list.len();
        let keeps = maps.own.settings.seams == Seams::Keep;
        let found = team.map(squares.div_ceil(CHUNK), |chunk| {
            let mut found = Found { keeps, ..Found::default() };
            for square in chunk * CHUNK..((chunk + 1) * CHUNK).min(squares) {
                found.add_square(&rigidity, square);
            }
            found
        });
        let mut counts = Counts::default();
        let mut rigid_nodes = Vec::with_capacity(found.iter().map(|f| f.rigid_nodes.len()).sum());
        let mut parts: Vec<(Part, bool)> = Vec::with_capacity(found.iter().map(|f| f.parts.len()).sum());
        let mut of_features: Vec<RigidPart> =
            Vec::with_capacity(found.iter().map(|f| f.of_features.len()).sum());
        for of_chunk in found {
            counts.covered += of_chunk.counts.covered;
            counts.layered += of_chunk.counts.layered;
            counts.at_gaps += of_chunk.counts.at_gaps;
            rigid_nodes.extend(of_chunk.rigid_nodes);
            parts.extend(of_chunk.parts);
            of_features.extend(of_chunk.of_features);
        }
        let mut rigid_nodes = merged(rigid_nodes);
        keep::spread(&mut of_features);
        keep::fix(&of_features, &mut parts, &mut rigid_nodes);
        parts.sort_unstable_by_key(|(part, _)| (part.chart, part.y, part.x));
        let rigid: Vec<bool> = parts.iter().map(|(_, rigid)| *rigid).collect();
        let parts: Vec<Part> = parts.into_iter().map(|(part, _)| part).collect();
        let movable = movable_of_charts(tile.charts.len(), &parts, &rigid);
        let levels = levels(team, [nx, ny], &movable, &parts);
        let has_extra = maps.own.settings.orientation_density > 0.0 || tile.has_images();
        Survey { coverer, triangles, parts, rigid, levels, movable, counts, rigid_nodes, has_extra }
    }

    /// Bytes of the survey that the grid does not keep.
    pub fn bytes(&self) -> u64 {
        self.coverer.squares.bytes() as u64
    }

    /// Fraction of the covered nodes that more than one layer covers.
    pub fn overlap(&self) -> f32 {
        self.counts.layered as f32 / self.counts.covered.max(1) as f32
    }

    /// True if a node is rigid.
    pub fn has_rigid_nodes(&self) -> bool {
        self.rigid_nodes.iter().any(|square| square.rigid > 0)
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

/// The blocks of all levels. A coarse node may move only if all of the 3x3 finer nodes around it may (the paper's eq. 8),
/// so that bilinear prolongation never moves a fixed node, nor one of another chart. An odd last column or row of cells
/// is dropped; the nodes at its inner side are fixed by the same rule.
pub(super) fn levels(team: &Team, size: [usize; 2], movable: &[u64], parts: &[Part]) -> Vec<SurveyLevel> {
    let parts: Vec<Part> = parts.iter().filter(|part| movable[part.chart as usize] > 0).copied().collect();
    let charts = movable.len();
    let (blocks, sets) = Blocks::new(team, charts, &parts);
    let mut levels = Vec::new();
    levels.push(SurveyLevel { size, blocks: Arc::new(blocks), movable: sets });
    loop {
        let finer = &levels[levels.len() - 1];
        let size = finer.size.map(|n| n / 2);
        let parts = coarser_parts(team, finer);
        if size.contains(&0) || parts.is_empty() {
            return levels;
        }
        let (blocks, sets) = Blocks::new(team, charts, &parts);
        levels.push(SurveyLevel { size, blocks: Arc::new(blocks), movable: sets });
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

/// Whether rigidity is nonzero at a node of a square or next to it: the weight of an edge is the larger rigidity of its
/// two ends.
pub(super) fn has_rigidity(window: &[f32; WIDE * WIDE], i: usize, j: usize) -> bool {
    (0..3).any(|dj| window[at(i, j + dj)..][..3].iter().any(|&r| r > 0.0))
}

/// What a thread found in some squares.
#[derive(Default)]
struct Found {
    /// Each part, and whether rigidity is nonzero at one of its nodes or next to one.
    parts: Vec<(Part, bool)>,
    counts: Counts,
    rigid_nodes: Vec<RigidNodes>,
    /// Whether features at borders are kept; and then the rigid nodes of charts.
    keeps: bool,
    of_features: Vec<RigidPart>,
}

impl Found {
    fn add_square(&mut self, maps: &NodeRigidity, square: usize) {
        let cover = maps.coverer.cover(square);
        if cover.covered.is_empty() && cover.interior.is_empty() {
            return;
        }
        let [x, y] = maps.coverer.squares.list[square].at;
        let rigidity = maps.window([x, y], &cover);
        let free = maps.free(square, &cover);
        let (first, first_feature) = (self.parts.len(), self.of_features.len());
        for j in 0..SIDE {
            for i in 0..SIDE {
                if self.keeps && cover.covered.contains(i, j) && rigidity[at(i + 1, j + 1)] >= RIGID {
                    let chart = maps.coverer.charts[cover.triangle[at(i + 1, j + 1)] as usize];
                    self.add_rigid(first_feature, chart, [x, y], [i, j], !cover.interior.contains(i, j));
                }
                if !cover.interior.contains(i, j) || !free.contains(i, j) {
                    continue;
                }
                let chart = maps.coverer.charts[cover.triangle[at(i + 1, j + 1)] as usize];
                let is_near = has_rigidity(&rigidity, i, j);
                let known = self.parts[first..].iter().position(|(part, _)| part.chart == chart);
                let index = known.map_or(self.parts.len(), |k| first + k);
                if known.is_none() {
                    self.parts.push((Part { chart, x, y, nodes: NodeSet::EMPTY }, false));
                }
                let (part, rigid) = &mut self.parts[index];
                part.nodes.insert(i, j);
                *rigid |= is_near;
            }
        }
        self.rigid_nodes.push(rigid_nodes([x, y], &cover, &free, &rigidity));
        self.counts.covered += cover.covered.count();
        self.counts.layered += cover.layered.count();
        self.counts.at_gaps += cover.at_gaps.count();
    }

    /// Adds a rigid node of a chart in a square, the parts of which begin at `first`.
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
