//! Blocks of 16 by 16 nodes (method §1): the unit in which nodes are stored, worked on and skipped. A block belongs to
//! one chart; where several charts share such a square of the grid, each has a block of its own. The block of a node
//! therefore tells which chart the node belongs to.

use std::ops::Range;

use super::node_set::{NodeSet, NodeWindow};
use super::planes::SIDE;
use crate::allocation::{Vec, vec};
use crate::mesh::NONE;
use crate::team::Team;

/// A stored block.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Block {
    /// The chart that the block belongs to.
    pub chart: u32,
    /// Position in the level along u, in blocks.
    pub x: u32,
    /// Position in the level along v, in blocks.
    pub y: u32,
    /// True if the block holds a movable node. Other blocks are stored only for the halos of their neighbours, and no
    /// stage visits them.
    pub active: bool,
}

/// The stored blocks of one level.
#[derive(Debug, Default)]
pub struct Blocks {
    /// Sorted by chart, y, x.
    pub list: Vec<Block>,
    /// Per block, the 3x3 neighbour blocks of the same chart (itself at 4), or `NONE`.
    pub neighbours: Vec<[u32; 9]>,
    /// The range of each chart in `list`.
    pub of_chart: Vec<Range<usize>>,
}

/// The movable nodes of a chart in a square of the grid.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Part {
    pub chart: u32,
    /// Position of the square, in blocks.
    pub x: u32,
    pub y: u32,
    pub nodes: NodeSet,
}

impl Part {
    /// The sort key of parts.
    pub fn key(&self) -> (u32, u32, u32) {
        (self.chart, self.y, self.x)
    }
}

impl Blocks {
    /// The blocks that hold a movable node or a neighbour of one, and the movable nodes of each. `parts` are sorted by
    /// chart, y, x, and each has at least one node.
    pub fn new(team: &Team, charts: usize, parts: &[Part]) -> (Blocks, Vec<NodeSet>) {
        // (chart, y, x) of the blocks that hold a neighbour of a movable node of another block.
        let mut around: Vec<(u32, u32, u32)> = Vec::new();
        for part in parts {
            let rows = part.nodes.0;
            let any = rows.iter().fold(0, |any, row| any | row);
            // Rows to the south, within and to the north of the block; columns to the west, within and to the east.
            let from_y = [rows[0], any, rows[SIDE - 1]];
            let columns = [1u16, u16::MAX, 1 << (SIDE - 1)];
            for (dy, row) in (-1..=1).zip(from_y) {
                for (dx, column) in (-1..=1).zip(columns) {
                    if (dx, dy) != (0, 0) && row & column != 0 {
                        // Nodes at the rim of the tile are fixed, so no position is negative.
                        let place = |x: u32, d: i64| (i64::from(x) + d) as u32;
                        let key = (part.chart, place(part.y, dy), place(part.x, dx));
                        if parts.binary_search_by_key(&key, Part::key).is_err() {
                            around.push(key);
                        }
                    }
                }
            }
        }
        around.sort_unstable();
        around.dedup();
        let mut list: Vec<Block> = Vec::with_capacity(parts.len() + around.len());
        let mut movable = Vec::with_capacity(parts.len() + around.len());
        let mut around = around.into_iter().peekable();
        let halo = |(chart, y, x)| Block { chart, x, y, active: false };
        for part in parts {
            while let Some(key) = around.next_if(|key| *key < part.key()) {
                list.push(halo(key));
                movable.push(NodeSet::EMPTY);
            }
            list.push(Block { chart: part.chart, x: part.x, y: part.y, active: true });
            movable.push(part.nodes);
        }
        for key in around {
            list.push(halo(key));
            movable.push(NodeSet::EMPTY);
        }
        let mut of_chart = Vec::with_capacity(charts);
        let mut start = 0;
        for c in 0..charts as u32 {
            let end = start + list[start..].partition_point(|b| b.chart == c);
            of_chart.push(start..end);
            start = end;
        }
        let mut blocks = Blocks { list, neighbours: Vec::new(), of_chart };
        let mut neighbours = vec![[NONE; 9]; blocks.list.len()];
        team.fill(&mut neighbours, |b, around| *around = blocks.around(b));
        blocks.neighbours = neighbours;
        (blocks, movable)
    }

    /// The 3x3 blocks around a block that belong to its chart.
    fn around(&self, b: usize) -> [u32; 9] {
        let b = &self.list[b];
        std::array::from_fn(|k| {
            let (x, y) = (i64::from(b.x) + k as i64 % 3 - 1, i64::from(b.y) + k as i64 / 3 - 1);
            self.find(b.chart, x, y)
        })
    }

    /// The part of a node set that covers block `b` and its halo; `sets` has one entry per block.
    pub fn window(&self, sets: &[NodeSet], b: usize) -> NodeWindow {
        let neighbours = &self.neighbours[b];
        NodeWindow::new(|k| if neighbours[k] == NONE { NodeSet::EMPTY } else { sets[neighbours[k] as usize] })
    }

    /// The block of a chart at (x, y), in blocks, or `NONE` if it is not stored.
    pub fn find(&self, chart: u32, x: i64, y: i64) -> u32 {
        let range = self.of_chart[chart as usize].clone();
        let key = (y, x);
        match self.list[range.clone()].binary_search_by_key(&key, |b| (i64::from(b.y), i64::from(b.x))) {
            Ok(at) => (range.start + at) as u32,
            Err(_) => NONE,
        }
    }

    /// The block that holds the node (i, j) in the chart of block `from`, or `NONE`.
    #[inline]
    pub fn holding(&self, from: usize, i: i64, j: i64) -> u32 {
        let (x, y) = (i >> 4, j >> 4);
        let b = &self.list[from];
        let (dx, dy) = (x - i64::from(b.x), y - i64::from(b.y));
        if dx.abs() <= 1 && dy.abs() <= 1 {
            self.neighbours[from][((dy + 1) * 3 + dx + 1) as usize]
        } else {
            self.find(b.chart, x, y)
        }
    }
}
