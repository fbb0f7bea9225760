//! The energy of the edges and corners at one row of eight nodes, with its gradient and Gauss-Newton matrix, computed
//! from the displacements, samples, rigidities and rest lengths of a patch (method §4).

use super::lanes::{Lanes, Mask, each};
use super::patch::{NEIGHBOURS, NodeState, Patch, QUADRANTS, Weights};
use super::row::Row;
use super::sampling::{GradientTerms, Slopes, Surface};
use vrtm_core::method::law::{COMPRESSION_STIFFNESS, HARM_STRESS, MIN_OFFSET_SQUARE, TENSION_STIFFNESS};

/// The energy terms at each node of a row.
pub struct Terms<V> {
    /// The sum over the node's eight edges and twelve corners, and of the hold.
    pub energy: V,
    /// The energy of the hold at an open border.
    pub hold: V,
    /// The terms of the edges to the eight neighbours.
    pub edges: [V; 8],
    /// J of the twelve corners and its gradient in the node: three corners for each of the four cells.
    pub corners: [(V, [V; 2]); 12],
}

/// The energy at each node of a row, its gradient and its Gauss-Newton matrix (halves of the derivatives).
pub struct QuadraticModel<V> {
    pub terms: Terms<V>,
    pub gradient: [V; 2],
    /// The entries (xx, xy, yy).
    pub matrix: [V; 3],
}

/// Receives the edges of a row's nodes: the neighbour's index, the edge, ∂L/∂u of the node, the terms from which
/// `Surface::far_gradient` computes ∂L/∂u of the neighbour, and the stress stiffness.
pub trait Visitor<V: Lanes> {
    fn edge<S: Surface>(
        &mut self,
        row: Row,
        k: usize,
        edge: &Edge<V>,
        near: &[V; 2],
        terms: &GradientTerms<V>,
        stress: V,
    );
}

/// Ignores the edges.
impl<V: Lanes> Visitor<V> for () {
    #[inline(always)]
    fn edge<S: Surface>(&mut self, _: Row, _: usize, _: &Edge<V>, _: &[V; 2], _: &GradientTerms<V>, _: V) {}
}

impl Patch {
    /// The edges from a row's nodes `p` to their neighbours `k`.
    #[inline(always)]
    pub fn edge<V: Lanes>(&self, row: Row, p: &NodeState<V>, k: usize) -> Edge<V> {
        let (di, dj, e, neighbour_owns) = NEIGHBOURS[k];
        // Offset from the node to the edge's owner.
        let (oi, oj) = if neighbour_owns { (di, dj) } else { (0, 0) };
        let weight = row.near::<V>(&self.rigidity, 0, 0).max(row.near(&self.rigidity, di, dj));
        Edge {
            value: each!([0, 1, 2], |c| row.near(&self.value[c], di, dj)),
            same_triangle: V::index_eq(row.near_index::<V>(&self.triangle, di, dj), p.samples.triangle),
            d: row.offset(&self.u, &p.u, di, dj),
            rest_length: row.near(&self.length[e], oi, oj),
            inverse_length: row.near(&self.inverse_length[e], oi, oj),
            weight,
            density: if self.has_density {
                (row.near::<V>(&self.density, 0, 0) + row.near::<V>(&self.density, di, dj)) * 0.5
            } else {
                V::zero()
            },
            inverse_rest_square: 1.0 / (di * di + dj * dj) as f32,
            normal: [-dj as f32, di as f32],
        }
    }

    /// The energy of the pull in an edge with the offset d, θ |d - d'|² / |d0|², where d' is that of the previous
    /// result, and its contribution to the gradient at the node.
    #[inline(always)]
    pub fn pull<V: Lanes>(&self, row: Row, d: &[V; 2], k: usize, weights: &Weights) -> (V, [V; 2]) {
        let (di, dj, ..) = NEIGHBOURS[k];
        let stiffness = pull_stiffness(k, weights);
        let here = each!([0, 1], |c| row.near::<V>(&self.anchor[c], 0, 0));
        let before = row.offset(&self.anchor, &here, di, dj);
        let change = each!([0, 1], |c| d[c] - before[c]);
        let energy = (change[0] * change[0] + change[1] * change[1]) * stiffness;
        (energy, each!([0, 1], |c| -(change[c] * stiffness)))
    }

    /// True if an edge at one of a row's nodes has a weight above 0, or the energy has an orientation term.
    /// Otherwise smoothness is the only edge term.
    #[inline(always)]
    pub fn has_stiff_edges<V: Lanes>(&self, row: Row, weights: &Weights) -> bool {
        if weights.orients() {
            return true;
        }
        let mut most = row.near::<V>(&self.rigidity, 0, 0);
        for &(di, dj, ..) in &NEIGHBOURS {
            most = most.max(row.near(&self.rigidity, di, dj));
        }
        V::zero().lt(most).any()
    }

