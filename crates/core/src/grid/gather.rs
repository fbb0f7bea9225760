//! The triangles under the nodes of level 1 (method §3), from which a pose's metrics on that level are gathered.

use glam::DVec2;

use super::blocks::Block;
use super::cover::Coverer;
use super::fill::Fill;
use crate::allocation::{Vec, zeroed};
use crate::grid::planes::{NODES, Plane, SIDE, slot};
use crate::team::Team;

/// For each node of level 1, the triangles in its dual cell, each with its fraction of the covered area.
#[derive(Debug, Default)]
pub struct Gather {
    /// For each block and slot, the index of its first entry, followed by the number of entries.
    pub(super) starts: Vec<u32>,
    /// Pairs (triangle, fraction).
    pub(super) entries: Vec<(u32, f32)>,
}

/// Side of a dual cell of level 1, in cells of level 0.
pub const DUAL_SIDE: f64 = 2.0;
/// Blocks per round. The entries of a round are found before they are appended, so that they are held twice meanwhile.
const ROUND: usize = 1024;

impl Gather {
    /// Clips the triangles to the dual cells of level 1, which has `cells` cells and the blocks `blocks`. Also returns
    /// that level's coverage, per block.
    pub(super) fn new(
        team: &Team,
        coverer: &Coverer,
        blocks: &[Block],
        cells: [usize; 2],
    ) -> (Gather, Vec<Plane>) {
        let mut gather = Gather { starts: Vec::with_capacity(blocks.len() * NODES + 1), entries: Vec::new() };
        gather.starts.push(0);
        let mut coverage = Vec::with_capacity(blocks.len());
        for round in blocks.chunks(ROUND) {
            for (ends, entries, covered) in team.map(round.len(), |b| of_block(coverer, cells, &round[b])) {
                let first = gather.entries.len() as u32;
                gather.starts.extend(ends.iter().map(|end| first + end));
                gather.entries.extend(entries);
                coverage.push(covered);
            }
        }
        gather.entries.shrink_to_fit();
        (gather, coverage)
    }

    /// The entries of several grids one after the other; `firsts` are the numbers of their first triangles.
    pub(super) fn joined<'a>(gathers: impl Iterator<Item = &'a Gather>, firsts: &[usize]) -> Gather {
        let mut joined = Gather { starts: zeroed(1), entries: Vec::new() };
        for (gather, &first) in gathers.zip(firsts) {
            let before = joined.entries.len() as u32;
            // A grid of one level has none.
            joined.starts.extend(gather.starts.iter().skip(1).map(|start| before + start));
            joined.entries.extend(gather.entries.iter().map(|&(t, share)| (t + first as u32, share)));
        }
        joined
    }

    /// The entries of some blocks, and for each of their nodes the index of its first entry among these, followed by
    /// the number of entries.
    pub fn of_blocks(&self, blocks: std::ops::Range<usize>) -> (Vec<u32>, &[(u32, f32)]) {
        let starts = &self.starts[blocks.start * NODES..=blocks.end * NODES];
        let (first, end) = (starts[0], starts[starts.len() - 1]);
        (starts.iter().map(|start| start - first).collect(), &self.entries[first as usize..end as usize])
    }

    /// The lengths of the two arrays of `of_blocks`.
    pub fn sizes(&self, blocks: std::ops::Range<usize>) -> [usize; 2] {
        let [first, end] = [blocks.start, blocks.end].map(|b| self.starts[b * NODES]);
        [blocks.len() * NODES + 1, (end - first) as usize]
    }

    /// Bytes of memory in use.
    pub fn bytes(&self) -> usize {
        self.starts.len() * 4 + self.entries.len() * 8
    }

    /// Computes the metrics (E, F, G) of one block of level 1, per squared cell of level 1, from those of the
    /// triangles, per squared cell of level 0.
    pub fn block(&self, b: usize, triangles: &[[f32; 3]], out: &mut [Plane; 3]) {
        for s in 0..NODES {
            let node = b * NODES + s;
            let mut sum = [0.0f32; 3];
            for &(t, fraction) in &self.entries[self.starts[node] as usize..self.starts[node + 1] as usize] {
                for (x, m) in sum.iter_mut().zip(triangles[t as usize]) {
                    *x += fraction * m;
                }
            }
            for (plane, x) in out.iter_mut().zip(sum) {
                plane[s] = 4.0 * x;
            }
        }
    }
}

