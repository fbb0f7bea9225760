//! invert: computes W⁻¹ at texel centres or at single points from the displacements of the finest level (the paper's
//! eq. 9, method §9). Texel centres in the bounding box of a warped cell are candidates (`batch`); one that lies in a
//! triangle of the cell is assigned the barycentric interpolation of the triangle's corners at rest.

mod batch;
mod point;

use super::lanes::{LANES, Lanes, Mask, Vectorised, dispatch, each};
use super::row::Row;
use batch::{BATCH, Batch};
use vrtm_core::grid::Grid;
use vrtm_core::grid::planes::{Plane, SIDE, slot};
use vrtm_core::grid::window::{self, Window, place};
use vrtm_core::image::ImagePart;
use vrtm_core::mesh::NONE;
use vrtm_core::team::Team;

pub use batch::Inverse;
pub use point::point;

/// Blocks per work item.
const CHUNK: usize = 8;

/// Calls `put(x, y, inverse)` for each texel of a part of an image whose centre lies in a moved cell, with its position
/// in the whole image and W⁻¹ at the centre. W⁻¹ is the identity at all other texels. No texel is visited twice if the
/// warp is free of folds. `reach` must be at least the largest component of any displacement; the triangles of charts
/// are the first `own` ones, or all if that is `None`.
pub fn texels(
    team: &Team,
    grid: &Grid,
    own: Option<u32>,
    u: &[[Plane; 2]],
    part: &ImagePart,
    reach: f32,
    put: impl Fn(usize, usize, Inverse) + Sync,
) {
    let level = &grid.levels[0];
    let scale = [part.size[0] as f64 / level.nx as f64, part.size[1] as f64 / level.ny as f64];
    let count = level.blocks.list.len();
    team.run(count.div_ceil(CHUNK), |k| {
        let blocks = k * CHUNK..((k + 1) * CHUNK).min(count);
        dispatch(Texels { grid, own, u, part, scale, reach: f64::from(reach) + 1.0, blocks, put: &put });
    });
}

/// The texels in the cells of some blocks.
struct Texels<'a, F> {
    grid: &'a Grid,
    own: Option<u32>,
    u: &'a [[Plane; 2]],
    part: &'a ImagePart,
    /// Texels per cell.
    scale: [f64; 2],
    /// Cells by which a block's cells may reach beyond it.
    reach: f64,
    blocks: std::ops::Range<usize>,
    put: &'a F,
}

impl<F: Fn(usize, usize, Inverse)> Vectorised for Texels<'_, F> {
    type Output = ();

    #[inline(always)]
    fn run<V: Lanes>(self) {
        let mut batch = Batch::new();
        for b in self.blocks.clone() {
            let level = &self.grid.levels[0];
            let block = &level.blocks.list[b];
            let first = [block.x, block.y].map(|x| x as usize * SIDE);
            if (0..2).any(|axis| self.misses(axis, first[axis])) {
                continue;
            }
            let windows = window::planes(&level.blocks.neighbours[b], |b, c| &self.u[b][c]);
            let boxes = Boxes::new(first, self.scale, self.reach as f32, self.part);
            for row in Row::all() {
                let (mut cells, columns, rows) = boxes.of_row::<V>(&windows, row);
                while cells != 0 {
                    let k = cells.trailing_zeros() as usize;
                    cells &= cells - 1;
                    let (i, j) = (row.column() + 2 * k, row.line());
                    let corners = each!([0, 1, 2, 3], |k| {
                        self.warped(&windows, first, i + CORNERS[k].0, j + CORNERS[k].1)
                    });
                    let is_beyond = self.own.is_some_and(|own| self.is_beyond(b, own, i, j));
                    let node = [(first[0] + i) as f64, (first[1] + j) as f64];
                    for y in boxes.range(1, rows, k) {
                        for x in boxes.range(0, columns, k) {
                            if batch.len == BATCH {
                                batch.flush(block.chart, self.put);
                            }
                            batch.push([x, y], node, &corners, is_beyond);
                        }
                    }
                }
            }
            batch.flush(block.chart, self.put);
        }
    }
}

/// The corners of a cell.
const CORNERS: [(usize, usize); 4] = [(0, 0), (1, 0), (1, 1), (0, 1)];

