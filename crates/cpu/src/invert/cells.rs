//! Texel centres in the bounding boxes of eight warped cells, and in which triangle of its cell each lies. A cell is
//! split by its diagonal from (0,0) to (1,1) into two triangles, on each of which W is affine. The signs of barycentric
//! coordinates tell the triangle, and `grid::fill` does where a centre is so close to an edge that rounding may hide
//! its side: each centre belongs to exactly one triangle.
//!
//! The loops over cells have no branches, so that the compiler makes vectors of them.

use glam::DVec2;

use super::super::lanes::LANES;
use vrtm_core::grid::fill::Fill;

/// A number per cell.
pub type Numbers = [f64; LANES];

/// The places of corners in a cell.
pub const CORNERS: [(usize, usize); 4] = [(0, 0), (1, 0), (1, 1), (0, 1)];

/// The lower and the upper triangle of a cell.
const LOWER: usize = 0;
const UPPER: usize = 1;

/// A cross product of two vectors in a box differs from the exact one by less than this many times the box's area.
const ROUNDING: f64 = 1e-13;

/// A triangle that is yet to be found.
const DOUBT: u64 = 4;

/// Texels per call of `put`.
pub const FOUND: usize = 32;

/// Added to a whole number, it leaves the number in the lower bits.
const WHOLE: f64 = (1u64 << 52) as f64;

/// The texels in the boxes of eight cells: in each, columns and rows from the first to the last, counted from `origin`.
pub struct Spans {
    pub origin: [f64; 2],
    /// The first and the last column and row of the part of the image, which bound the boxes.
    pub part: [[f64; 2]; 2],
    pub first: [[f32; LANES]; 2],
    pub last: [[f32; LANES]; 2],
}

/// Eight warped cells, in texels: centres are the integer points.
#[derive(Default)]
pub struct Cells {
    /// The cells' first nodes at rest, in cells.
    pub node: [Numbers; 2],
    /// Corners by their places in a cell, each with its components.
    pub corners: [[Numbers; 2]; 4],
    /// The edges from the first corner to the others.
    edges: [[Numbers; 2]; 3],
    /// For each triangle, 1 over its doubled area.
    inverse: [Numbers; 2],
    /// For each triangle, the error of barycentric coordinates.
    error: [Numbers; 2],
    /// Bit k is set if cell k is not wholly in the chart itself.
    pub is_beyond: u8,
}

/// A texel whose centre lies in a triangle.
#[derive(Clone, Copy, Default)]
pub struct Texel {
    /// Column and row in the part of the image.
    pub at: [u32; 2],
    /// The point at rest, in cells, that the warp takes to the centre.
    pub point: [f64; 2],
    cell: u32,
    triangle: u32,
}

/// Texels that were found in some cells of a chart.
pub struct Found<'a> {
    /// The chart whose warp it is.
    pub chart: u32,
    cells: &'a Cells,
    pub texels: &'a [Texel],
}

impl Found<'_> {
    /// True if the cell of a texel's point is not wholly in the chart itself.
    #[inline(always)]
    pub fn is_beyond(&self, texel: &Texel) -> bool {
        self.cells.is_beyond >> texel.cell & 1 != 0
    }

    /// The derivatives of W⁻¹ in the triangle of a texel, in cells per texel: a row for each component of W⁻¹.
    pub fn jacobian(&self, texel: &Texel) -> [[f64; 2]; 2] {
        let (cells, triangle, n) = (self.cells, texel.triangle as usize, texel.cell as usize);
        let (e1, e2) = (edge(&cells.edges, triangle, n), edge(&cells.edges, triangle + 1, n));
        // The edges at rest.
        let (r1, r2) = if triangle == LOWER { ((1.0, 0.0), (1.0, 1.0)) } else { ((1.0, 1.0), (0.0, 1.0)) };
        let inverse = cells.inverse[triangle][n];
        [
            [(r1.0 * e2.1 - r2.0 * e1.1) * inverse, (r2.0 * e1.0 - r1.0 * e2.0) * inverse],
            [(r1.1 * e2.1 - r2.1 * e1.1) * inverse, (r2.1 * e1.0 - r1.1 * e2.0) * inverse],
        ]
    }
}

impl Cells {
    /// Derives the other fields from the corners.
    #[inline(always)]
    pub fn complete(&mut self) {
        let Cells { corners, edges, inverse, error, .. } = self;
        for n in 0..LANES {
            for k in 0..3 {
                for c in 0..2 {
                    edges[k][c][n] = corners[k + 1][c][n] - corners[0][c][n];
                }
            }
            let [ab, ac, ad] = [edge(edges, 0, n), edge(edges, 1, n), edge(edges, 2, n)];
            // A box's sides are at most these, with texels that were added to it.
            let width = ab.0.abs() + ac.0.abs() + ad.0.abs() + 2.0;
            let height = ab.1.abs() + ac.1.abs() + ad.1.abs() + 2.0;
            for (k, area) in [cross(ab, ac), cross(ac, ad)].into_iter().enumerate() {
                inverse[k][n] = 1.0 / area;
                error[k][n] = (inverse[k][n] * (ROUNDING * width * height)).abs();
            }
        }
    }

