//! Enumerates the integer points in a triangle: nodes under triangles of the UV plane (method §1), and texel centres
//! under warped cells (method §9).

use glam::DVec2;

use crate::mesh::triangle::doubled_area;

/// A triangle whose integer points are enumerated. A point on an edge is treated as if moved by (h, h²) with an
/// infinitesimal h > 0. An edge is always evaluated from its lower to its higher end, so that two triangles that share
/// it compute the same number, and each point falls in exactly one of them.
pub struct Fill {
    corners: [DVec2; 3],
    /// 1 if the corners turn left, -1 if they turn right.
    sign: f64,
    edges: [Edge; 3],
}

/// An edge of a triangle, from its lower to its higher end.
struct Edge {
    low: DVec2,
    high: DVec2,
    /// 1 if the inside is to its left, -1 if it is to its right.
    sign: f64,
    /// True if its points belong to the triangle.
    is_owned: bool,
}

impl Fill {
    pub fn new(corners: [DVec2; 3]) -> Fill {
        let sign = if doubled_area(corners) < 0.0 { -1.0 } else { 1.0 };
        let edge = |a: DVec2, b: DVec2| {
            let falls = (a.y, a.x) > (b.y, b.x);
            let (low, high, sign) = if falls { (b, a, -sign) } else { (a, b, sign) };
            // If the sign is positive, the edge is a right one or, if horizontal, a lower one. Left and lower edges
            // belong to the triangle.
            Edge { low, high, sign, is_owned: if a.y == b.y { sign > 0.0 } else { sign < 0.0 } }
        };
        let [a, b, c] = corners;
        Fill { corners, sign, edges: [edge(a, b), edge(b, c), edge(c, a)] }
    }

    /// Calls `f(i, j, true)` for the points of first[0]..end[0] x first[1]..end[1] that are inside by the fill rule,
    /// and `f(i, j, false)` for the other points of the closed triangle.
    pub fn visit_in(&self, first: [usize; 2], end: [usize; 2], mut f: impl FnMut(usize, usize, bool)) {
        let [first, end] = [first, end].map(|corner| corner.map(|x| x as f64));
        let ys = self.corners.map(|c| c.y);
        let low = ys.iter().copied().fold(f64::INFINITY, f64::min).ceil().max(first[1]);
        let high = ys.iter().copied().fold(f64::NEG_INFINITY, f64::max).floor().min(end[1] - 1.0);
        let mut y = low;
        while y <= high {
            let (left, right) = self.span(y);
            let first = (left - 1e-6).ceil().max(first[0]);
            let last = (right + 1e-6).floor().min(end[0] - 1.0);
            let mut x = first;
            while x <= last {
                if let Some(inside) = self.contains(DVec2::new(x, y)) {
                    f(x as usize, y as usize, inside);
                }
                x += 1.0;
            }
            y += 1.0;
        }
    }

    /// True if a box lies well inside the triangle, so that all of its points do.
    pub fn holds(&self, low: DVec2, high: DVec2) -> bool {
        // Twice the area of the triangle formed by an edge and a point, in cells: far above its rounding error.
        const CLEAR: f64 = 1e-3;
        (0..3).all(|k| {
            let (a, b) = (self.corners[k], self.corners[(k + 1) % 3]);
            [low, high, DVec2::new(low.x, high.y), DVec2::new(high.x, low.y)]
                .into_iter()
                .all(|p| self.sign * doubled_area([a, b, p]) > CLEAR)
        })
    }

    /// The triangle's extent along x in row `y`.
    fn span(&self, y: f64) -> (f64, f64) {
        let mut span = (f64::INFINITY, f64::NEG_INFINITY);
        for k in 0..3 {
            let (a, b) = (self.corners[k], self.corners[(k + 1) % 3]);
            if (a.y < y && b.y < y) || (a.y > y && b.y > y) {
                continue;
            }
            let xs = if a.y == b.y {
                [a.x, b.x]
            } else {
                let x = a.x + (b.x - a.x) * ((y - a.y) / (b.y - a.y));
                [x, x]
            };
            span = (span.0.min(xs[0]).min(xs[1]), span.1.max(xs[0]).max(xs[1]));
        }
        span
    }

    /// `Some(true)` inside by the fill rule, `Some(false)` on an edge but outside by the rule, `None` outside.
    fn contains(&self, p: DVec2) -> Option<bool> {
        let mut inside = true;
        for edge in &self.edges {
            let side = edge.sign * doubled_area([edge.low, edge.high, p]);
            if side < 0.0 {
                return None;
            }
            inside &= side != 0.0 || edge.is_owned;
        }
        Some(inside)
    }
}
