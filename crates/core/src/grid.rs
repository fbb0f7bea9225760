//! The grid of a tile (method §1 to §3), built from the mesh, the maps and the settings: rigidity, mobility, blocks,
//! rest lengths and weights of interpolation on every level, and the triangle under each node of level 0. First a
//! survey finds the nodes that may move; everything else is then computed for their blocks alone.

pub mod squares;
pub mod cover;
pub mod keep;
mod rigidity;
mod rigid_levels;
pub mod square_nodes;
pub mod vertex_mask;
pub mod survey;
pub mod build;
pub mod repaint;
pub mod saved;
pub mod planes;
pub mod node_set;
pub mod blocks;
pub mod codes;
pub mod coverage;
pub mod density;
pub mod fill;
pub mod gather;
pub mod window;
pub mod features;
pub mod labels;
pub mod interpolation;
mod joined;
pub mod maps;
pub mod metric;
pub mod mirrors;
pub mod pose;
pub mod pyramid;
mod rest;
pub mod rigid_nodes;
pub mod pieces;
pub mod uv_triangle;

use std::sync::Arc;

use glam::DVec2;

use crate::allocation::Vec;
use crate::mesh::TileMesh;
use blocks::{Blocks, Part};
use codes::Lengths;
use features::Features;
use gather::Gather;
use interpolation::StiffnessPlanes;
use mirrors::Hold;
use planes::{NODES, Plane};
use pose::{Pose, PoseTriangle};
use rigid_nodes::RigidNodes;
use square_nodes::SquareNodes;
use survey::{Survey, SurveyLevel};
use uv_triangle::UvTriangle;

/// One level of a tile's grid: all of its data that does not depend on the pose. Data that does not depend on the
/// rigidity either is shared between grids that differ only in rigidity.
#[derive(Clone, Debug, Default)]
pub struct Level {
    /// Cells along u.
    pub nx: usize,
    /// Cells along v.
    pub ny: usize,
    pub blocks: Arc<Blocks>,
    /// Per block: rigidity, as codes of `codes::encode_rigidity`.
    pub rigidity: Vec<Plane<u16>>,
    /// Per block: density ρ of rigid material around each node, 0..1 (method §4). Empty unless a setting asks for it.
    pub density: Arc<Vec<Plane>>,
    /// Per block: what holds nodes near open borders along which texture slides. Empty where it does not.
    pub hold: Arc<Vec<Plane<Hold>>>,
    /// Per block: weight of each node's lower neighbour where corrections are interpolated from the next coarser level
    /// (method §7.5; the upper neighbour has the rest), as codes of `codes::encode_weight`. Empty on the coarsest
    /// level.
    pub interpolation: Vec<Plane<u8>>,
    /// Per block: the stiffness from which the weights follow. Empty on levels 0 and 1, where it is quick to compute.
    pub stiffness: Vec<StiffnessPlanes>,
    /// Per block: 1 for movable nodes, 0 for fixed ones.
    pub movable: Arc<Vec<Plane<u8>>>,
    /// Per block: rest lengths l of the edges `EDGES` of each node, in units of the chart, as codes of `lengths`.
    pub rest_length: Arc<Vec<[Plane<u16>; 4]>>,
    /// Per chart: the coding of rest lengths, for each of `EDGES`.
    pub lengths: Vec<[Lengths; 4]>,
    /// Per chart: floor of rest lengths (method §2).
    pub floor: Vec<f32>,
    /// Per block, on coarser levels: each node's coverage θ by the chart, 0..1 (method §3).
    pub coverage: Arc<Vec<Plane>>,
    /// Per block: the block of the next finer level at (2x, 2y), (2x + 1, 2y), (2x, 2y + 1), (2x + 1, 2y + 1).
    pub children: Arc<Vec<[u32; 4]>>,
    /// Per block: the block of the next coarser level that holds its even nodes, or `NONE`.
    pub parent: Arc<Vec<u32>>,
}

impl Level {
    /// Cells along u and v.
    pub fn cells(&self) -> DVec2 {
        DVec2::new(self.nx as f64, self.ny as f64)
    }
}

/// A tile's grid: all data that is built once per mesh, maps and settings.
#[derive(Clone, Debug, Default)]
pub struct Grid {
    pub levels: Vec<Level>,
    pub triangles: Arc<Vec<UvTriangle>>,
    pub chart_of: Arc<Vec<u32>>,
    /// Per block of level 0: the triangle under each node at rest.
    pub triangle: Arc<Vec<Plane<u32>>>,
    /// The triangles in the dual cell of each node of level 1, with their fractions of its covered area.
    pub gather: Arc<Gather>,
    /// Movable nodes of level 0, per chart; 0 for a chart without rigidity (method §1).
    pub movable: Vec<u64>,
    /// Fraction of the covered nodes that more than one layer covers.
    pub overlap: f32,
    /// Nodes inside charts that gaps in the UVs fix.
    pub at_gaps: u64,
    /// True if nodes have a density, or something that holds them.
    pub has_extra: bool,
    /// The painted features.
    pub features: Arc<Features>,
    /// The rest pose, in units of the charts.
    pub rest: Arc<Pose>,
    /// The blocks and movable nodes of each level.
    survey: Arc<Vec<SurveyLevel>>,
    /// The nodes of each square that may move if their chart has rigidity.
    parts: Arc<Vec<Part>>,
    /// The squares that triangles cover, sorted by layer, y, x.
    squares: Arc<Vec<SquareNodes>>,
    /// Per part: true if the rigidity is not 0 at one of its nodes or next to one.
    rigid: Vec<bool>,
    /// The rigid nodes of the squares that triangles cover, sorted by y, x.
    rigid_nodes: Vec<RigidNodes>,
}

