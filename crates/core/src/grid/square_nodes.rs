//! The nodes of the squares that triangles cover, by all that does not depend on rigidity: another rigidity then needs
//! no triangles to tell which charts may move, and how much of what is rigid is fixed.

use super::blocks::Part;
use super::cover::Cover;
use super::node_set::{NodeSet, NodeWindow};
use super::squares::{Square, layers};
use crate::allocation::Vec;
use crate::grid::planes::{NODES, SIDE};
use crate::mesh::TileMesh;

/// The nodes of a square of level 0.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct SquareNodes {
    pub square: Square,
    /// Nodes that a triangle of a chart covers, not only one of a collar.
    pub covered: NodeSet,
    /// Nodes that may move if their chart has rigidity.
    pub free: NodeSet,
    /// Nodes that more than one layer covers.
    pub layered: NodeSet,
}

impl SquareNodes {
    /// `free` are the nodes that the mask leaves free.
    pub fn new(square: Square, cover: &Cover, free: NodeSet) -> SquareNodes {
        let free = cover.interior.and(free);
        SquareNodes { square, covered: cover.covered, free, layered: cover.layered }
    }
}

/// The least rigidity of a node that counts as rigid.
pub const RIGID: f32 = 0.5;

/// The nodes of a square with some rigidity.
#[derive(Clone, Copy, Debug, Default)]
pub struct RigidSets {
    /// Nodes with any rigidity.
    pub any: NodeSet,
    /// Nodes with a rigidity of at least `RIGID`.
    pub rigid: NodeSet,
}

impl RigidSets {
    /// Of the rigidity at a square's nodes, row by row.
    pub fn new(rigidity: &[f32; NODES]) -> RigidSets {
        let mut sets = RigidSets::default();
        for (j, row) in rigidity.chunks_exact(SIDE).enumerate() {
            let (mut any, mut rigid) = (0u32, 0u32);
            for (i, &value) in row.iter().enumerate() {
                any |= u32::from(value > 0.0) << i;
                rigid |= u32::from(value >= RIGID) << i;
            }
            (sets.any.0[j], sets.rigid.0[j]) = (any as u16, rigid as u16);
        }
        sets
    }
}

/// A tile's squares, and the layer of each chart.
pub struct SquaresOf<'a> {
    pub list: &'a [SquareNodes],
    layers: Vec<u32>,
}

impl<'a> SquaresOf<'a> {
    /// `list` is sorted by layer, y, x.
    pub fn new(list: &'a [SquareNodes], tile: &TileMesh) -> SquaresOf<'a> {
        SquaresOf { list, layers: layers(tile) }
    }

    /// The index of the square at (x, y) in the layer of a chart.
    pub fn find(&self, chart: u32, [x, y]: [u32; 2]) -> Option<usize> {
        let square = Square { layer: self.layers[chart as usize], at: [x, y] };
        self.list.binary_search_by_key(&square.key(), |nodes| nodes.square.key()).ok()
    }

    /// True if rigidity is not 0 at a node of a part or next to one: the weight of an edge is the larger rigidity of
    /// its two ends. `sets` has an entry per square.
    pub fn is_near_rigidity(&self, part: &Part, sets: &[RigidSets]) -> bool {
        let any = |square: Option<usize>| square.map_or(NodeSet::EMPTY, |k| sets[k].any);
        if !any(self.find(part.chart, [part.x, part.y])).and(part.nodes).is_empty() {
            return true;
        }
        let around = NodeWindow::new(|n| {
            let place = |at: u32, d: usize| (at + d as u32).checked_sub(1);
            let at = place(part.x, n % 3).zip(place(part.y, n / 3));
            any(at.and_then(|(x, y)| self.find(part.chart, [x, y])))
        });
        !around.dilated().and(part.nodes).is_empty()
    }
}
