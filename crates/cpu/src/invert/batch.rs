//! Texel centres in the bounding boxes of warped cells, and in which triangle of its cell each lies. A cell is split by
//! its diagonal from (0,0) to (1,1) into two triangles, on each of which W is affine. The fill rule is that of
//! `grid::fill`: each centre belongs to exactly one triangle, because the triangles at an edge evaluate it on the same
//! coordinates, from its lower to its higher end.
//!
//! The loop over a batch has no branches, so that the compiler makes vectors of it.

use glam::DVec2;

/// Candidates per batch: a few vectors.
pub const BATCH: usize = 32;

/// A number per candidate.
type Numbers = [f64; BATCH];

/// The lower and the upper triangle of a cell.
const LOWER: u8 = 1;
const UPPER: u8 = 2;

/// Candidates: texel centres and cells, in texels. Centres are the integer points.
pub struct Batch {
    pub len: usize,
    /// Texel centres.
    x: Numbers,
    y: Numbers,
    /// The cells' first nodes at rest, in cells.
    node: [Numbers; 2],
    /// Corners (0,0), (1,0), (1,1) and (0,1) of the warped cells.
    corners: [[Numbers; 2]; 4],
    /// True if the cell is not wholly in the chart itself.
    is_beyond: [bool; BATCH],
    /// The triangle in which a centre lies; 0 if it lies outside of the cell.
    triangle: [u8; BATCH],
    /// The points at rest, in cells, that the warp takes to the centres.
    p: [Numbers; 2],
}

/// W⁻¹ at a texel centre.
pub struct Inverse<'a> {
    /// The chart whose warp it is.
    pub chart: u32,
    batch: &'a Batch,
    n: usize,
}

impl Inverse<'_> {
    /// The point, in cells.
    #[inline(always)]
    pub fn point(&self) -> [f64; 2] {
        self.batch.p.map(|of| of[self.n])
    }

    /// True if the point's cell is not wholly in the chart itself.
    #[inline(always)]
    pub fn is_beyond(&self) -> bool {
        self.batch.is_beyond[self.n]
    }

    /// The derivatives of W⁻¹ in the point's triangle, in cells per texel: a row for each component of W⁻¹.
    #[inline(always)]
    pub fn jacobian(&self) -> [[f64; 2]; 2] {
        let Inverse { batch, n, .. } = *self;
        let corner = |k: usize| DVec2::new(batch.corners[k][0][n], batch.corners[k][1][n]);
        let (a, c) = (corner(0), corner(2));
        let (r1, r2, e1, e2) = if batch.triangle[n] == LOWER {
            (DVec2::X, DVec2::ONE, corner(1) - a, c - a)
        } else {
            (DVec2::ONE, DVec2::Y, c - a, corner(3) - a)
        };
        let inverse = 1.0 / e1.perp_dot(e2);
        [
            [(r1.x * e2.y - r2.x * e1.y) * inverse, (r2.x * e1.x - r1.x * e2.x) * inverse],
            [(r1.y * e2.y - r2.y * e1.y) * inverse, (r2.y * e1.x - r1.y * e2.x) * inverse],
        ]
    }
}

impl Batch {
    pub fn new() -> Batch {
        let none = [0.0; BATCH];
        Batch {
            len: 0,
            x: none,
            y: none,
            node: [none; 2],
            corners: [[none; 2]; 4],
            is_beyond: [false; BATCH],
            triangle: [0; BATCH],
            p: [none; 2],
        }
    }

    /// Adds a candidate: a texel centre, in a cell with this first node and these corners in the order of
    /// `Batch::corners`. There must be room for it.
    #[inline(always)]
    pub fn push(&mut self, [x, y]: [usize; 2], node: [f64; 2], corners: &[[f64; 2]; 4], is_beyond: bool) {
        let n = self.len % BATCH;
        (self.x[n], self.y[n]) = (x as f64, y as f64);
        for c in 0..2 {
            self.node[c][n] = node[c];
            for k in 0..4 {
                self.corners[k][c][n] = corners[k][c];
            }
        }
        self.is_beyond[n] = is_beyond;
        self.len += 1;
    }

    /// Finds the triangles in which the candidates lie, calls `f(x, y, inverse)` for those that lie in one, in order,
    /// with their texels, and empties the batch. All are of one chart.
    #[inline(always)]
    pub fn flush(&mut self, chart: u32, mut f: impl FnMut(usize, usize, Inverse)) {
        self.locate();
        for n in (0..self.len).filter(|&n| self.triangle[n] != 0) {
            f(self.x[n] as usize, self.y[n] as usize, Inverse { chart, batch: self, n });
        }
        self.len = 0;
    }