/// Most movable nodes of a chart on the coarsest level of a descent (method §5).
const COARSEST_NODES: u64 = 256;
/// Floor of rest lengths, as a fraction of the chart's median edge (method §2): a texel that maps onto almost nothing
/// must not dominate the energy.
const FLOOR_FRACTION: f32 = 0.05;

impl Grid {
    /// The coarsest level that the descent works on: the finest one on which no chart has more movable nodes than
    /// `COARSEST_NODES`, but not level 0 if there is another, since a draft ends on level 1.
    pub fn coarsest(&self) -> usize {
        let last = self.levels.len() - 1;
        let small = self.survey.iter().position(|level| level.most_movable <= COARSEST_NODES);
        small.unwrap_or(last).max(last.min(1))
    }

    /// Fraction of the covered rigid nodes that do not move.
    pub fn fixed(&self) -> f32 {
        self.rigid_sum(|nodes| nodes.fixed) as f32 / self.rigid_sum(|nodes| nodes.rigid).max(1) as f32
    }

    /// The sum of a number over the squares with rigid nodes.
    pub fn rigid_sum(&self, of: fn(&RigidNodes) -> u16) -> u64 {
        self.rigid_nodes.iter().map(|nodes| u64::from(of(nodes))).sum()
    }

    /// True if another grid has the same blocks, so that the two differ in rigidity at most.
    pub fn has_blocks_of(&self, other: &Grid) -> bool {
        Arc::ptr_eq(&self.triangle, &other.triangle)
    }

    /// True if the identity is a chart's best warp for a pose, so that it needs no solve (method §5): it has no movable
    /// node, its floor is 0, or its triangle edges are as long as at rest.
    pub fn is_still(&self, tile: &TileMesh, pose: &Pose, chart: usize) -> bool {
        self.movable[chart] == 0
            || self.levels[0].floor[chart] == 0.0
            || pose.is_isometric(&self.rest, tile, chart)
    }

    /// Returns the function from a triangle's number to the triangle in a pose.
    pub fn pose_triangles<'a>(
        &'a self,
        tile: &'a TileMesh,
        pose: &'a Pose,
    ) -> impl Fn(usize) -> PoseTriangle + 'a {
        move |t| {
            let positions = &pose.charts[self.chart_of[t] as usize].positions;
            let corners = tile.triangles[t].local.map(|v| positions[v as usize]);
            PoseTriangle::new(corners, &self.triangles[t].barycentric)
        }
    }

    /// Bytes held.
    pub fn bytes(&self) -> u64 {
        let extra = if self.has_extra { size_of::<Plane>() } else { 0 };
        let level_bytes = |(k, level): (usize, &Level)| level.blocks.list.len() * (block_bytes(k) + extra);
        let counts = self.rigid_nodes.len() * size_of::<RigidNodes>();
        let squares = self.squares.len() * size_of::<SquareNodes>() + counts;
        let parts = self.parts.len() * (size_of::<Part>() + 1) + squares;
        let levels: usize = self.levels.iter().enumerate().map(level_bytes).sum();
        let level_1 = self.levels.get(1).map_or(0, |level| level.blocks.list.len());
        let gather = self.gather.bytes().saturating_sub(level_1 * NODES * GATHER_BYTES);
        (levels + parts + gather + self.triangles.len() * TRIANGLE_BYTES + self.rest.bytes()) as u64
    }
}

/// Bytes of a block of level k: its nodes' rigidity, mobility, rest lengths, interpolation weights, features, and
/// triangles or coverage, and its entry among the blocks. On level 1 this includes the minimum for `Gather`.
fn block_bytes(k: usize) -> usize {
    let gather = if k == 1 { GATHER_BYTES } else { 0 };
    let stiffness = if k > 1 { size_of::<StiffnessPlanes>() } else { 0 };
    let place = size_of::<blocks::Block>() + size_of::<node_set::NodeSet>() + (9 + 4 + 1) * 4;
    let tags = if k < features::LEVELS { features::BLOCK_BYTES } else { 0 };
    (2 + 1 + 8 + 1 + 4 + gather) * NODES + stiffness + place + tags
}

impl Survey<'_> {
    /// Estimated bytes of the grid, before it is built.
    pub fn grid_bytes(&self) -> u64 {
        survey_bytes(&self.levels, self.triangles.len(), self.squares.len(), self.has_extra)
    }
}

/// Estimated bytes of a grid with these levels.
fn survey_bytes(levels: &[SurveyLevel], triangles: usize, squares: usize, has_extra: bool) -> u64 {
    let extra = if has_extra { size_of::<Plane>() } else { 0 };
    let per_level = |(k, level): (usize, &SurveyLevel)| level.blocks.list.len() * (block_bytes(k) + extra);
    let levels: usize = levels.iter().enumerate().map(per_level).sum();
    (levels + triangles * TRIANGLE_BYTES + squares * SQUARE_BYTES) as u64
}

/// Bytes per node of level 1 that is covered by one triangle.
const GATHER_BYTES: usize = 4 + 8;

/// Bytes of a square that triangles cover.
const SQUARE_BYTES: usize = size_of::<SquareNodes>() + size_of::<RigidNodes>();

/// Bytes of a triangle: its UVs, its chart and its vertices at rest.
const TRIANGLE_BYTES: usize = size_of::<UvTriangle>() + 4;
