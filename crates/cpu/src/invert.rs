//! invert: computes W⁻¹ at texel centres or at single points from the displacements of the finest level (the paper's
//! eq. 9, method §9). Texel centres in the bounding box of a warped cell are candidates (`cells`); one that lies in a
//! triangle of the cell is assigned the barycentric interpolation of the triangle's corners at rest.

mod cells;
mod point;

use super::lanes::{LANES, Lanes, Mask, Vectorised, dispatch, each};
use super::row::Row;
use cells::{CORNERS, Cells, FOUND, Spans};
use vrtm_core::grid::Grid;
use vrtm_core::grid::planes::{Plane, SIDE, slot};
use vrtm_core::grid::window::{self, WINDOW_NODES};
use vrtm_core::image::ImagePart;
use vrtm_core::mesh::NONE;
use vrtm_core::report::TileReport;
use vrtm_core::team::Team;

pub use cells::{Found, Texel};
pub use point::point;

/// Blocks per work item.
const CHUNK: usize = 8;

/// Calls `put` with the texels of a part of an image whose centres lie in moved cells, and W⁻¹ there. W⁻¹ is the
/// identity at all other texels. No texel comes twice if the warp is free of folds; if it is not, one thread calls in
/// the order of the cells. `report` is that of the displacements; the triangles of charts are the first `own` ones, or
/// all if that is `None`.
pub fn texels(
    team: &Team,
    grid: &Grid,
    own: Option<u32>,
    u: &[[Plane; 2]],
    part: &ImagePart,
    report: &TileReport,
    put: &(dyn Fn(&Found) + Sync),
) {
    let level = &grid.levels[0];
    let scale = [part.size[0] as f64 / level.nx as f64, part.size[1] as f64 / level.ny as f64];
    let count = level.blocks.list.len();
    let (reach, in_order) = (f64::from(report.max_displacement) + 1.0, report.folds > 0);
    let all = |team: &Team| {
        team.run(count.div_ceil(CHUNK), |k| {
            let blocks = k * CHUNK..((k + 1) * CHUNK).min(count);
            dispatch(Texels { grid, own, u, part, scale, reach, in_order, blocks, put });
        });
    };
    if in_order { Team::with(1, all) } else { all(team) }
}

/// The texels in the cells of some blocks.
struct Texels<'a> {
    grid: &'a Grid,
    own: Option<u32>,
    u: &'a [[Plane; 2]],
    part: &'a ImagePart,
    /// Texels per cell.
    scale: [f64; 2],
    /// Cells by which a block's cells may reach beyond it.
    reach: f64,
    /// True if texels are found cell by cell.
    in_order: bool,
    blocks: std::ops::Range<usize>,
    put: &'a (dyn Fn(&Found) + Sync),
}

impl Vectorised for Texels<'_> {
    type Output = ();

    #[inline(always)]
    fn run<V: Lanes>(self) {
        let mut windows = [[0.0; WINDOW_NODES]; 2];
        let (mut cells, mut texels) = (Cells::default(), [Texel::default(); FOUND]);
        for b in self.blocks.clone() {
            let level = &self.grid.levels[0];
            let block = &level.blocks.list[b];
            let first = [block.x, block.y].map(|x| x as usize * SIDE);
            if (0..2).any(|axis| self.misses(axis, first[axis])) {
                continue;
            }
            for (c, window) in windows.iter_mut().enumerate() {
                window::load(&level.blocks.neighbours[b], 0.0, |b| &self.u[b][c], window);
            }
            let boxes = Boxes::new(first, self.scale, self.reach as f32, self.part);
            for row in Row::all() {
                // Each corner's displacements.
                let at = each!([0, 1, 2, 3], |k| row.at(CORNERS[k].0 as i64, CORNERS[k].1 as i64));
                let of = |c: usize, k: usize| windows[c][at[k]..].first_chunk().expect("eight nodes");
                let u = each!([0, 1], |c| each!([0, 1, 2, 3], |k| of(c, k)));
                let (mut lanes, spans) = boxes.of_row::<V>(&u, row);
                if lanes == 0 {
                    continue;
                }
                self.warp(&mut cells, &u, b, first, row, lanes);
                while lanes != 0 {
                    let now = if self.in_order { lanes & lanes.wrapping_neg() } else { lanes };
                    cells.locate(block.chart, now, &spans, &mut texels, self.put);
                    lanes &= !now;
                }
            }
        }
    }
}