    /// Finds the triangles. One without area, which only the paper's solver makes, contains nothing. In a sliver the
    /// rounded coordinates are clamped to the triangle.
    #[inline(always)]
    fn locate(&mut self) {
        let Batch { x, y, node, corners: [a, b, c, d], triangle, p: [px, py], .. } = self;
        for n in 0..BATCH {
            let at = (x[n], y[n]);
            let (a, b) = ((a[0][n], a[1][n]), (b[0][n], b[1][n]));
            let (c, d) = ((c[0][n], c[1][n]), (d[0][n], d[1][n]));
            let (ab, ac, ad) = (minus(b, a), minus(c, a), minus(d, a));
            let (lower, upper) = (cross(ab, ac), cross(ac, ad));
            let diagonal = Side::new(a, c, at);
            let in_lower = (lower != 0.0)
                & Side::new(a, b, at).holds(lower, 1.0)
                & Side::new(b, c, at).holds(lower, 1.0)
                & diagonal.holds(lower, -1.0);
            let in_upper = (upper != 0.0)
                & Side::new(c, d, at).holds(upper, 1.0)
                & Side::new(d, a, at).holds(upper, 1.0)
                & diagonal.holds(upper, 1.0);
            triangle[n] = if in_upper { UPPER } else { u8::from(in_lower) * LOWER };
            let select = |lower: f64, upper: f64| if in_upper { upper } else { lower };
            let (e1, e2) =
                ((select(ab.0, ac.0), select(ab.1, ac.1)), (select(ac.0, ad.0), select(ac.1, ad.1)));
            let inverse = 1.0 / select(lower, upper);
            let from = minus(at, a);
            let l1 = clamped(cross(from, e2) * inverse, 1.0);
            let l2 = clamped(cross(e1, from) * inverse, 1.0 - l1);
            // The edges at rest are (1,0) and (1,1), or (1,1) and (0,1).
            px[n] = node[0][n] + l1 + l2 * select(1.0, 0.0);
            py[n] = node[1][n] + l1 * select(0.0, 1.0) + l2;
        }
    }
}

/// On which side of an edge a point lies.
struct Side {
    /// Positive to the left of the edge from its lower to its higher end, negative to its right.
    side: f64,
    /// 1 if the edge goes from its lower to its higher end (of a horizontal one: from left to right), -1 if the other
    /// way.
    sign: f64,
    is_horizontal: bool,
}

impl Side {
    #[inline(always)]
    fn new(from: (f64, f64), to: (f64, f64), at: (f64, f64)) -> Side {
        let falls = (from.1 > to.1) | ((from.1 == to.1) & (from.0 > to.0));
        let select = |a: f64, b: f64| if falls { b } else { a };
        let (low, high) =
            ((select(from.0, to.0), select(from.1, to.1)), (select(to.0, from.0), select(to.1, from.1)));
        let along = minus(high, low);
        Side { side: cross(along, minus(at, low)), sign: select(1.0, -1.0), is_horizontal: along.1 == 0.0 }
    }

    /// True if a triangle of this signed area, which has the edge the same way round (`way` 1) or the other (-1),
    /// contains the point as far as this edge tells. Its left and its lower edges belong to a triangle.
    #[inline(always)]
    fn holds(&self, area: f64, way: f64) -> bool {
        let sign = if area < 0.0 { -way * self.sign } else { way * self.sign };
        let is_owned = (self.is_horizontal & (sign > 0.0)) | (!self.is_horizontal & (sign < 0.0));
        let side = sign * self.side;
        (side > 0.0) | ((side == 0.0) & is_owned)
    }
}

#[inline(always)]
fn minus(a: (f64, f64), b: (f64, f64)) -> (f64, f64) {
    (a.0 - b.0, a.1 - b.1)
}

#[inline(always)]
fn cross(a: (f64, f64), b: (f64, f64)) -> f64 {
    a.0 * b.1 - a.1 * b.0
}

/// Clamped to 0..`most`.
#[inline(always)]
fn clamped(x: f64, most: f64) -> f64 {
    let x = if x < 0.0 { 0.0 } else { x };
    if x > most { most } else { x }
}
