//! Rigidity on all levels (method §3), in the blocks of a survey. It is stored at the nodes that are *relevant*, which
//! are the movable nodes and their neighbours; edges between other nodes have no effect.

use super::blocks::Blocks;
use super::codes::{decode_rigidity, encode_rigidity};
use super::node_set::{NodeSet, NodeWindow};
use super::survey::SurveyLevel;
use super::window::{self, WINDOW_NODES, place};
use crate::allocation::{Vec, vec};
use crate::grid::planes::{NODES, Plane, SIDE, slot};
use crate::mesh::NONE;
use crate::team::Team;

/// The relevant nodes of a block: movable nodes and their neighbours.
pub fn relevant_of(level: &SurveyLevel, b: usize) -> NodeSet {
    level.blocks.window(&level.movable, b).dilated()
}

/// The relevant nodes of each block.
pub fn relevant(team: &Team, level: &SurveyLevel) -> Vec<NodeSet> {
    let mut relevant = vec![NodeSet::EMPTY; level.movable.len()];
    team.fill(&mut relevant, |b, relevant| *relevant = relevant_of(level, b));
    relevant
}

/// Rigidity of a block of the next coarser level at its `relevant` nodes: a 3x3 Gaussian (the paper's eq. 7) over the
/// relevant finer nodes. `children` are the finer blocks of the block's quarters.
pub fn coarser_block(
    finer: &Blocks,
    relevant_finer: &[NodeSet],
    codes: &[Plane<u16>],
    children: &[u32; 4],
    relevant: NodeSet,
    out: &mut Plane<u16>,
) {
    *out = [0; NODES];
    let mut values = [0.0f32; WINDOW_NODES];
    for (quarter, &child) in children.iter().enumerate().filter(|(_, child)| **child != NONE) {
        let window = window::of(&finer.neighbours[child as usize], 0, |b| &codes[b]);
        values.iter_mut().zip(&window).for_each(|(value, &code)| *value = decode_rigidity(code));
        let relevant_here = finer.window(relevant_finer, child as usize);
        for j in 0..SIDE / 2 {
            let means = gaussian(&values, &relevant_here, 2 * j + 1);
            for (i, mean) in means.into_iter().enumerate() {
                let (x, y) = (i + quarter % 2 * 8, j + quarter / 2 * 8);
                if relevant.contains(x, y) {
                    out[slot(x, y)] = encode_rigidity(mean);
                }
            }
        }
    }
}

/// The mean rigidity of the relevant nodes among the 3x3 nodes around each odd node of row `j` of a window. That of
/// other nodes is 0.
fn gaussian(values: &[f32; WINDOW_NODES], relevant: &NodeWindow, j: usize) -> [f32; SIDE / 2] {
    const WEIGHTS: [f32; 3] = [1.0, 2.0, 1.0];
    const ALL: u32 = (1 << (SIDE + 1)) - 1;
    let mut sums = [0.0; SIDE / 2];
    for (y, of_row) in (j - 1..).zip(WEIGHTS) {
        for (x, of_column) in WEIGHTS.into_iter().enumerate() {
            let row = &values[place(x, y)..][..SIDE / 2];
            sums.iter_mut().zip(row).for_each(|(sum, value)| *sum += of_row * of_column * value);
        }
    }
    if (j - 1..j + 2).all(|y| relevant.0[y] & ALL == ALL) {
        return sums.map(|sum| sum / 16.0);
    }
    std::array::from_fn(|i| {
        let mut weights = 0.0;
        for (y, of_row) in (j - 1..).zip(WEIGHTS) {
            for (x, of_column) in WEIGHTS.into_iter().enumerate() {
                weights += if relevant.contains(2 * i + x, y) { of_row * of_column } else { 0.0 };
            }
        }
        // A relevant node is movable or has a movable neighbour, around which all finer nodes are relevant: the sum of
        // the weights is not 0.
        sums[i] / weights
    })
}