    /// Calls `put` with the texels whose centres lie in these cells of a chart: of each cell, in order.
    #[inline(always)]
    pub fn locate(
        &self,
        chart: u32,
        lanes: u8,
        spans: &Spans,
        texels: &mut [Texel; FOUND],
        put: &dyn Fn(&Found),
    ) {
        let Cells { node, corners: [corner, ..], edges, inverse, error, .. } = self;
        let none = [0.0; LANES];
        let (mut first, mut last) = ([none; 2], [none; 2]);
        for c in 0..2 {
            for n in 0..LANES {
                let (origin, [least, most]) = (spans.origin[c], spans.part[c]);
                let low = f64::from(spans.first[c][n]) + origin;
                let high = f64::from(spans.last[c][n]) + origin;
                first[c][n] = if low < least { least } else { low };
                last[c][n] = if high > most { most } else { high };
            }
        }
        for n in 0..LANES {
            let is_one = (lanes >> n & 1 != 0) & (first[0][n] <= last[0][n]);
            last[1][n] = if is_one { last[1][n] } else { f64::NEG_INFINITY };
        }
        let [mut x, mut y] = first;
        let whole = spans.part.map(|[least, _]| WHOLE - least);
        let mut len = 0;
        loop {
            let (mut at, mut point) = ([none; 2], [none; 2]);
            let (mut found, mut doubt) = ([0u64; LANES], 0);
            for n in 0..LANES {
                (at[0][n], at[1][n]) = (x[n] + whole[0], y[n] + whole[1]);
                let from = minus((x[n], y[n]), (corner[0][n], corner[1][n]));
                let [ab, ac, ad] = [edge(edges, 0, n), edge(edges, 1, n), edge(edges, 2, n)];
                let diagonal = cross(from, ac);
                let lower = (diagonal * inverse[LOWER][n], cross(ab, from) * inverse[LOWER][n]);
                let upper = (cross(from, ad) * inverse[UPPER][n], -diagonal * inverse[UPPER][n]);
                let (in_lower, in_upper) = (least(lower), least(upper));
                let is_clear = (in_lower.abs() > error[LOWER][n]) & (in_upper.abs() > error[UPPER][n]);
                let is_upper = in_upper > 0.0;
                let of = if is_upper { 2 } else { u64::from(in_lower > 0.0) };
                let of = if is_clear { of } else { DOUBT };
                found[n] = if y[n] <= last[1][n] { of } else { 0 };
                doubt |= found[n];
                let l = if is_upper { upper } else { lower };
                point[0][n] = node[0][n] + l.0 + if is_upper { 0.0 } else { l.1 };
                point[1][n] = node[1][n] + if is_upper { l.0 } else { 0.0 } + l.1;
            }
            if doubt & DOUBT != 0 {
                self.settle(&x, &y, &mut found, &mut point);
            }
            if len > FOUND - LANES {
                put(&Found { chart, cells: self, texels: &texels[..len] });
                len = 0;
            }
            for n in 0..LANES {
                texels[len] = Texel {
                    at: [at[0][n].to_bits() as u32, at[1][n].to_bits() as u32],
                    point: [point[0][n], point[1][n]],
                    cell: n as u32,
                    triangle: (found[n] as u32).wrapping_sub(1),
                };
                len += usize::from(found[n] != 0);
            }
            let mut goes_on = false;
            for n in 0..LANES {
                let is_end = x[n] >= last[0][n];
                x[n] = if is_end { first[0][n] } else { x[n] + 1.0 };
                y[n] = if is_end { y[n] + 1.0 } else { y[n] };
                goes_on |= y[n] <= last[1][n];
            }
            if !goes_on {
                break;
            }
        }
        if len != 0 {
            put(&Found { chart, cells: self, texels: &texels[..len] });
        }
    }

    /// Finds the triangles of centres that are in doubt, by the rule for edges. A triangle without area, which only the
    /// paper's solver makes, contains nothing. In a sliver the rounded coordinates are clamped to the triangle.
    #[cold]
    #[inline(never)]
    fn settle(&self, x: &Numbers, y: &Numbers, found: &mut [u64; LANES], point: &mut [Numbers; 2]) {
        for n in 0..LANES {
            if found[n] != DOUBT {
                continue;
            }
            found[n] = 0;
            let corners = self.corners.each_ref().map(|of| DVec2::new(of[0][n], of[1][n]));
            let (centre, texel) = (DVec2::new(x[n], y[n]), [x[n] as usize, y[n] as usize]);
            for (triangle, k) in [[0, 1, 2], [0, 2, 3]].into_iter().enumerate() {
                let [a, b, c] = k.map(|k| corners[k]);
                let (e1, e2, from) = (b - a, c - a, centre - a);
                let area = e1.perp_dot(e2);
                Fill::new([a, b, c]).visit_in(texel, texel.map(|x| x + 1), |_, _, is_inside| {
                    if is_inside && area != 0.0 {
                        let inverse = 1.0 / area;
                        let l1 = (from.perp_dot(e2) * inverse).clamp(0.0, 1.0);
                        let l2 = (e1.perp_dot(from) * inverse).clamp(0.0, 1.0 - l1);
                        found[n] = triangle as u64 + 1;
                        point[0][n] = self.node[0][n] + l1 + if triangle == LOWER { l2 } else { 0.0 };
                        point[1][n] = self.node[1][n] + if triangle == LOWER { 0.0 } else { l1 } + l2;
                    }
                });
            }
        }
    }
}

#[inline(always)]
fn edge(edges: &[[Numbers; 2]; 3], k: usize, n: usize) -> (f64, f64) {
    (edges[k][0][n], edges[k][1][n])
}

/// The least of three barycentric coordinates.
#[inline(always)]
fn least(l: (f64, f64)) -> f64 {
    let third = 1.0 - l.0 - l.1;
    let least = if l.0 < l.1 { l.0 } else { l.1 };
    if third < least { third } else { least }
}

#[inline(always)]
fn minus(a: (f64, f64), b: (f64, f64)) -> (f64, f64) {
    (a.0 - b.0, a.1 - b.1)
}

#[inline(always)]
fn cross(a: (f64, f64), b: (f64, f64)) -> f64 {
    a.0 * b.1 - a.1 * b.0
}
