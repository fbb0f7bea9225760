//! A straightforward implementation of relaxation (method §4 and §6), with which the library's updates are compared:
//! f64, scalar, one core, a loop over nodes. Each node takes its own 2x2 Gauss-Newton step on the finest level's energy
//! (exact chords, smoothness, room), limited so that no corner Jacobian falls under ε, and only if its own energy does
//! not rise.

use vrtm::TileSettings;

use crate::plain_mesh::{PlainMesh, Triangle};

const BOUND: f64 = 0.02;
const MAX_STEP: f64 = 2.0;

const NEIGHBOURS: [[i64; 2]; 8] = [[-1, -1], [0, -1], [1, -1], [-1, 0], [1, 0], [-1, 1], [0, 1], [1, 1]];

/// The corners of a cell, counter-clockwise.
const CORNERS: [[i64; 2]; 4] = [[0, 0], [1, 0], [1, 1], [0, 1]];

pub struct Plain {
    pub mesh: PlainMesh,
    lambda: f64,
    floor: f64,
    room: f64,
    threshold: f64,
    /// Per node: displacement in cells, position in the pose, and the triangle under the warped node.
    u: Vec<[f64; 2]>,
    x: Vec<[f64; 3]>,
    triangle: Vec<u32>,
}

impl Plain {
    pub fn new(mesh: PlainMesh, settings: &TileSettings) -> Plain {
        let nodes = mesh.rest.len();
        let mut plain = Plain {
            lambda: f64::from(settings.smoothness),
            floor: f64::from(settings.smoothness_floor),
            room: f64::from(settings.room),
            threshold: f64::from(settings.room_threshold),
            u: vec![[0.0; 2]; nodes],
            x: vec![[0.0; 3]; nodes],
            triangle: mesh.under.clone(),
            mesh,
        };
        for n in 0..nodes {
            if let Some(triangle) = plain.mesh.triangle(plain.triangle[n]) {
                plain.x[n] = triangle.at(plain.mesh.warped(n, [0.0; 2]));
            }
        }
        plain
    }

    /// Relaxes all movable nodes once. Returns their number.
    pub fn sweep(&mut self) -> u64 {
        let mut updates = 0;
        for colour in [[0, 0], [1, 0], [0, 1], [1, 1]] {
            for j in (colour[1]..=self.mesh.size).step_by(2) {
                for i in (colour[0]..=self.mesh.size).step_by(2) {
                    let n = j * (self.mesh.size + 1) + i;
                    if self.mesh.movable[n] {
                        self.step(n);
                        updates += 1;
                    }
                }
            }
        }
        updates
    }

    /// Sums every edge and every corner once.
    pub fn energy(&self) -> f64 {
        let mut sum = 0.0;
        for n in (0..self.u.len()).filter(|&n| self.mesh.movable[n]) {
            for offset in NEIGHBOURS {
                let m = self.neighbour(n, offset);
                if m > n || !self.mesh.movable[m] {
                    sum += self.edge_energy(n, m, offset, self.u[n], &self.x[n]);
                }
            }
            for corner in self.corners(n) {
                // A corner with several movable nodes is summed at the first of them.
                if corner.nodes.iter().find(|&&m| self.mesh.movable[m]) == Some(&n) {
                    sum += self.room_energy(corner.jacobian(self, n, self.u[n]).0);
                }
            }
        }
        sum
    }

    fn step(&mut self, n: usize) {
        let Some(triangle) = self.mesh.triangle(self.triangle[n]) else { return };
        let (mut g, mut h) = ([0.0; 2], [0.0; 3]);
        let mut before = 0.0;
        for offset in NEIGHBOURS {
            let m = self.neighbour(n, offset);
            self.add_edge(n, m, offset, triangle, &mut g, &mut h);
            before += self.edge_energy(n, m, offset, self.u[n], &self.x[n]);
        }
        let corners = self.corners(n).map(|corner| corner.jacobian(self, n, self.u[n]));
        for (jacobian, slope) in &corners {
            before += self.room_energy(*jacobian);
            let lack = (self.threshold - jacobian).max(0.0);
            if lack > 0.0 {
                for c in 0..2 {
                    g[c] -= 2.0 * self.room * lack * slope[c];
                }
                h[0] += 2.0 * self.room * slope[0] * slope[0];
                h[1] += 2.0 * self.room * slope[0] * slope[1];
                h[2] += 2.0 * self.room * slope[1] * slope[1];
            }
        }
        let det = h[0] * h[2] - h[1] * h[1];
        let mut delta = [(h[1] * g[1] - h[2] * g[0]) / det, (h[1] * g[0] - h[0] * g[1]) / det];
        delta = delta.map(|x| x.clamp(-MAX_STEP, MAX_STEP));
        let mut fraction: f64 = 1.0;
        for (jacobian, slope) in &corners {
            let change = slope[0] * delta[0] + slope[1] * delta[1];
            if change < 0.0 {
                fraction = fraction.min((jacobian - BOUND).max(0.0) / -change);
            }
        }
        delta = delta.map(|x| 0.999 * fraction * x);
        for _ in 0..2 {
            let u = [self.u[n][0] + delta[0], self.u[n][1] + delta[1]];
            let at = self.mesh.warped(n, u);
            if let Some(found) = self.mesh.walk(self.triangle[n], at) {
                let x = self.mesh.triangles[found as usize].at(at);
                if self.node_energy(n, u, &x) <= before {
                    (self.u[n], self.x[n], self.triangle[n]) = (u, x, found);
                    return;
                }
            }
            delta = delta.map(|x| 0.5 * x);
        }
    }