/// Per slot of a block the index one past its last entry, the entries, and the coverage.
fn of_block(coverer: &Coverer, size: [usize; 2], block: &Block) -> (Vec<u32>, Vec<(u32, f32)>, Plane) {
    let cells = DVec2::new(coverer.nx as f64, coverer.ny as f64);
    // Triples (slot, triangle, area of the triangle in the node's dual cell).
    let mut pieces: Vec<(u32, u32, f32)> = Vec::new();
    for t in triangles(coverer, block) {
        let corners = coverer.tile.triangles[t as usize].uv.map(|uv| uv * cells);
        let fill = Fill::new(corners);
        each_dual_cell(corners, block, size, |i, j| {
            let low = DUAL_SIDE * DVec2::new(i as f64, j as f64) - 1.0;
            let whole = fill.holds(low, low + DUAL_SIDE);
            let area = if whole { DUAL_SIDE * DUAL_SIDE } else { area_in_box(corners, low) };
            if area > 0.0 {
                pieces.push((slot(i % SIDE, j % SIDE) as u32, t, area as f32));
            }
        });
    }
    // A triangle has one piece per node.
    pieces.sort_unstable_by_key(|piece| (piece.0, piece.1));
    let (mut ends, mut entries) = (Vec::with_capacity(NODES), Vec::with_capacity(pieces.len()));
    let (mut coverage, mut remaining) = ([0.0; NODES], &pieces[..]);
    for (slot, coverage) in coverage.iter_mut().enumerate() {
        let (of_node, others) = remaining.split_at(remaining.partition_point(|p| p.0 as usize == slot));
        remaining = others;
        let sum: f32 = of_node.iter().map(|p| p.2).sum();
        *coverage = (sum / (DUAL_SIDE * DUAL_SIDE) as f32).min(1.0);
        entries.extend(of_node.iter().map(|p| (p.1, p.2 / sum)));
        ends.push(entries.len() as u32);
    }
    (ends, entries, coverage)
}

/// The triangles of a block's chart that may meet its dual cells, ascending: the triangles of the four squares of level
/// 0 that the block covers.
fn triangles(coverer: &Coverer, block: &Block) -> Vec<u32> {
    let mut triangles = Vec::new();
    for (dx, dy) in [(0, 0), (1, 0), (0, 1), (1, 1)] {
        if let Some(square) = coverer.squares.find(block.chart, 2 * block.x + dx, 2 * block.y + dy) {
            let of_square = coverer.squares.triangles(square);
            triangles
                .extend(of_square.iter().copied().filter(|t| coverer.charts[*t as usize] == block.chart));
        }
    }
    triangles.sort_unstable();
    triangles.dedup();
    triangles
}

/// Calls `f` for each node of a block whose dual cell meets the triangle's bounding box, on a level of `size` cells.
pub fn each_dual_cell(corners: [DVec2; 3], block: &Block, size: [usize; 2], mut f: impl FnMut(usize, usize)) {
    let range = |axis: usize, place: u32| {
        let values = corners.map(|c| c[axis]);
        let low = values.iter().copied().fold(f64::INFINITY, f64::min);
        let high = values.iter().copied().fold(f64::NEG_INFINITY, f64::max);
        let first_node = place as usize * SIDE;
        let last_node = (first_node + SIDE - 1).min(size[axis]);
        let first = ((low + 1.0) * 0.5).floor().max(first_node as f64);
        let last = ((high + 1.0) * 0.5).floor().min(last_node as f64);
        (first <= last).then_some(first as usize..=last as usize)
    };
    if let (Some(columns), Some(rows)) = (range(0, block.x), range(1, block.y)) {
        for j in rows {
            for i in columns.clone() {
                f(i, j);
            }
        }
    }
}

/// The most corners of a triangle clipped by four lines, plus one.
const CORNERS: usize = 8;

/// A convex polygon.
#[derive(Clone, Copy)]
struct Polygon {
    corners: [DVec2; CORNERS],
    count: usize,
}

impl Polygon {
    fn add(&mut self, corner: DVec2) {
        // A triangle clipped by four lines has at most seven corners; rounding adds none, as each line adds at most
        // one.
        self.corners[self.count] = corner;
        self.count += 1;
    }
}

/// Area of a triangle inside the box of side 2 whose lower corner is `low`, by Sutherland-Hodgman clipping.
pub fn area_in_box(corners: [DVec2; 3], low: DVec2) -> f64 {
    let mut polygon = Polygon { corners: [DVec2::ZERO; CORNERS], count: 0 };
    corners.into_iter().for_each(|corner| polygon.add(corner));
    for (axis, sign, bound) in
        [(0, 1.0, low.x), (0, -1.0, -low.x - DUAL_SIDE), (1, 1.0, low.y), (1, -1.0, -low.y - DUAL_SIDE)]
    {
        let mut clipped = Polygon { count: 0, ..polygon };
        for k in 0..polygon.count {
            let (a, b) = (polygon.corners[(k + polygon.count - 1) % polygon.count], polygon.corners[k]);
            let (da, db) = (sign * a[axis] - bound, sign * b[axis] - bound);
            if (da < 0.0) != (db < 0.0) {
                clipped.add(a + da / (da - db) * (b - a));
            }
            if db >= 0.0 {
                clipped.add(b);
            }
        }
        polygon = clipped;
        if polygon.count < 3 {
            return 0.0;
        }
    }
    let twice: f64 = (0..polygon.count)
        .map(|k| {
            let (a, b) = (polygon.corners[k], polygon.corners[(k + 1) % polygon.count]);
            (a - low).perp_dot(b - low)
        })
        .sum();
    0.5 * twice.abs()
}
