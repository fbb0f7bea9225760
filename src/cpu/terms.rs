//! The energy of DESIGN 5 seen from one row of eight nodes: its terms, their gradient, and their Gauss-Newton matrix.

use super::lanes::{Lanes, Truth, each};
use super::patch::{NEIGHBOURS, Patch, Place, QUADRANTS, Weights};
use super::row::Row;
use super::sampling::{Chord, Surface};

/// The energy of what a row's nodes touch.
pub struct Terms<V> {
    /// The sum, each node's own in its lane.
    pub energy: V,
    /// Of the edges to each of the neighbours.
    pub edges: [V; 8],
    /// J and its gradient, three corners for each of four cells.
    pub corners: [(V, [V; 2]); 12],
}

/// The energy, and its gradient and Gauss-Newton matrix (halves of the derivatives).
pub struct Local<V> {
    pub terms: Terms<V>,
    pub gradient: [V; 2],
    /// (xx, xy, yy).
    pub matrix: [V; 3],
}

/// Sees the edges of a row's nodes: the neighbour's number, the edge, dL/du of the node, and what the other end's needs.
pub trait Visitor<V: Lanes> {
    fn edge<S: Surface>(&mut self, row: Row, k: usize, edge: &Edge<V>, near: &[V; 2], chord: &Chord<V>);
}

/// Looks at none of them.
impl<V: Lanes> Visitor<V> for () {
    #[inline(always)]
    fn edge<S: Surface>(&mut self, _: Row, _: usize, _: &Edge<V>, _: &[V; 2], _: &Chord<V>) {}
}

impl Patch {
    /// An edge's ends and constants: neighbour's value, both on one triangle, offset d, l, 1 / max(l, floor), w.
    #[inline(always)]
    pub fn edge<V: Lanes>(&self, row: Row, p: &Place<V>, k: usize) -> Edge<V> {
        let (di, dj, e, theirs) = NEIGHBOURS[k];
        // Where the owner is.
        let (oi, oj) = if theirs { (di, dj) } else { (0, 0) };
        let weight = row.near::<V>(&self.rigidity, 0, 0).max(row.near(&self.rigidity, di, dj));
        Edge {
            value: each!([0, 1, 2], |c| row.near(&self.value[c], di, dj)),
            same: V::same(V::load_index(&self.triangle, row.at(di, dj)), p.on.triangle),
            d: row.offset(&self.u, &p.u, di, dj),
            length: row.near(&self.length[e], oi, oj),
            inverse: row.near(&self.inverse[e], oi, oj),
            weight,
            density: if self.dense {
                (row.near::<V>(&self.density, 0, 0) + row.near::<V>(&self.density, di, dj)) * 0.5
            } else {
                V::zero()
            },
            shorter: 1.0 / (di * di + dj * dj) as f32,
            normal: [-dj as f32, di as f32],
        }
    }

    /// True if an edge at one of a row's nodes is rigid to some degree, or has an orientation to keep. Where none is,
    /// smoothness is all there is.
    #[inline(always)]
    pub fn is_rigid<V: Lanes>(&self, row: Row, weights: &Weights) -> bool {
        if weights.orients() {
            return true;
        }
        let mut most = row.near::<V>(&self.rigidity, 0, 0);
        for &(di, dj, ..) in &NEIGHBOURS {
            most = most.max(row.near(&self.rigidity, di, dj));
        }
        V::zero().lt(most).any()
    }

    /// Energy of the edges and corners of a row's nodes; `rigid` as `is_rigid` says.
    #[inline(always)]
    pub fn terms<V: Lanes, S: Surface>(
        &self,
        row: Row,
        p: &Place<V>,
        weights: &Weights,
        rigid: bool,
    ) -> Terms<V> {
        if !rigid {
            return self.elastic(row, p, weights).terms;
        }
        let edges = each!([0, 1, 2, 3, 4, 5, 6, 7], |k| {
            let edge = self.edge(row, p, k);
            let length = S::length(&p.on.value, &p.on.slope, &edge.value, edge.same, &edge.d);
            edge.energy(k, length, weights)
        });
        self.with_corners(row, p, edges, weights)
    }

