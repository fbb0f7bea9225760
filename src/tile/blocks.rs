//! Blocks of 16 by 16 nodes (method §1): the unit in which nodes are stored, worked on and skipped. A block belongs to
//! one chart; where several charts share such a square of the grid, each has a block of its own. A node's block alone
//! tells to which chart's problem the node belongs.

use std::ops::Range;

use crate::mesh::NONE;

/// Nodes on a side of a block.
pub const SIDE: usize = 16;
/// Nodes of a block.
pub const NODES: usize = SIDE * SIDE;

/// One quantity at the nodes of a block, as four planes of 8x8, one per node colour (i & 1, j & 1): the neighbours of
/// nodes of one colour then lie side by side, too.
pub type Plane<T = f32> = [T; NODES];

/// Index of node (i, j) of a block in its planes.
pub const fn slot(i: usize, j: usize) -> usize {
    ((j & 1) * 2 + (i & 1)) * 64 + (j >> 1) * 8 + (i >> 1)
}

/// The node (i, j) at an index of a plane.
#[cfg(test)]
pub const fn node_at(slot: usize) -> (usize, usize) {
    let (colour, row, column) = (slot / 64, slot / 8 % 8, slot % 8);
    (2 * column + colour % 2, 2 * row + colour / 2)
}

/// A stored block.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Block {
    /// Its chart.
    pub chart: u32,
    /// Its place in the level along u, in blocks.
    pub x: u32,
    /// Its place in the level along v, in blocks.
    pub y: u32,
    /// True if it holds a movable node. The others are stored for the halos of their neighbours only, and never
    /// visited.
    pub active: bool,
}

/// The stored blocks of one level.
#[derive(Clone, Debug, Default)]
pub struct Blocks {
    /// Sorted by chart, y, x.
    pub list: Vec<Block>,
    /// Per block, the 3x3 neighbour blocks of the same chart (itself at 4), or `NONE`.
    pub neighbours: Vec<[u32; 9]>,
    /// The range of each chart in `list`.
    pub of_chart: Vec<Range<usize>>,
}

impl Blocks {
    /// Finds the blocks that hold a movable node or a neighbour of one. `chart(i, j)` is the chart of a movable node of
    /// a level of `nx` by `ny` cells, `NONE` for a fixed one.
    pub fn new(nx: usize, ny: usize, charts: usize, chart: impl Fn(usize, usize) -> u32) -> Blocks {
        // (chart, y, x, whether it holds the node itself) of every block that holds a movable node or a neighbour of
        // one.
        let mut touched: Vec<(u32, u32, u32, bool)> = Vec::new();
        for y in 0..ny.div_ceil(SIDE) {
            for x in 0..nx.div_ceil(SIDE) {
                let start = touched.len();
                for j in y * SIDE..((y + 1) * SIDE).min(ny) {
                    for i in x * SIDE..((x + 1) * SIDE).min(nx) {
                        let c = chart(i, j);
                        if c == NONE {
                            continue;
                        }
                        // Least and greatest offset, in blocks, of the node's neighbours along an axis.
                        let reach = |n: usize| -> (i64, i64) {
                            let n = n % SIDE;
                            (if n == 0 { -1 } else { 0 }, if n == SIDE - 1 { 1 } else { 0 })
                        };
                        let ((x0, x1), (y0, y1)) = (reach(i), reach(j));
                        for dy in y0..=y1 {
                            for dx in x0..=x1 {
                                let key =
                                    (c, (y as i64 + dy) as u32, (x as i64 + dx) as u32, dx == 0 && dy == 0);
                                if !touched[start..].contains(&key) {
                                    touched.push(key);
                                }
                            }
                        }
                    }
                }
            }
        }
        touched.sort_unstable();
        let mut list: Vec<Block> = Vec::new();
        for (chart, y, x, active) in touched {
            match list.last_mut() {
                Some(last) if (last.chart, last.y, last.x) == (chart, y, x) => last.active |= active,
                _ => list.push(Block { chart, x, y, active }),
            }
        }
        let mut of_chart = Vec::with_capacity(charts);
        let mut start = 0;
        for c in 0..charts as u32 {
            let end = start + list[start..].partition_point(|b| b.chart == c);
            of_chart.push(start..end);
            start = end;
        }
        let mut blocks = Blocks { list, neighbours: Vec::new(), of_chart };
        blocks.neighbours = blocks
            .list
            .iter()
            .map(|b| {
                std::array::from_fn(|k| {
                    let (x, y) = (b.x as i64 + k as i64 % 3 - 1, b.y as i64 + k as i64 / 3 - 1);
                    blocks.find(b.chart, x, y)
                })
            })
            .collect();
        blocks
    }

    /// The block of a chart at (x, y), in blocks, or `NONE`.
    pub fn find(&self, chart: u32, x: i64, y: i64) -> u32 {
        let range = self.of_chart[chart as usize].clone();
        let key = (y, x);
        match self.list[range.clone()].binary_search_by_key(&key, |b| (i64::from(b.y), i64::from(b.x))) {
            Ok(at) => (range.start + at) as u32,
            Err(_) => NONE,
        }
    }

    /// The block that holds the node (i, j), seen from block `from` of the same chart, or `NONE`.
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

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn slots_and_nodes_are_inverse() {
        for s in 0..NODES {
            let (i, j) = node_at(s);
            assert_eq!(slot(i, j), s);
        }
    }

    #[test]
    fn blocks_hold_movable_nodes_and_their_neighbours() {
        // One movable node in the corner of a block, of chart 1.
        let blocks = Blocks::new(64, 64, 2, |i, j| if (i, j) == (32, 31) { 1 } else { NONE });
        assert_eq!(blocks.of_chart, [0..0, 0..4]);
        let active: Vec<_> = blocks.list.iter().filter(|b| b.active).collect();
        assert_eq!(active.len(), 1);
        assert_eq!((active[0].x, active[0].y), (2, 1));
        let at = blocks.find(1, 2, 1) as usize;
        assert_eq!(blocks.neighbours[at][4], at as u32);
        assert_eq!(blocks.neighbours[at][3], blocks.find(1, 1, 1));
        assert_eq!(blocks.neighbours[at][5], NONE);
        assert_eq!(blocks.holding(at, 31, 32), blocks.find(1, 1, 2));
        assert_eq!(blocks.holding(at, 0, 0), NONE);
    }

    #[test]
    fn charts_that_meet_in_a_block_have_a_copy_each() {
        let blocks = Blocks::new(16, 16, 2, |i, j| match (i, j) {
            (2..=5, 2..=13) => 0,
            (8..=11, 2..=13) => 1,
            _ => NONE,
        });
        assert_eq!(blocks.list.len(), 2);
        assert_ne!(blocks.find(0, 0, 0), blocks.find(1, 0, 0));
    }
}