    /// The energy terms of a row's nodes. `stiff` is the result of `has_stiff_edges`.
    #[inline(always)]
    pub fn terms<V: Lanes, S: Surface>(
        &self,
        row: Row,
        p: &NodeState<V>,
        weights: &Weights,
        stiff: bool,
    ) -> Terms<V> {
        if !stiff {
            return self.smoothness_model(row, p, weights).terms;
        }
        let edges = each!([0, 1, 2, 3, 4, 5, 6, 7], |k| {
            let edge = self.edge(row, p, k);
            let length =
                S::length(&p.samples.value, &p.samples.tangents, &edge.value, edge.same_triangle, &edge.d);
            let mut energy = edge.energy(k, length, weights);
            if weights.pull > 0.0 {
                energy += self.pull(row, &edge.d, k, weights).0;
            }
            energy
        });
        self.with_corners(row, p, edges, weights)
    }

    /// Sums the energy of the edges and of the corners.
    #[inline(always)]
    fn with_corners<V: Lanes>(
        &self,
        row: Row,
        p: &NodeState<V>,
        edges: [V; 8],
        weights: &Weights,
    ) -> Terms<V> {
        let mut energy = V::zero();
        for edge in edges {
            energy += edge;
        }
        let mut hold = V::zero();
        if self.has_hold {
            let (_, moved) = self.moved_across(row, p);
            hold = moved * moved;
        }
        energy += hold;
        let corners = self.corners(row, p);
        if least_jacobian(&corners).lt(V::splat(weights.room_threshold)).any() {
            for corner in &corners {
                energy += room_energy(corner.0, weights);
            }
        }
        Terms { energy, hold, edges, corners }
    }

    /// The quadratic model of a row's nodes. `stiff` is the result of `has_stiff_edges`; if it is true, `visitor`
    /// receives the edges.
    #[inline(always)]
    pub fn quadratic_model<V: Lanes, S: Surface>(
        &self,
        row: Row,
        p: &NodeState<V>,
        slopes: &Slopes<V>,
        weights: &Weights,
        stiff: bool,
        visitor: &mut impl Visitor<V>,
    ) -> QuadraticModel<V> {
        if !stiff {
            return self.smoothness_model(row, p, weights);
        }
        let mut edges = [V::zero(); 8];
        let mut gradient = [V::zero(); 2];
        let mut matrix = [V::zero(); 3];
        each!([0, 1, 2, 3, 4, 5, 6, 7], |k| {
            let edge = self.edge(row, p, k);
            let (value, tangents) = (&p.samples.value, &p.samples.tangents);
            let (length, near, gradient_terms) =
                S::gradient(value, tangents, slopes, &edge.value, edge.same_triangle, &edge.d);
            let stress = edge.stress_stiffness(length);
            visitor.edge::<S>(row, k, &edge, &near, &gradient_terms, stress);
            edges[k] = edge.energy(k, length, weights);
            let scaled = edge.weight * edge.inverse_length;
            let pull = scaled * ((length - edge.rest_length) * edge.inverse_length);
            let stiffness = scaled * edge.inverse_length;
            let smooth = edge.smoothness(weights);
            let change = edge.offset_change(k);
            for c in 0..2 {
                gradient[c] += pull * near[c] - smooth * change[c];
            }
            let isotropic = smooth + stress;
            matrix[0] += stiffness * near[0] * near[0] + isotropic;
            matrix[1] += stiffness * near[0] * near[1];
            matrix[2] += stiffness * near[1] * near[1] + isotropic;
            if weights.orients() {
                let [nx, ny] = edge.normal;
                let kappa = edge.orientation(weights);
                let normal_offset = edge.normal_offset() * kappa;
                gradient[0] -= normal_offset * nx;
                gradient[1] -= normal_offset * ny;
                matrix[0] += kappa * (nx * nx);
                matrix[1] += kappa * (nx * ny);
                matrix[2] += kappa * (ny * ny);
            }
            if weights.pull > 0.0 {
                let (energy, force) = self.pull(row, &edge.d, k, weights);
                edges[k] += energy;
                for c in 0..2 {
                    gradient[c] += force[c];
                    matrix[2 * c] += V::splat(pull_stiffness(k, weights));
                }
            }
        });
        self.with_room(row, p, edges, gradient, matrix, weights)
    }