    fn node_energy(&self, n: usize, u: [f64; 2], x: &[f64; 3]) -> f64 {
        let edges =
            NEIGHBOURS.iter().map(|&offset| self.edge_energy(n, self.neighbour(n, offset), offset, u, x));
        let corners = self.corners(n);
        edges.sum::<f64>()
            + corners.iter().map(|corner| self.room_energy(corner.jacobian(self, n, u).0)).sum::<f64>()
    }

    fn weights(&self, n: usize, m: usize, offset: [i64; 2]) -> (f64, f64) {
        let w = self.mesh.rigidity[n].max(self.mesh.rigidity[m]);
        let d2 = (offset[0] * offset[0] + offset[1] * offset[1]) as f64;
        (w, (self.lambda * (1.0 - w) + self.floor) / d2)
    }

    fn edge_energy(&self, n: usize, m: usize, offset: [i64; 2], u: [f64; 2], x: &[f64; 3]) -> f64 {
        let (w, smooth) = self.weights(n, m, offset);
        let rest = distance(&self.mesh.rest[n], &self.mesh.rest[m]);
        let strain = distance(x, &self.x[m]) / rest - 1.0;
        let d = [u[0] - self.u[m][0], u[1] - self.u[m][1]];
        w * strain * strain + smooth * (d[0] * d[0] + d[1] * d[1])
    }

    /// Adds the gradient and the 2x2 matrix (xx, xy, yy) of an edge with respect to node n.
    fn add_edge(
        &self,
        n: usize,
        m: usize,
        offset: [i64; 2],
        on: &Triangle,
        g: &mut [f64; 2],
        h: &mut [f64; 3],
    ) {
        let (w, smooth) = self.weights(n, m, offset);
        let rest = distance(&self.mesh.rest[n], &self.mesh.rest[m]);
        let length = distance(&self.x[n], &self.x[m]);
        let unit: [f64; 3] = std::array::from_fn(|k| (self.x[n][k] - self.x[m][k]) / length.max(1e-300));
        let slope = [dot(&on.tangent[0], &unit), dot(&on.tangent[1], &unit)];
        let along = 2.0 * w / (rest * rest);
        // A chord under tension also resists rotation.
        let across = along * (1.0 - rest / length.max(1e-300)).max(0.0);
        for c in 0..2 {
            let d = self.u[n][c] - self.u[m][c];
            g[c] += along * (length - rest) * slope[c] + 2.0 * smooth * d;
        }
        let metric = |r: usize, c: usize| dot(&on.tangent[r], &on.tangent[c]);
        h[0] += (along - across) * slope[0] * slope[0] + across * metric(0, 0) + 2.0 * smooth;
        h[1] += (along - across) * slope[0] * slope[1] + across * metric(0, 1);
        h[2] += (along - across) * slope[1] * slope[1] + across * metric(1, 1) + 2.0 * smooth;
    }

    fn room_energy(&self, jacobian: f64) -> f64 {
        self.room * (self.threshold - jacobian).max(0.0).powi(2)
    }

    fn neighbour(&self, n: usize, offset: [i64; 2]) -> usize {
        (n as i64 + offset[1] * (self.mesh.size as i64 + 1) + offset[0]) as usize
    }

    /// The 12 corners whose Jacobians depend on a node: in each of its four cells, all corners except the one at the
    /// opposite node.
    fn corners(&self, n: usize) -> [Corner; 12] {
        std::array::from_fn(|k| {
            // In cell k / 3 the node is corner `own`; the Jacobian is that of this corner, the next one or the previous
            // one.
            let own = k / 3;
            let at = (own + [0, 1, 3][k % 3]) % 4;
            let offsets = [at, (at + 1) % 4, (at + 3) % 4]
                .map(|c| [CORNERS[c][0] - CORNERS[own][0], CORNERS[c][1] - CORNERS[own][1]]);
            Corner { nodes: offsets.map(|offset| self.neighbour(n, offset)), offsets }
        })
    }
}

/// A corner of a cell: its node, the next node and the previous one, with their offsets from the moving node at rest.
#[derive(Clone, Copy)]
struct Corner {
    nodes: [usize; 3],
    offsets: [[i64; 2]; 3],
}

impl Corner {
    /// J and its derivative with respect to node n, whose displacement is `u`.
    fn jacobian(&self, plain: &Plain, n: usize, u: [f64; 2]) -> (f64, [f64; 2]) {
        let [a, b, c]: [[f64; 2]; 3] = std::array::from_fn(|k| {
            let shift = if self.nodes[k] == n { u } else { plain.u[self.nodes[k]] };
            [0, 1].map(|axis| self.offsets[k][axis] as f64 + shift[axis])
        });
        let jacobian = (b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0]);
        let slope = if self.nodes[0] == n {
            [b[1] - c[1], c[0] - b[0]]
        } else if self.nodes[1] == n {
            [c[1] - a[1], a[0] - c[0]]
        } else {
            [a[1] - b[1], b[0] - a[0]]
        };
        (jacobian, slope)
    }
}

pub fn dot(a: &[f64; 3], b: &[f64; 3]) -> f64 {
    a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
}

fn distance(a: &[f64; 3], b: &[f64; 3]) -> f64 {
    ((a[0] - b[0]).powi(2) + (a[1] - b[1]).powi(2) + (a[2] - b[2]).powi(2)).sqrt()
}