    /// Adds the corners' energy to that of the edges.
    #[inline(always)]
    fn with_corners<V: Lanes>(&self, row: Row, p: &Place<V>, edges: [V; 8], weights: &Weights) -> Terms<V> {
        let mut energy = V::zero();
        for edge in edges {
            energy += edge;
        }
        let corners = self.corners(row, p);
        if lowest(&corners).lt(V::splat(weights.room_threshold)).any() {
            for corner in &corners {
                energy += room(corner.0, weights);
            }
        }
        Terms { energy, edges, corners }
    }

    /// Everything a node's own Gauss-Newton step needs; `rigid` as `is_rigid` says. `visitor` sees the edges where it is.
    #[inline(always)]
    pub fn local<V: Lanes, S: Surface>(
        &self,
        row: Row,
        p: &Place<V>,
        weights: &Weights,
        rigid: bool,
        visitor: &mut impl Visitor<V>,
    ) -> Local<V> {
        if !rigid {
            return self.elastic(row, p, weights);
        }
        let mut edges = [V::zero(); 8];
        let mut gradient = [V::zero(); 2];
        let mut matrix = [V::zero(); 3];
        each!([0, 1, 2, 3, 4, 5, 6, 7], |k| {
            let edge = self.edge(row, p, k);
            let (length, near, chord) =
                S::gradient(&p.on.value, &p.on.slope, &edge.value, edge.same, &edge.d);
            visitor.edge::<S>(row, k, &edge, &near, &chord);
            edges[k] = edge.energy(k, length, weights);
            let scaled = edge.weight * edge.inverse;
            let pull = scaled * ((length - edge.length) * edge.inverse);
            let square = scaled * edge.inverse;
            let smooth = edge.smoothness(weights);
            let rest = edge.stretch(k);
            for c in 0..2 {
                gradient[c] += pull * near[c] - smooth * rest[c];
            }
            matrix[0] += square * near[0] * near[0] + smooth;
            matrix[1] += square * near[0] * near[1];
            matrix[2] += square * near[1] * near[1] + smooth;
            if weights.orients() {
                let [nx, ny] = edge.normal;
                let kappa = edge.orientation(weights);
                let off = edge.off_axis() * kappa;
                gradient[0] -= off * nx;
                gradient[1] -= off * ny;
                matrix[0] += kappa * (nx * nx);
                matrix[1] += kappa * (nx * ny);
                matrix[2] += kappa * (ny * ny);
            }
        });
        self.with_room(row, p, edges, gradient, matrix, weights)
    }

    /// The same where nothing is rigid: smoothness alone.
    #[inline(always)]
    fn elastic<V: Lanes>(&self, row: Row, p: &Place<V>, weights: &Weights) -> Local<V> {
        let mut edges = [V::zero(); 8];
        let mut gradient = [V::zero(); 2];
        let mut matrix = [V::zero(); 3];
        each!([0, 1, 2, 3, 4, 5, 6, 7], |k| {
            let (di, dj, ..) = NEIGHBOURS[k];
            let shorter = 1.0 / (di * di + dj * dj) as f32;
            let smooth = V::splat((weights.smoothness + weights.smoothness_floor) * shorter);
            let d = row.offset(&self.u, &p.u, di, dj);
            let rest = [d[0] - V::splat(di as f32), d[1] - V::splat(dj as f32)];
            edges[k] = smooth * (rest[0] * rest[0] + rest[1] * rest[1]);
            gradient[0] -= smooth * rest[0];
            gradient[1] -= smooth * rest[1];
            matrix[0] += smooth;
            matrix[2] += smooth;
        });
        self.with_room(row, p, edges, gradient, matrix, weights)
    }

    /// Adds the room term.
    #[inline(always)]
    fn with_room<V: Lanes>(
        &self,
        row: Row,
        p: &Place<V>,
        edges: [V; 8],
        mut gradient: [V; 2],
        mut matrix: [V; 3],
        weights: &Weights,
    ) -> Local<V> {
        let terms = self.with_corners(row, p, edges, weights);
        if lowest(&terms.corners).lt(V::splat(weights.room_threshold)).any() {
            for (jacobian, slope) in &terms.corners {
                let lack = (V::splat(weights.room_threshold) - *jacobian).max(V::zero());
                let active = jacobian.lt(V::splat(weights.room_threshold));
                let beta = active.select(V::splat(weights.room), V::zero());
                let pull = lack * weights.room;
                gradient[0] -= pull * slope[0];
                gradient[1] -= pull * slope[1];
                matrix[0] += beta * slope[0] * slope[0];
                matrix[1] += beta * slope[0] * slope[1];
                matrix[2] += beta * slope[1] * slope[1];
            }
        }
        Local { terms, gradient, matrix }
    }

