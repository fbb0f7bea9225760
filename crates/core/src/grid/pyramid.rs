//! Rigidity on all levels (method §3), in the blocks of a survey. It is stored at the nodes that are *relevant*, which are
//! the movable nodes and their neighbours; edges between other nodes have no effect.

use super::codes::{decode_rigidity, encode_rigidity};
use super::cover::at;
use super::node_set::NodeSet;
use super::rigidity::NodeRigidity;
use super::survey::SurveyLevel;
use super::window::{self, WINDOW_NODES, place};
use crate::allocation::{Vec, zeroed};
use crate::grid::planes::{NODES, Plane, SIDE, slot};
use crate::mesh::NONE;
use crate::team::Team;

/// The relevant nodes of each block: movable nodes and their neighbours.
pub fn relevant(level: &SurveyLevel) -> Vec<NodeSet> {
    (0..level.movable.len()).map(|b| level.blocks.window(&level.movable, b).dilated()).collect()
}

/// Rigidity on level 0, per block, as codes of `encode_rigidity`; 0 at nodes that are not relevant.
pub fn finest(
    team: &Team,
    rigidity: &NodeRigidity,
    level: &SurveyLevel,
    relevant: &[NodeSet],
) -> Vec<Plane<u16>> {
    let mut codes = zeroed::<[u16; NODES]>(level.blocks.list.len());
    team.fill(&mut codes, |b, codes| finest_block(rigidity, level, relevant, b, codes));
    codes
}

/// Rigidity of one block on level 0, as codes of `encode_rigidity`; 0 at nodes that are not relevant.
pub fn finest_block(
    rigidity: &NodeRigidity,
    level: &SurveyLevel,
    relevant: &[NodeSet],
    b: usize,
    codes: &mut Plane<u16>,
) {
    let block = &level.blocks.list[b];
    *codes = [0; NODES];
    let Some(square) = rigidity.coverer.squares.find(block.chart, block.x, block.y) else { return };
    let cover = rigidity.coverer.cover(square);
    let values = rigidity.window([block.x, block.y], &cover);
    for j in 0..SIDE {
        for i in (0..SIDE).filter(|&i| relevant[b].contains(i, j)) {
            codes[slot(i, j)] = encode_rigidity(values[at(i + 1, j + 1)]);
        }
    }
}

/// One level of the pyramid.
pub struct Relevant<'a> {
    pub level: &'a SurveyLevel,
    /// The relevant nodes of each block.
    pub relevant: &'a [NodeSet],
}

/// Rigidity of a block of the next coarser level: a 3x3 Gaussian (the paper's eq. 7) over the relevant finer nodes.
/// `children` are the finer blocks of the block's quarters.
pub fn coarser_block(
    finer: &Relevant,
    codes: &[Plane<u16>],
    coarser: &Relevant,
    children: &[u32; 4],
    b: usize,
) -> Plane<u16> {
    let mut out = [0; NODES];
    let mut window = [0u16; WINDOW_NODES];
    for (quarter, &child) in children.iter().enumerate().filter(|(_, child)| **child != NONE) {
        let blocks = &finer.level.blocks;
        window::load(&blocks.neighbours[child as usize], 0, |b| &codes[b], &mut window);
        let relevant = blocks.window(finer.relevant, child as usize);
        for j in 0..SIDE / 2 {
            for i in 0..SIDE / 2 {
                let (x, y) = (i + quarter % 2 * 8, j + quarter / 2 * 8);
                if coarser.relevant[b].contains(x, y) {
                    out[slot(x, y)] = encode_rigidity(gaussian(&window, &relevant, 2 * i + 1, 2 * j + 1));
                }
            }
        }
    }
    out
}

/// The mean rigidity of the relevant nodes among the 3x3 nodes around (i, j) of a window.
fn gaussian(window: &[u16; WINDOW_NODES], relevant: &super::node_set::NodeWindow, i: usize, j: usize) -> f32 {
    let mut sum = 0.0;
    let mut weights = 0.0;
    for dj in 0..3 {
        for di in 0..3 {
            let (x, y) = (i + di - 1, j + dj - 1);
            if relevant.contains(x, y) {
                let weight = [1.0, 2.0, 1.0][di] * [1.0, 2.0, 1.0][dj];
                sum += weight * decode_rigidity(window[place(x, y)]);
                weights += weight;
            }
        }
    }
    // A relevant node is movable or has a movable neighbour, around which all finer nodes are relevant: the sum of the weights
    // is not 0.
    sum / weights
}