impl Texels<'_> {
    /// True if a block that begins at this node lies outside of the part along an axis.
    fn misses(&self, axis: usize, at: usize) -> bool {
        let (low, high) = (at as f64 - self.reach, (at + SIDE) as f64 + self.reach);
        let scale = self.scale[axis];
        high * scale < self.part.first[axis] as f64 || low * scale > self.part.end[axis] as f64 + 1.0
    }

    /// Makes the cells of a row of nodes, with these displacements of their corners. All cells at a node compute the
    /// same numbers.
    #[inline(always)]
    fn warp(
        &self,
        cells: &mut Cells,
        u: &[[&[f32; LANES]; 4]; 2],
        b: usize,
        first: [usize; 2],
        row: Row,
        lanes: u8,
    ) {
        let node = [(first[0] + row.column()) as f64, (first[1] + row.line()) as f64];
        for n in 0..LANES {
            let node = [node[0] + (2 * n) as f64, node[1]];
            for c in 0..2 {
                let u = &u[c];
                cells.node[c][n] = node[c];
                for k in 0..4 {
                    let step = [CORNERS[k].0, CORNERS[k].1][c] as f64;
                    let at = node[c] + step + f64::from(u[k][n]);
                    cells.corners[k][c][n] = at * self.scale[c] - 0.5;
                }
            }
        }
        cells.is_beyond = self.own.map_or(0, |own| {
            let is_beyond = |k: &usize| self.is_beyond(b, own, row.column() + 2 * k, row.line());
            (0..LANES).filter(|k| lanes >> k & 1 != 0).filter(is_beyond).map(|k| 1 << k).sum()
        });
        cells.complete();
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
struct Boxes {
    /// A texel near the block's first node. Numbers in vectors are texels from there.
    origin: [f64; 2],
    /// The part's first and last texels along each axis; `bounds` are the same from the origin.
    part: [[f64; 2]; 2],
    bounds: [[f32; 2]; 2],
    /// The place of that node.
    first: [f32; 2],
    /// Texels per cell.
    scale: [f32; 2],
    /// Widening of a box, in texels: more than the rounding errors of vectors in f32.
    slack: [f32; 2],
}

impl Boxes {
    #[inline(always)]
    fn new(first: [usize; 2], scale: [f64; 2], reach: f32, part: &ImagePart) -> Boxes {
        let at = [0, 1].map(|c| first[c] as f64 * scale[c] - 0.5);
        let slack = scale.map(|scale| 1e-3 + 1e-6 * (reach + SIDE as f32) * scale as f32);
        let origin = at.map(f64::floor);
        let part = [0, 1].map(|axis| [part.first[axis] as f64, (part.end[axis] - 1) as f64]);
        Boxes {
            origin,
            part,
            bounds: [0, 1].map(|axis| part[axis].map(|at| (at - origin[axis]) as f32)),
            first: at.map(|at| (at - at.floor()) as f32),
            scale: scale.map(|scale| scale as f32),
            slack,
        }
    }

    /// The cells of a row of nodes, as bits, that have moved and whose box contains a texel of the part; and the texels
    /// in the boxes.
    #[inline(always)]
    fn of_row<V: Lanes>(&self, u: &[[&[f32; LANES]; 4]; 2], row: Row) -> (u8, Spans) {
        let columns = each!([0, 1, 2, 3, 4, 5, 6, 7], |k| (row.column() + 2 * k) as f32);
        let nodes = [V::from_array(columns), V::splat(row.line() as f32)];
        let u = each!([0, 1], |c| each!([0, 1, 2, 3], |k| V::from_array(*u[c][k])));
        let [x, y] = each!([0, 1], |c| {
            // The corners on the cell's sides at 0 and at 1.
            let [a, d, b, e] = [u[c][0], u[c][3 - 2 * c], u[c][1 + 2 * c], u[c][2]];
            let (low, high) = (a.min(d).min(b.min(e) + 1.0), a.max(d).max(b.max(e) + 1.0));
            let low = (nodes[c] + low) * self.scale[c] + (self.first[c] - self.slack[c]);
            let high = (nodes[c] + high) * self.scale[c] + (self.first[c] + self.slack[c]);
            // The first integer from `low` on.
            let low = (-(-low).floor()).max(V::splat(self.bounds[c][0]));
            (low, high.floor().min(V::splat(self.bounds[c][1])))
        });
        let mut cells = x.0.le(x.1).and(y.0.le(y.1));
        if cells.any() {
            let [x, y] = each!([0, 1], |c| {
                let [a, b, d, e] = u[c];
                a.max(-a).max(b.max(-b)).max(d.max(-d).max(e.max(-e)))
            });
            cells = cells.and(V::zero().lt(x.max(y)));
        }
        let arrays = |[x, y]: [V; 2]| [x.to_array(), y.to_array()];
        let (first, last) = (arrays([x.0, y.0]), arrays([x.1, y.1]));
        (cells.bits(), Spans { origin: self.origin, part: self.part, first, last })
    }
}

#[cfg(test)]
mod tests;