impl<F> Texels<'_, F> {
    /// True if a block that begins at this node lies outside of the part along an axis.
    fn misses(&self, axis: usize, at: usize) -> bool {
        let (low, high) = (at as f64 - self.reach, (at + SIDE) as f64 + self.reach);
        let scale = self.scale[axis];
        high * scale < self.part.first[axis] as f64 || low * scale > self.part.end[axis] as f64 + 1.0
    }

    /// A block's node (i, j), warped, in texels: centres are the integer points. All cells at a node compute the same
    /// numbers.
    #[inline(always)]
    fn warped(&self, windows: &[Window; 2], first: [usize; 2], i: usize, j: usize) -> [f64; 2] {
        let at = place(i + 1, j + 1);
        let node = [first[0] + i, first[1] + j];
        each!([0, 1], |c| (node[c] as f64 + f64::from(windows[c][at])) * self.scale[c] - 0.5)
    }

    /// True if a corner of cell (i, j) of a block lies under a triangle beyond the chart itself, or under none.
    fn is_beyond(&self, b: usize, own: u32, i: usize, j: usize) -> bool {
        CORNERS.into_iter().any(|(di, dj)| {
            let (i, j) = (i + di, j + dj);
            let block = self.grid.levels[0].blocks.neighbours[b][4 + i / SIDE + 3 * (j / SIDE)];
            block == NONE || self.grid.triangle[block as usize][slot(i % SIDE, j % SIDE)] >= own
        })
    }
}

/// Finds the texels in the bounding boxes of a block's warped cells. Boxes are widened a little, because they are
/// computed in f32; whether a texel lies in its cell is decided in f64 later.
struct Boxes<'a> {
    part: &'a ImagePart,
    /// A texel near the block's first node. Numbers in vectors are texels from there.
    origin: [i64; 2],
    /// The place of that node.
    first: [f32; 2],
    /// Texels per cell.
    scale: [f32; 2],
    /// Widening of a box, in texels: more than the rounding errors of vectors in f32.
    slack: [f32; 2],
}

impl Boxes<'_> {
    #[inline(always)]
    fn new(first: [usize; 2], scale: [f64; 2], reach: f32, part: &ImagePart) -> Boxes<'_> {
        let at = [0, 1].map(|c| first[c] as f64 * scale[c] - 0.5);
        let slack = scale.map(|scale| 1e-3 + 1e-6 * (reach + SIDE as f32) * scale as f32);
        Boxes {
            part,
            origin: at.map(|at| at.floor() as i64),
            first: at.map(|at| (at - at.floor()) as f32),
            scale: scale.map(|scale| scale as f32),
            slack,
        }
    }

    /// The cells of a row of nodes, as bits, that have moved and whose box contains a texel; and the columns and the
    /// rows of each one's texels, first and last.
    #[inline(always)]
    fn of_row<V: Lanes>(
        &self,
        windows: &[Window; 2],
        row: Row,
    ) -> (u8, [[f32; LANES]; 2], [[f32; LANES]; 2]) {
        let columns = each!([0, 1, 2, 3, 4, 5, 6, 7], |k| (row.column() + 2 * k) as f32);
        let nodes = [V::from_array(columns), V::splat(row.line() as f32)];
        let [x, y] = each!([0, 1], |c| {
            let [a, b, d, e] = each!([0, 1, 2, 3], |k| {
                row.near::<V>(&windows[c], CORNERS[k].0 as i64, CORNERS[k].1 as i64)
            });
            let most = a.max(-a).max(b.max(-b)).max(d.max(-d).max(e.max(-e)));
            // Cells have a side of 1.
            let step = |k: usize| if c == 0 { CORNERS[k].0 } else { CORNERS[k].1 } as f32;
            let [a, b, d, e] = [a + step(0), b + step(1), d + step(2), e + step(3)];
            let (low, high) = (a.min(b).min(d.min(e)), a.max(b).max(d.max(e)));
            let low = (nodes[c] + low) * self.scale[c] + (self.first[c] - self.slack[c]);
            let high = (nodes[c] + high) * self.scale[c] + (self.first[c] + self.slack[c]);
            // The first integer from `low` on.
            (most, -(-low).floor(), high.floor())
        });
        let moved = V::zero().lt(x.0.max(y.0));
        let cells = moved.and(x.1.le(x.2)).and(y.1.le(y.2)).bits();
        (cells, [x.1.to_array(), x.2.to_array()], [y.1.to_array(), y.2.to_array()])
    }

    /// The columns or rows of the texels of cell `k` of a row, within the part.
    #[inline(always)]
    fn range(&self, axis: usize, [first, last]: [[f32; LANES]; 2], k: usize) -> std::ops::Range<usize> {
        let texel = |x: f32| self.origin[axis].saturating_add(x as i64);
        let (first, last) = (texel(first[k]), texel(last[k]));
        let (first, end) = (
            first.max(self.part.first[axis] as i64),
            (last.saturating_add(1)).min(self.part.end[axis] as i64),
        );
        first as usize..end.max(first) as usize
    }
}

#[cfg(test)]
mod tests;
