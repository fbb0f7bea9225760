//! The painted features of a grid (method §4, Harm). A feature is a set of nodes of one chart with more than half of
//! the chart's largest rigidity, connected by edges with at least one movable end: other edges may cross a border, and
//! keep their lengths. Coarser levels have its nodes that they share with level 0.

use super::planes::Plane;
use crate::allocation::Vec;

/// Levels on which features are weighed: features have to find their places before the finest one.
pub const LEVELS: usize = 3;
/// Fewest edges of a feature.
pub const LEAST_EDGES: u32 = 12;
/// Bytes of a block's tags, and of its part of the lists where it has two pieces.
pub const BLOCK_BYTES: usize = size_of::<Plane<u16>>() + 48;

/// The features of a grid.
#[derive(Clone, Debug, Default)]
pub struct Features {
    /// Number of features.
    pub count: usize,
    /// The finest levels, at most `LEVELS`.
    pub levels: Vec<Pieces>,
}

/// The features on one level, in pieces. A piece is what one block has of a feature.
#[derive(Clone, Debug, Default)]
pub struct Pieces {
    /// Per block and node: in the lower 8 bits 1 plus the place of its piece among those of the block, or 0; above them
    /// one bit for each owned edge inside of the feature.
    pub tags: Vec<Plane<u16>>,
    /// Per block, the first of its pieces, and then the number of all.
    pub first: Vec<u32>,
    /// Per piece, its feature.
    pub feature: Vec<u32>,
    /// Per feature, its first entry in `of_feature`, and then the number of all entries.
    pub first_of_feature: Vec<u32>,
    /// The pieces of each feature, in their order.
    pub of_feature: Vec<u32>,
    /// Per feature, the number of its edges.
    pub edges: Vec<u32>,
}

impl Pieces {
    /// The pieces of a feature, in their order.
    pub fn of(&self, feature: usize) -> &[u32] {
        &self.of_feature[self.first_of_feature[feature] as usize..self.first_of_feature[feature + 1] as usize]
    }

    /// Appends the pieces of another grid, whose features follow the first `features`.
    pub fn append(&mut self, other: &Pieces, features: u32) {
        let pieces = self.feature.len() as u32;
        // The last number of either list is the first one of what follows.
        self.first.pop();
        self.first_of_feature.pop();
        self.tags.extend_from_slice(&other.tags);
        self.first.extend(other.first.iter().map(|n| n + pieces));
        self.feature.extend(other.feature.iter().map(|n| n + features));
        self.first_of_feature.extend(other.first_of_feature.iter().map(|n| n + pieces));
        self.of_feature.extend(other.of_feature.iter().map(|n| n + pieces));
        self.edges.extend_from_slice(&other.edges);
    }
}
