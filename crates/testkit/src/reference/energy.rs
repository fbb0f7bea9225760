//! The energy E of a chart (method §4), its exact gradient, and its Gauss-Newton matrix. Here these are derivatives of
//! E, not halves of them.
//!
//! With v = f(W_b) - f(W_a), L = |v|, v^ = v/L and T = df/dW at each end, the distortion w (L - l)²/l² of an edge has
//!   dE/dv   = 2w (L - l)/l² v^, so that each end is pulled in its own tangent plane by ± T'(dE/dv), and
//!   d²E/dv² = 2w/l² [v^v^' + (1 - l/L)(I - v^v^')],
//! whose second part, the curvature of a chord under tension, is kept in the matrix where it is positive.

use glam::DVec2;

use super::chart::{ChartProblem, Corner, DIM, Edge};
use super::linear::Stencil;
use vrtm_core::strain::exact::{Locator, Surface};

/// A node on the surface.
#[derive(Clone, Copy, Default)]
pub struct Sample {
    pub triangle: u32,
    pub position: [f64; DIM],
}

/// The surface on which lengths are measured, with its point location.
pub struct Shape<'a> {
    pub locator: &'a Locator,
    pub surface: &'a Surface<DIM>,
}

/// First and second derivative of an edge's distortion with respect to v.
struct EdgeLaw {
    /// dE/dv.
    force: [f64; DIM],
    /// v^.
    unit: [f64; DIM],
    /// Second derivative along v.
    along: f64,
    /// Second derivative across v, where it is positive, else 0.
    across: f64,
}

impl ChartProblem {
    /// The sample of the surface at node `n` displaced by `u`.
    pub fn sample(&self, shape: &Shape, n: usize, u: DVec2) -> Sample {
        let at = self.place(n) + u;
        let triangle = shape.locator.find(at, self.home[n]);
        Sample { triangle, position: shape.surface.at(triangle, at) }
    }

    /// The samples at all touched nodes.
    pub fn samples(&self, shape: &Shape, u: &[DVec2]) -> Vec<Sample> {
        let mut samples = vec![Sample::default(); u.len()];
        for &n in &self.touched {
            samples[n as usize] = self.sample(shape, n as usize, u[n as usize]);
        }
        samples
    }

    /// The energy of one edge.
    fn edge_value(&self, edge: &Edge, p: &[f64; DIM], q: &[f64; DIM], u: DVec2) -> f64 {
        let length = (0..DIM).map(|k| (q[k] - p[k]).powi(2)).sum::<f64>().sqrt();
        let strain = (length - edge.length) * edge.inverse;
        let turn = edge.normal.dot(u);
        edge.weight * strain * strain + edge.smooth * u.length_squared() + edge.orientation * turn * turn
    }

    /// The derivatives of one edge's distortion.
    fn edge_law(&self, edge: &Edge, p: &[f64; DIM], q: &[f64; DIM]) -> EdgeLaw {
        let v: [f64; DIM] = std::array::from_fn(|k| q[k] - p[k]);
        let length = v.iter().map(|x| x * x).sum::<f64>().sqrt();
        let unit = if length > 0.0 { v.map(|x| x / length) } else { [0.0; DIM] };
        let along = 2.0 * edge.weight * edge.inverse * edge.inverse;
        let force = unit.map(|x| along * (length - edge.length) * x);
        let across = if length > edge.length { along * (1.0 - edge.length / length) } else { 0.0 };
        EdgeLaw { force, unit, along, across }
    }

    /// The energy, with the barrier if its strength is not 0.
    pub fn energy(&self, u: &[DVec2], samples: &[Sample]) -> f64 {
        let mut sum = 0.0;
        for edge in &self.edges {
            let (a, b) = (edge.a as usize, edge.b as usize);
            sum += self.edge_value(edge, &samples[a].position, &samples[b].position, u[b] - u[a]);
        }
        self.each_jacobian(u, |j| sum += self.law.of(j).0);
        sum
    }

    /// Calls `f` with the Jacobian of every corner that counts.
    pub fn each_jacobian(&self, u: &[DVec2], mut f: impl FnMut(f64)) {
        for &cell in &self.cells {
            for corner in self.corners(cell as usize).filter(|&c| self.counts(c)) {
                f(corner.jacobian(corner.nodes.map(|n| u[n]), corner.rest()).0);
            }
        }
    }