    /// The quadratic model if smoothness is the only edge term.
    #[inline(always)]
    fn smoothness_model<V: Lanes>(&self, row: Row, p: &NodeState<V>, weights: &Weights) -> QuadraticModel<V> {
        let mut edges = [V::zero(); 8];
        let mut gradient = [V::zero(); 2];
        let mut matrix = [V::zero(); 3];
        each!([0, 1, 2, 3, 4, 5, 6, 7], |k| {
            let (di, dj, ..) = NEIGHBOURS[k];
            let inverse_rest_square = 1.0 / (di * di + dj * dj) as f32;
            let smooth = V::splat((weights.smoothness + weights.smoothness_floor) * inverse_rest_square);
            let d = row.offset(&self.u, &p.u, di, dj);
            let change = [d[0] - V::splat(di as f32), d[1] - V::splat(dj as f32)];
            edges[k] = smooth * (change[0] * change[0] + change[1] * change[1]);
            gradient[0] -= smooth * change[0];
            gradient[1] -= smooth * change[1];
            matrix[0] += smooth;
            matrix[2] += smooth;
            if weights.pull > 0.0 {
                let (energy, force) = self.pull(row, &d, k, weights);
                edges[k] += energy;
                for c in 0..2 {
                    gradient[c] += force[c];
                    matrix[2 * c] += V::splat(pull_stiffness(k, weights));
                }
            }
        });
        self.with_room(row, p, edges, gradient, matrix, weights)
    }

    /// The direction across the border at a row's nodes, with the root of the hold's weight, and the displacement along
    /// it.
    #[inline(always)]
    pub fn moved_across<V: Lanes>(&self, row: Row, p: &NodeState<V>) -> ([V; 2], V) {
        let across = each!([0, 1], |c| V::load(&self.hold[c], row.slot()));
        (across, across[0] * p.u[0] + across[1] * p.u[1])
    }

    /// Completes a quadratic model: adds hold and room term to the edges' gradient and matrix, and sums the energy.
    #[inline(always)]
    fn with_room<V: Lanes>(
        &self,
        row: Row,
        p: &NodeState<V>,
        edges: [V; 8],
        mut gradient: [V; 2],
        mut matrix: [V; 3],
        weights: &Weights,
    ) -> QuadraticModel<V> {
        let terms = self.with_corners(row, p, edges, weights);
        if self.has_hold {
            let ([x, y], moved) = self.moved_across(row, p);
            gradient[0] += x * moved;
            gradient[1] += y * moved;
            matrix[0] += x * x;
            matrix[1] += x * y;
            matrix[2] += y * y;
        }
        if least_jacobian(&terms.corners).lt(V::splat(weights.room_threshold)).any() {
            for (jacobian, corner_gradient) in &terms.corners {
                let lack = (V::splat(weights.room_threshold) - *jacobian).max(V::zero());
                let active = jacobian.lt(V::splat(weights.room_threshold));
                let beta = active.select(V::splat(weights.room), V::zero());
                let pull = lack * weights.room;
                gradient[0] -= pull * corner_gradient[0];
                gradient[1] -= pull * corner_gradient[1];
                matrix[0] += beta * corner_gradient[0] * corner_gradient[0];
                matrix[1] += beta * corner_gradient[0] * corner_gradient[1];
                matrix[2] += beta * corner_gradient[1] * corner_gradient[1];
            }
        }
        QuadraticModel { terms, gradient, matrix }
    }

    /// The twelve corner Jacobians that depend on each node of a row, with their gradients in the node. For each of the
    /// four cells: the corner at the node, at its neighbour along x, and at its neighbour along y.
    #[inline(always)]
    pub fn corners<V: Lanes>(&self, row: Row, p: &NodeState<V>) -> [(V, [V; 2]); 12] {
        let mut corners = [(V::zero(), [V::zero(); 2]); 12];
        for (q, &(sx, sy)) in QUADRANTS.iter().enumerate() {
            let (a, b) = (row.offset(&self.u, &p.u, sx, 0), row.offset(&self.u, &p.u, 0, sy));
            let c = row.offset(&self.u, &p.u, sx, sy);
            let sign = (sx * sy) as f32;
            corners[3 * q] = corner_jacobian(&a, &b, sign);
            corners[3 * q + 1] = corner_jacobian(&a, &c, sign);
            corners[3 * q + 2] = corner_jacobian(&c, &b, sign);
        }
        corners
    }
}

/// θ / |d0|² of the edge to neighbour `k`.
#[inline(always)]
pub fn pull_stiffness(k: usize, weights: &Weights) -> f32 {
    let (di, dj, ..) = NEIGHBOURS[k];
    weights.pull / (di * di + dj * dj) as f32
}

