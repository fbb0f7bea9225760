//! Rigid features that touch a border of their chart are fixed where they are, whole: half of a feature that regains
//! its shape beside a border that cannot move would make an hourglass of it (method §16).

use super::blocks::Part;
use super::node_set::{NodeSet, NodeWindow};
use super::rigid_nodes::RigidNodes;
use crate::allocation::Vec;

/// The rigid nodes of a chart in a square.
#[derive(Clone, Copy, Debug)]
pub struct RigidPart {
    pub part: Part,
    /// Fixed nodes: at first the ones at a border.
    pub fixed: NodeSet,
}

/// Extends what is fixed to all rigid nodes that hang together with it in a chart, diagonals included.
pub fn spread(rigid: &mut [RigidPart]) {
    rigid.sort_unstable_by_key(|of| of.part.key());
    let neighbours = |rigid: &[RigidPart], k: usize| -> [Option<usize>; 9] {
        let Part { chart, x, y, .. } = rigid[k].part;
        std::array::from_fn(|n| {
            let at = |x: u32, d: usize| (x + d as u32).checked_sub(1);
            let key = (chart, at(y, n / 3)?, at(x, n % 3)?);
            rigid.binary_search_by_key(&key, |of| of.part.key()).ok()
        })
    };
    let mut open: Vec<usize> = (0..rigid.len()).filter(|&k| !rigid[k].fixed.is_empty()).collect();
    while let Some(k) = open.pop() {
        let around = neighbours(rigid, k);
        for k in around.into_iter().flatten() {
            let around = neighbours(rigid, k);
            let set = |n: usize| around[n].map_or(NodeSet::EMPTY, |other| rigid[other].fixed);
            let mut sets: [NodeSet; 9] = std::array::from_fn(set);
            let before = sets[4];
            loop {
                let next = NodeWindow::new(|n| sets[n]).dilated().and(rigid[k].part.nodes);
                if next == sets[4] {
                    break;
                }
                sets[4] = next;
            }
            if sets[4] != before {
                rigid[k].fixed = sets[4];
                open.push(k);
            }
        }
    }
}

/// Takes these nodes out of the parts that may move, and counts them among the fixed ones. `rigid` is sorted as by
/// `spread`.
pub(super) fn fix(rigid: &[RigidPart], parts: &mut Vec<(Part, bool)>, squares: &mut [RigidNodes]) {
    for (part, _) in parts.iter_mut() {
        let Ok(k) = rigid.binary_search_by_key(&part.key(), |of| of.part.key()) else { continue };
        let taken = part.nodes.and(rigid[k].fixed);
        part.nodes = part.nodes.without(taken);
        let at = squares.binary_search_by_key(&[part.y, part.x], |of| [of.square[1], of.square[0]]);
        if let Ok(at) = at {
            let square = &mut squares[at];
            square.fixed = (square.fixed + taken.count() as u16).min(square.rigid);
        }
    }
    parts.retain(|(part, _)| !part.nodes.is_empty());
}