    /// Corner Jacobians that a row's nodes touch, each affine in the node, with their gradients: per cell that of the
    /// node's own corner, of its x-neighbour's, of its y-neighbour's.
    #[inline(always)]
    pub fn corners<V: Lanes>(&self, row: Row, p: &Place<V>) -> [(V, [V; 2]); 12] {
        let mut corners = [(V::zero(), [V::zero(); 2]); 12];
        for (q, &(sx, sy)) in QUADRANTS.iter().enumerate() {
            let (a, b) = (row.offset(&self.u, &p.u, sx, 0), row.offset(&self.u, &p.u, 0, sy));
            let c = row.offset(&self.u, &p.u, sx, sy);
            let sign = (sx * sy) as f32;
            corners[3 * q] = corner(&a, &b, sign);
            corners[3 * q + 1] = corner(&a, &c, sign);
            corners[3 * q + 2] = corner(&c, &b, sign);
        }
        corners
    }
}

/// J of a corner from the offsets to its neighbours a and b, and its gradient in the corner.
#[inline(always)]
fn corner<V: Lanes>(a: &[V; 2], b: &[V; 2], sign: f32) -> (V, [V; 2]) {
    let jacobian = (a[0] * b[1] - a[1] * b[0]) * sign;
    (jacobian, [(a[1] - b[1]) * sign, (b[0] - a[0]) * sign])
}

/// The smallest of a row's corner Jacobians, lane by lane, at most 1.
#[inline(always)]
pub fn lowest<V: Lanes>(corners: &[(V, [V; 2]); 12]) -> V {
    let mut low = V::one();
    for corner in corners {
        low = corner.0.min(low);
    }
    low
}

/// β max(0, τ - J)².
#[inline(always)]
pub fn room<V: Lanes>(jacobian: V, weights: &Weights) -> V {
    let lack = (V::splat(weights.room_threshold) - jacobian).max(V::zero());
    lack * lack * weights.room
}

/// One edge of each of a row's nodes.
pub struct Edge<V: Lanes> {
    pub value: [V; 3],
    pub same: V::Mask,
    pub d: [V; 2],
    pub length: V,
    pub inverse: V,
    pub weight: V,
    /// Mean of both ends.
    pub density: V,
    /// 1 / |d0|².
    pub shorter: f32,
    /// d0 turned by 90 degrees (not unit: its length is |d0|).
    pub normal: [f32; 2],
}

impl<V: Lanes> Edge<V> {
    /// (λ (1-w) + λ0) / |d0|².
    #[inline(always)]
    pub fn smoothness(&self, weights: &Weights) -> V {
        ((V::one() - self.weight) * weights.smoothness + weights.smoothness_floor) * self.shorter
    }

    /// κ / |d0|⁴: κ is the mean of both ends', and `normal` and `off_axis` have a length of |d0| each.
    #[inline(always)]
    pub fn orientation(&self, weights: &Weights) -> V {
        (self.density * weights.orientation_density + V::splat(weights.orientation))
            * (self.shorter * self.shorter)
    }

    /// d - d0.
    #[inline(always)]
    fn stretch(&self, k: usize) -> [V; 2] {
        each!([0, 1], |c| {
            let rest = if c == 0 { NEIGHBOURS[k].0 } else { NEIGHBOURS[k].1 };
            self.d[c] - V::splat(rest as f32)
        })
    }

    /// |d0| n0·d.
    #[inline(always)]
    fn off_axis(&self) -> V {
        self.d[0] * self.normal[0] + self.d[1] * self.normal[1]
    }

    /// The edge's terms of the energy.
    #[inline(always)]
    pub fn energy(&self, k: usize, length: V, weights: &Weights) -> V {
        let strain = (length - self.length) * self.inverse;
        let rest = self.stretch(k);
        let mut energy = self.weight * strain * strain
            + self.smoothness(weights) * (rest[0] * rest[0] + rest[1] * rest[1]);
        if weights.orients() {
            let off = self.off_axis();
            energy += off * off * self.orientation(weights);
        }
        energy
    }
}