/// J of a corner and its gradient in the corner's node, from the offsets a and b to the neighbours.
#[inline(always)]
fn corner_jacobian<V: Lanes>(a: &[V; 2], b: &[V; 2], sign: f32) -> (V, [V; 2]) {
    let jacobian = (a[0] * b[1] - a[1] * b[0]) * sign;
    (jacobian, [(a[1] - b[1]) * sign, (b[0] - a[0]) * sign])
}

/// The minimum of 1 and the twelve corner Jacobians, lane by lane.
#[inline(always)]
pub fn least_jacobian<V: Lanes>(corners: &[(V, [V; 2]); 12]) -> V {
    let mut low = V::one();
    for corner in corners {
        low = corner.0.min(low);
    }
    low
}

/// The room term of a corner: β max(0, τ - J)².
#[inline(always)]
pub fn room_energy<V: Lanes>(jacobian: V, weights: &Weights) -> V {
    let lack = (V::splat(weights.room_threshold) - jacobian).max(V::zero());
    lack * lack * weights.room
}

/// The edges from a row's nodes to their neighbours in one direction.
pub struct Edge<V: Lanes> {
    /// The neighbours' sampled values.
    pub value: [V; 3],
    /// True where both ends lie on one triangle.
    pub same_triangle: V::Mask,
    /// Offset d in the plane, in cells.
    pub d: [V; 2],
    /// Rest length l.
    pub rest_length: V,
    /// 1 / max(l, floor).
    pub inverse_length: V,
    /// Weight w.
    pub weight: V,
    /// Mean density of both ends.
    pub density: V,
    /// 1 / |d0|².
    pub inverse_rest_square: f32,
    /// d0 rotated by 90 degrees, with the length |d0|.
    pub normal: [f32; 2],
}

impl<V: Lanes> Edge<V> {
    /// Stiffness of the smoothness term: (λ max(0, 1-w) + λ0) / |d0|².
    #[inline(always)]
    pub fn smoothness(&self, weights: &Weights) -> V {
        ((V::one() - self.weight).max(V::zero()) * weights.smoothness + weights.smoothness_floor)
            * self.inverse_rest_square
    }

    /// `smoothness` of an edge whose weight is 0.
    #[inline(always)]
    pub fn elastic_smoothness(&self, weights: &Weights) -> f32 {
        (weights.smoothness + weights.smoothness_floor) * self.inverse_rest_square
    }

    /// The stress stiffness of the edge (method §4, Derivatives). `length` is L.
    #[inline(always)]
    pub fn stress_stiffness(&self, length: V) -> V {
        let strain = (length - self.rest_length) * self.inverse_length;
        let size = (strain * TENSION_STIFFNESS).max(strain * -COMPRESSION_STIFFNESS);
        let square = self.d[0] * self.d[0] + self.d[1] * self.d[1];
        let square = square.max(V::splat(MIN_OFFSET_SQUARE / self.inverse_rest_square));
        let added = (self.weight - V::one()).max(V::zero());
        let weight = self.weight + added * (HARM_STRESS - 1.0);
        weight * size * (length * self.inverse_length) / square
    }

    /// Stiffness of the orientation term: κ / |d0|⁴, where κ is the mean of both ends. One factor |d0|² comes from the
    /// term, the other from the lengths of the two normals in a product.
    #[inline(always)]
    pub fn orientation(&self, weights: &Weights) -> V {
        (self.density * weights.orientation_density + V::splat(weights.orientation))
            * (self.inverse_rest_square * self.inverse_rest_square)
    }

    /// The change d - d0 of the offset.
    #[inline(always)]
    pub fn offset_change(&self, k: usize) -> [V; 2] {
        each!([0, 1], |c| {
            let rest = if c == 0 { NEIGHBOURS[k].0 } else { NEIGHBOURS[k].1 };
            self.d[c] - V::splat(rest as f32)
        })
    }

    /// `normal`·d, which is |d0| times the component of d across d0.
    #[inline(always)]
    pub fn normal_offset(&self) -> V {
        self.d[0] * self.normal[0] + self.d[1] * self.normal[1]
    }

    /// The edge's energy: distortion, smoothness and orientation. `length` is L.
    #[inline(always)]
    pub fn energy(&self, k: usize, length: V, weights: &Weights) -> V {
        let strain = (length - self.rest_length) * self.inverse_length;
        let change = self.offset_change(k);
        let mut energy = self.weight * strain * strain
            + self.smoothness(weights) * (change[0] * change[0] + change[1] * change[1]);
        if weights.orients() {
            let normal_offset = self.normal_offset();
            energy += normal_offset * normal_offset * self.orientation(weights);
        }
        energy
    }
}