    /// The gradient of the energy. Sets `matrix`, if there is one, to its Gauss-Newton matrix.
    pub fn gradient(
        &self,
        shape: &Shape,
        u: &[DVec2],
        samples: &[Sample],
        mut matrix: Option<&mut Vec<Stencil>>,
    ) -> Vec<DVec2> {
        let mut gradient = vec![DVec2::ZERO; u.len()];
        if let Some(matrix) = &mut matrix {
            matrix.fill([[0.0; 4]; 9]);
        }
        for edge in &self.edges {
            let ends = [edge.a as usize, edge.b as usize];
            let law = self.edge_law(edge, &samples[ends[0]].position, &samples[ends[1]].position);
            let tangents = ends.map(|n| shape.surface.tangent(samples[n].triangle));
            let d = u[ends[1]] - u[ends[0]];
            let soft = edge.soft();
            let pull = soft.map(|row| row.dot(d));
            // T'v^ at both ends.
            let slope = tangents.map(|t| [dot(&t[0], &law.unit), dot(&t[1], &law.unit)]);
            for (p, sign) in [(0, -1.0), (1, 1.0)] {
                for c in 0..2 {
                    gradient[ends[p]][c] += sign * (dot(&tangents[p][c], &law.force) + pull[c]);
                }
                let Some(matrix) = &mut matrix else { continue };
                for q in 0..2 {
                    if !(self.movable[ends[p]] && self.movable[ends[q]]) {
                        continue;
                    }
                    let block = &mut matrix[ends[p]][self.stencil_index(ends[p], ends[q])];
                    let sign = if p == q { 1.0 } else { -1.0 };
                    for (r, soft) in soft.iter().enumerate() {
                        for c in 0..2 {
                            let mut x = soft[c] + (law.along - law.across) * slope[p][r] * slope[q][c];
                            if law.across > 0.0 {
                                x += law.across * dot(&tangents[p][r], &tangents[q][c]);
                            }
                            block[r * 2 + c] += sign * x;
                        }
                    }
                }
            }
        }
        for &cell in &self.cells {
            for corner in self.corners(cell as usize).filter(|&c| self.counts(c)) {
                let (j, slopes) = corner.jacobian(corner.nodes.map(|n| u[n]), corner.rest());
                let (_, first, second) = self.law.of(j);
                if first == 0.0 {
                    continue;
                }
                for (&n, s) in corner.nodes.iter().zip(&slopes) {
                    gradient[n] += first * s;
                    let Some(matrix) = &mut matrix else { continue };
                    for (&m, t) in corner.nodes.iter().zip(&slopes) {
                        if self.movable[n] && self.movable[m] {
                            let block = &mut matrix[n][self.stencil_index(n, m)];
                            for k in 0..4 {
                                block[k] += second * s[k / 2] * t[k % 2];
                            }
                        }
                    }
                }
            }
        }
        for (g, &movable) in gradient.iter_mut().zip(&self.movable) {
            if !movable {
                *g = DVec2::ZERO;
            }
        }
        gradient
    }

    /// Energy of all edges and corners of one movable node, displaced by `at` with the sample `s`.
    pub fn node_energy(&self, samples: &[Sample], u: &[DVec2], n: usize, at: DVec2, s: &Sample) -> f64 {
        let mut sum = 0.0;
        for &e in &self.edges_of[n] {
            let edge = &self.edges[e as usize];
            let other = edge.other(n);
            let (p, q) = (&s.position, &samples[other].position);
            sum += self.edge_value(edge, p, q, at - u[other]);
        }
        for corner in self.corners_of(n) {
            let nodes = corner.nodes.map(|m| if m == n { at } else { u[m] });
            sum += self.law.of(corner.jacobian(nodes, corner.rest()).0).0;
        }
        sum
    }

    /// Gradient and 2x2 matrix of one movable node.
    pub fn node_system(&self, shape: &Shape, samples: &[Sample], u: &[DVec2], n: usize) -> (DVec2, [f64; 4]) {
        let (mut g, mut h) = (DVec2::ZERO, [0.0; 4]);
        let t = shape.surface.tangent(samples[n].triangle);
        for &e in &self.edges_of[n] {
            let edge = &self.edges[e as usize];
            let other = edge.other(n);
            let law = self.edge_law(edge, &samples[other].position, &samples[n].position);
            let d = u[n] - u[other];
            let soft = edge.soft();
            let slope = [dot(&t[0], &law.unit), dot(&t[1], &law.unit)];
            for r in 0..2 {
                g[r] += dot(&t[r], &law.force) + soft[r][0] * d[0] + soft[r][1] * d[1];
                for c in 0..2 {
                    h[r * 2 + c] += soft[r][c]
                        + (law.along - law.across) * slope[r] * slope[c]
                        + law.across * dot(&t[r], &t[c]);
                }
            }
        }
        for corner in self.corners_of(n) {
            let (j, slopes) = corner.jacobian(corner.nodes.map(|m| u[m]), corner.rest());
            let (_, first, second) = self.law.of(j);
            let s = slopes[corner.nodes.iter().position(|&m| m == n).unwrap_or(0)];
            g += first * s;
            for k in 0..4 {
                h[k] += second * s[k / 2] * s[k % 2];
            }
        }
        (g, h)
    }

    /// The twelve corners whose Jacobians depend on a node.
    pub fn corners_of(&self, n: usize) -> impl Iterator<Item = Corner> + '_ {
        let width = self.width();
        [n - width - 1, n - width, n - 1, n]
            .into_iter()
            .flat_map(|cell| self.corners(cell))
            .filter(move |c| c.nodes.contains(&n))
    }

    /// Index of node `m` in the stencil of node `n`.
    fn stencil_index(&self, n: usize, m: usize) -> usize {
        let width = self.width();
        (m / width + 1 - n / width) * 3 + m % width + 1 - n % width
    }
}

fn dot(a: &[f64; DIM], b: &[f64; DIM]) -> f64 {
    a.iter().zip(b).map(|(a, b)| a * b).sum()
}
