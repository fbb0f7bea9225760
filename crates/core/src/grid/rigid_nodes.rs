//! Counts of the rigid nodes of a tile, and of those that cannot move.

use super::square_nodes::{RigidSets, SquareNodes};
use crate::allocation::Vec;
use crate::grid::planes::NODES;

/// Rigid nodes of a square of level 0.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct RigidNodes {
    /// Position of the square, in blocks.
    pub square: [u32; 2],
    /// Number of covered nodes with a rigidity of at least `RIGID`.
    pub rigid: u16,
    /// Number of these nodes that are fixed, whatever their chart.
    pub fixed: u16,
    /// Number of these nodes that several triangles lie over.
    pub overlapped: u16,
}

/// The rigid nodes of squares, those of all layers together. `sets` has an entry per square.
pub(super) fn rigid_nodes(squares: &[SquareNodes], sets: &[RigidSets]) -> Vec<RigidNodes> {
    let covered = squares.iter().zip(sets).filter(|(square, _)| !square.covered.is_empty());
    let mut found: Vec<_> = covered.map(|(square, sets)| of_square(square, sets)).collect();
    found.sort_unstable_by_key(|of| (of.square[1], of.square[0]));
    found.dedup_by(|next, first| {
        let same = next.square == first.square;
        if same {
            // A node where two charts touch counts once.
            first.rigid = (first.rigid + next.rigid).min(NODES as u16);
            first.fixed = (first.fixed + next.fixed).min(first.rigid);
            first.overlapped = (first.overlapped + next.overlapped).min(first.rigid);
        }
        same
    });
    found
}

pub(super) fn of_square(nodes: &SquareNodes, sets: &RigidSets) -> RigidNodes {
    let rigid = nodes.covered.and(sets.rigid);
    let [rigid, fixed, overlapped] =
        [rigid, rigid.without(nodes.free), rigid.and(nodes.layered)].map(|nodes| nodes.count() as u16);
    RigidNodes { square: nodes.square.at, rigid, fixed, overlapped }
}
