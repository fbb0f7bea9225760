//! Sets of nodes in a square or block.

use crate::grid::planes::SIDE;

/// A set of the nodes (0..16, 0..16): bit i of word j for node (i, j).
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct NodeSet(pub [u16; SIDE]);

impl NodeSet {
    pub const EMPTY: NodeSet = NodeSet([0; SIDE]);

    pub fn insert(&mut self, i: usize, j: usize) {
        self.0[j] |= 1 << i;
    }

    pub fn remove(&mut self, i: usize, j: usize) {
        self.0[j] &= !(1 << i);
    }

    pub fn contains(&self, i: usize, j: usize) -> bool {
        self.0[j] >> i & 1 != 0
    }

    pub fn is_empty(&self) -> bool {
        self.0 == [0; SIDE]
    }

    /// The nodes that are in both sets.
    pub fn and(self, other: NodeSet) -> NodeSet {
        NodeSet(std::array::from_fn(|j| self.0[j] & other.0[j]))
    }

    /// The nodes that are in one of the sets.
    pub fn or(self, other: NodeSet) -> NodeSet {
        NodeSet(std::array::from_fn(|j| self.0[j] | other.0[j]))
    }

    /// The nodes that are not in the other set.
    pub fn without(self, other: NodeSet) -> NodeSet {
        NodeSet(std::array::from_fn(|j| self.0[j] & !other.0[j]))
    }

    /// Number of nodes in the set.
    pub fn count(&self) -> u64 {
        self.0.iter().map(|row| u64::from(row.count_ones())).sum()
    }
}

/// The nodes (-1..=16, -1..=16) around and in a block: bit i + 1 of word j + 1 for node (i, j).
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct NodeWindow(pub [u32; SIDE + 2]);

impl NodeWindow {
    /// Gathers a block's set and its halo; `set(k)` is the set of the neighbour block k of 3x3, or the empty set if
    /// that block is not stored.
    pub fn new(set: impl Fn(usize) -> NodeSet) -> NodeWindow {
        let sets: [NodeSet; 9] = std::array::from_fn(set);
        NodeWindow(std::array::from_fn(|row| {
            let (k, j) = match row {
                0 => (0, SIDE - 1),
                17 => (6, 0),
                _ => (3, row - 1),
            };
            let [west, centre, east] = [k, k + 1, k + 2].map(|k| u32::from(sets[k].0[j]));
            west >> (SIDE - 1) | centre << 1 | (east & 1) << (SIDE + 1)
        }))
    }

    /// True if the node (i - 1, j - 1) is in the window.
    pub fn contains(&self, i: usize, j: usize) -> bool {
        self.0[j] >> i & 1 != 0
    }

    /// The block's nodes that are in the window together with all of their eight neighbours.
    pub fn eroded(&self) -> NodeSet {
        let rows = self.0.map(|row| row & row << 1 & row >> 1);
        NodeSet(std::array::from_fn(|j| ((rows[j] & rows[j + 1] & rows[j + 2]) >> 1) as u16))
    }

    /// The block's nodes that are in the window or have a neighbour in it.
    pub fn dilated(&self) -> NodeSet {
        let rows = self.0.map(|row| row | row << 1 | row >> 1);
        NodeSet(std::array::from_fn(|j| ((rows[j] | rows[j + 1] | rows[j + 2]) >> 1) as u16))
    }
}
