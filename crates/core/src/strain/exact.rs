//! The exact surface map f from the UV plane to space (method §2), affine on each triangle, in f64, with point
//! location. Used by the reference solver and for the strain on the mesh; it shares no numbers with the solver's own
//! f32 surface.

use glam::DVec2;

use crate::allocation::Vec;
use crate::mesh::{NONE, TileMesh};

/// Barycentric coordinates of at least minus this count as inside: a point on an edge belongs to the triangles on both
/// sides.
const SLACK: f64 = 1e-12;

/// A triangle in the UV plane, in cells.
#[derive(Clone, Copy, Debug)]
struct ExactTriangle {
    origin: DVec2,
    /// Rows of the 2x2 matrix that takes an offset from `origin` to the barycentric coordinates of corners 1 and 2.
    barycentric: [DVec2; 2],
    neighbours: [u32; 3],
}

impl ExactTriangle {
    fn barycentrics(&self, at: DVec2) -> [f64; 3] {
        let [l1, l2] = self.barycentric.map(|row| row.dot(at - self.origin));
        [1.0 - l1 - l2, l1, l2]
    }
}

/// Finds the triangle under any point of a chart.
#[derive(Debug)]
pub struct Locator {
    nx: usize,
    ny: usize,
    triangles: Vec<ExactTriangle>,
    chart_of: Vec<u32>,
    /// The triangle under each node of the grid, or `NONE`.
    under: Vec<u32>,
}

impl Locator {
    /// `under` gives the triangle under each of the (nx + 1) x (ny + 1) nodes, or `NONE`.
    pub fn new(tile: &TileMesh, nx: usize, ny: usize, under: Vec<u32>) -> Locator {
        let cells = DVec2::new(nx as f64, ny as f64);
        Locator::of(tile, [nx, ny], |uv| uv * cells, under)
    }

    /// A locator over another lattice of (nx + 1) x (ny + 1) points than a grid's nodes; `place` takes a UV to a place
    /// among them.
    pub fn of(
        tile: &TileMesh,
        [nx, ny]: [usize; 2],
        place: impl Fn(DVec2) -> DVec2,
        under: Vec<u32>,
    ) -> Locator {
        let triangles = tile
            .triangles
            .iter()
            .map(|t| {
                let [a, b, c] = t.uv.map(&place);
                let (e1, e2) = (b - a, c - a);
                let det = e1.perp_dot(e2);
                ExactTriangle {
                    origin: a,
                    barycentric: [-e2.perp() / det, e1.perp() / det],
                    neighbours: t.neighbours,
                }
            })
            .collect();
        Locator { nx, ny, triangles, chart_of: tile.chart_of_triangles(), under }
    }

    /// The triangle under node (i, j) at rest, or `NONE`.
    pub fn under(&self, i: usize, j: usize) -> u32 {
        self.under[j * (self.nx + 1) + i]
    }

    /// The chart of a triangle.
    pub(super) fn chart(&self, triangle: u32) -> u32 {
        self.chart_of[triangle as usize]
    }

    /// The triangle under a point given in cells, in the chart of the triangle `home`. The walk starts at the triangle
    /// under the nearest node. The border of a non-convex chart may stop it; it then starts again at the corners of the
    /// point's cell and at `home`. Finally all triangles of the chart are searched for the one that contains the point
    /// best (by rounding, a point on the border may lie outside of all of them).
    pub fn find(&self, at: DVec2, home: u32) -> u32 {
        let chart = self.chart_of[home as usize];
        let clamp = |x: f64, n: usize| x.clamp(0.0, n as f64) as usize;
        let under_node = |x: f64, y: f64| {
            let t = self.under(clamp(x, self.nx), clamp(y, self.ny));
            (t != NONE && self.chart_of[t as usize] == chart).then_some(t)
        };
        let nearest = under_node(at.x.round(), at.y.round()).unwrap_or(home);
        if let Some(t) = self.walk(nearest, at) {
            return t;
        }
        let DVec2 { x, y } = at.floor();
        for corner in [(x, y), (x + 1.0, y), (x, y + 1.0), (x + 1.0, y + 1.0)] {
            if let Some(t) = under_node(corner.0, corner.1).and_then(|t| self.walk(t, at)) {
                return t;
            }
        }
        self.walk(home, at).unwrap_or_else(|| self.search(chart, at))
    }

