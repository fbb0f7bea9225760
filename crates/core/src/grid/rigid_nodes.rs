//! Counts of the rigid nodes of a tile, and of those that cannot move.

use super::cover::{Cover, WIDE, at};
use super::node_set::NodeSet;
use crate::allocation::Vec;
use crate::grid::planes::{NODES, SIDE};

/// Rigid nodes of a square of level 0.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct RigidNodes {
    /// Position of the square, in blocks.
    pub square: [u32; 2],
    /// Number of covered nodes with a rigidity of at least `RIGID`.
    pub rigid: u16,
    /// Number of these nodes that are fixed, whatever their chart.
    pub frozen: u16,
    /// Number of these nodes that several triangles lie over.
    pub overlapped: u16,
}

/// The fraction of the rigid nodes that are fixed.
pub(super) fn frozen_share(squares: &[RigidNodes]) -> f32 {
    sum(squares, |square| square.frozen) as f32 / sum(squares, |square| square.rigid).max(1) as f32
}

/// The sum of a number over squares.
pub(super) fn sum(squares: &[RigidNodes], of: fn(&RigidNodes) -> u16) -> u64 {
    squares.iter().map(|square| u64::from(of(square))).sum()
}

/// The least rigidity of a node that counts as rigid.
pub(super) const RIGID: f32 = 0.5;

/// The rigid nodes of a square, given the rigidity in its window.
pub(super) fn rigid_nodes(
    square: [u32; 2],
    cover: &Cover,
    free: &NodeSet,
    rigidity: &[f32; WIDE * WIDE],
) -> RigidNodes {
    let mut found = RigidNodes { square, rigid: 0, frozen: 0, overlapped: 0 };
    for (i, j) in (0..SIDE * SIDE).map(|n| (n % SIDE, n / SIDE)) {
        if cover.covered.contains(i, j) && rigidity[at(i + 1, j + 1)] >= RIGID {
            found.rigid += 1;
            found.overlapped += u16::from(cover.layered.contains(i, j));
            found.frozen += u16::from(!(cover.interior.contains(i, j) && free.contains(i, j)));
        }
    }
    found
}

/// The rigid nodes of squares, those of all layers together.
pub(super) fn merged(mut found: Vec<RigidNodes>) -> Vec<RigidNodes> {
    found.sort_unstable_by_key(|of| (of.square[1], of.square[0]));
    found.dedup_by(|next, first| {
        let same = next.square == first.square;
        if same {
            // A node where two charts touch counts once.
            first.rigid = (first.rigid + next.rigid).min(NODES as u16);
            first.frozen = (first.frozen + next.frozen).min(first.rigid);
            first.overlapped = (first.overlapped + next.overlapped).min(first.rigid);
        }
        same
    });
    found
}