    /// Follows the surface from the triangle `start` to the triangle under a point given in cells. It crosses the edge
    /// opposite to the most negative barycentric coordinate (where it has a neighbour) until no coordinate is negative.
    /// `None` if no such edge exists, or after too many steps.
    pub fn walk(&self, start: u32, at: DVec2) -> Option<u32> {
        let mut t = start;
        // On badly shaped triangles such a walk may go round in circles.
        for _ in 0..1000 {
            let triangle = &self.triangles[t as usize];
            let l = triangle.barycentrics(at);
            if l.iter().all(|&l| l >= -SLACK) {
                return Some(t);
            }
            let mut order = [0, 1, 2];
            order.sort_unstable_by(|&a, &b| l[a].total_cmp(&l[b]));
            let beyond = |k: usize| l[k] < -SLACK && triangle.neighbours[k] != NONE;
            let &k = order.iter().find(|&&k| beyond(k))?;
            t = triangle.neighbours[k];
        }
        None
    }

    /// The triangle of a chart whose least barycentric coordinate of the point is the greatest.
    fn search(&self, chart: u32, at: DVec2) -> u32 {
        let depth = |t: usize| self.triangles[t].barycentrics(at).into_iter().fold(f64::INFINITY, f64::min);
        let of_chart = (0..self.triangles.len()).filter(|&t| self.chart_of[t] == chart);
        of_chart.max_by(|&s, &t| depth(s).total_cmp(&depth(t))).map_or(NONE, |t| t as u32)
    }
}

/// f in D dimensions: affine on each triangle, and relative to the first vertex of its chart, so that a mesh far from
/// the origin loses no precision.
#[derive(Debug)]
pub struct Surface<const D: usize> {
    triangles: Vec<Affine<D>>,
}

/// f(at) = value + (at - origin) . tangent, with `at` in cells.
#[derive(Clone, Copy, Debug)]
struct Affine<const D: usize> {
    origin: DVec2,
    value: [f64; D],
    tangent: [[f64; D]; 2],
}

impl<const D: usize> Surface<D> {
    /// `position(v)` is the position of vertex v of the mesh.
    pub fn new(tile: &TileMesh, locator: &Locator, position: impl Fn(usize) -> [f64; D]) -> Surface<D> {
        let affine = |(t, &chart): (usize, &u32)| {
            let chart = &tile.charts[chart as usize];
            let base = position(chart.vertices[0] as usize);
            let [p, q, r] = tile.triangles[t].local.map(|v| chart.position(v, |v| position(v as usize)));
            let uv = &locator.triangles[t];
            let tangent = [0, 1].map(|axis| {
                std::array::from_fn(|k| {
                    (q[k] - p[k]) * uv.barycentric[0][axis] + (r[k] - p[k]) * uv.barycentric[1][axis]
                })
            });
            let value = std::array::from_fn(|k| p[k] - base[k]);
            Affine { origin: uv.origin, value, tangent }
        };
        Surface { triangles: locator.chart_of.iter().enumerate().map(affine).collect() }
    }

    /// f at a point of a triangle.
    pub fn at(&self, triangle: u32, at: DVec2) -> [f64; D] {
        let t = &self.triangles[triangle as usize];
        let d = at - t.origin;
        std::array::from_fn(|k| t.value[k] + d[0] * t.tangent[0][k] + d[1] * t.tangent[1][k])
    }

    /// df/dx and df/dy on a triangle, per cell.
    pub fn tangent(&self, triangle: u32) -> &[[f64; D]; 2] {
        &self.triangles[triangle as usize].tangent
    }
}
