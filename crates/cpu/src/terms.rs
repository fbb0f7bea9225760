//! The energy of the edges and corners at one row of eight nodes, with its gradient and Gauss-Newton matrix (halves of
//! the derivatives), from the displacements, samples, rigidities and rest lengths of a patch (method §4).
//!
//! Notation: d are the offsets from a row's nodes to their neighbours, in the order of `NEIGHBOURS`, and k is the index
//! of a neighbour. J is a corner's Jacobian. δ is a step of the nodes alone. Terms that few inputs have are summed in
//! loops of their own, which need not be quick.

use super::lanes::{Lanes, Mask, each};
use super::patch::{NodeState, Patch, Weights};
use super::row::{NEIGHBOURS, Offsets, Row};
use super::sampling::{GradientTerms, Slopes, Surface};
use vrtm_core::method::law::{COMPRESSION_STIFFNESS, HARM_STRESS, MIN_OFFSET_SQUARE, TENSION_STIFFNESS};

/// The twelve corners with a Jacobian that depends on a node: J = d_a x d_b for these neighbours a and b.
pub const CORNERS: [(usize, usize); 12] =
    [(0, 1), (0, 2), (2, 1), (1, 4), (3, 4), (1, 3), (5, 0), (7, 0), (5, 7), (4, 5), (4, 6), (6, 5)];

/// The energy E at each node of a row as a function of its step: E + 2 γ·δ + δᵀHδ.
#[derive(Clone, Copy)]
pub struct Model<V> {
    /// The node's part of E: the energy of each edge and corner is divided evenly among its movable nodes.
    pub energy: V,
    /// γ.
    pub gradient: [V; 2],
    /// The entries (xx, xy, yy) of H.
    pub matrix: [V; 3],
}

impl<V: Lanes> Model<V> {
    #[inline(always)]
    pub fn zero() -> Model<V> {
        let zero = V::zero();
        Model { energy: zero, gradient: [zero; 2], matrix: [zero; 3] }
    }

    /// Adds an energy; `part` is the node's part of it.
    #[inline(always)]
    fn add_energy(&mut self, energy: V, part: V) {
        self.energy += part * energy;
    }

    /// Adds the distortion of an edge, of whose energy `part` is the node's.
    #[inline(always)]
    pub fn add_edge(&mut self, edge: &EdgeModel<V>, part: V) {
        let &EdgeModel { energy, near: [x, y], pull, stiffness, stress, .. } = edge;
        self.add_energy(energy, part);
        self.add_direction([x, y], pull, stiffness);
        self.matrix[0] += stress;
        self.matrix[2] += stress;
    }

    /// Adds pull times g to the gradient, and stiffness times g gᵀ to the matrix.
    #[inline(always)]
    pub fn add_direction(&mut self, g: [V; 2], pull: V, stiffness: V) {
        let [x, y] = each!([0, 1], |c| stiffness * g[c]);
        self.gradient = each!([0, 1], |c| self.gradient[c] + pull * g[c]);
        self.matrix[0] += x * g[0];
        self.matrix[1] += x * g[1];
        self.matrix[2] += y * g[1];
    }
}

/// The edges from a row's nodes to their neighbours in one direction.
pub struct Edge<V: Lanes> {
    /// The neighbours' sampled values.
    value: [V; 3],
    /// True where both ends lie on one triangle.
    same_triangle: V::Mask,
    /// Rest length l.
    rest_length: V,
    /// 1 / max(l, floor).
    inverse_length: V,
    /// Weight w.
    weight: V,
}

/// The distortion of one edge at each node of a row: w ((L - l) / max(l, floor))², with its derivatives.
pub struct EdgeModel<V> {
    energy: V,
    /// ∂L/∂u of the node, and the terms from which `Surface::far_gradient` computes ∂L/∂u of the neighbour.
    pub near: [V; 2],
    pub terms: GradientTerms<V>,
    /// Half of ∂energy/∂L.
    pull: V,
    /// w / max(l, floor)².
    pub stiffness: V,
    /// The stress stiffness (method §4, Derivatives).
    pub stress: V,
}

impl Patch {
    /// The weights w of the edges to neighbours `k`.
    #[inline(always)]
    fn weight<V: Lanes>(&self, row: Row, k: usize) -> V {
        row.near::<V>(&self.rigidity, 0, 0).max(row.near(&self.rigidity, NEIGHBOURS[k].0, NEIGHBOURS[k].1))
    }

    /// A node's part of the energy of its edges to neighbours `k`: half if the neighbour is movable, too.
    #[inline(always)]
    pub fn part<V: Lanes>(&self, row: Row, k: usize) -> V {
        V::one() - self.movable_near::<V>(row, k) * 0.5
    }

    /// Stiffness of the smoothness term of the edges to neighbours `k`: (λ max(0, 1-w) + λ0) / |d0|².
    #[inline(always)]
    pub fn smoothness<V: Lanes>(&self, row: Row, k: usize, weights: &Weights) -> V {
        let elastic = (V::one() - self.weight::<V>(row, k)).max(V::zero());
        (elastic * weights.smoothness + weights.smoothness_floor) * (1.0 / rest_square(k))
    }

    /// Stiffness of the orientation term: κ / |d0|⁴, where κ is the mean of both ends. One factor |d0|² comes from the
    /// term, the other from the lengths of the two normals in a product.
    #[inline(always)]
    pub fn orientation<V: Lanes>(&self, row: Row, k: usize, weights: &Weights) -> V {
        let (di, dj, ..) = NEIGHBOURS[k];
        let density = if self.has_density {
            (row.near::<V>(&self.density, 0, 0) + row.near::<V>(&self.density, di, dj)) * 0.5
        } else {
            V::zero()
        };
        (density * weights.orientation_density + V::splat(weights.orientation))
            * (1.0 / (rest_square(k) * rest_square(k)))
    }

    /// The terms of a row's edges that are quadratic in the displacements, smoothness, orientation and pull, and the
    /// hold: for elastic nodes all but the corners'.
    #[inline(always)]
    pub fn elastic_model<V: Lanes>(
        &self,
        row: Row,
        u: &[V; 2],
        d: &Offsets<V>,
        weights: &Weights,
    ) -> Model<V> {
        let (zero, mut model) = (V::zero(), Model::zero());
        let mut sum = zero;
        each!([0, 1, 2, 3, 4, 5, 6, 7], |k| {
            let smooth = self.smoothness::<V>(row, k, weights);
            let change =
                [d[k][0] - V::splat(NEIGHBOURS[k].0 as f32), d[k][1] - V::splat(NEIGHBOURS[k].1 as f32)];
            let force = each!([0, 1], |c| smooth * change[c]);
            model.add_energy(force[0] * change[0] + force[1] * change[1], self.part(row, k));
            model.gradient = each!([0, 1], |c| model.gradient[c] - force[c]);
            sum += smooth;
        });
        model.matrix = [sum, zero, sum];
        if weights.orients() {
            for (k, &d) in d.iter().enumerate() {
                // d0 rotated by 90 degrees, with the length |d0|.
                let [nx, ny] = normal(k);
                let kappa = self.orientation::<V>(row, k, weights);
                let across = d[0] * nx + d[1] * ny;
                model.add_energy(across * across * kappa, self.part(row, k));
                model.add_direction([V::splat(nx), V::splat(ny)], -(across * kappa), kappa);
            }
        }
        if weights.pull > 0.0 {
            // θ |d - d'|² / |d0|², where d' is that of the previous result.
            let here = each!([0, 1], |c| row.near::<V>(&self.anchor[c], 0, 0));
            for (k, &d) in d.iter().enumerate() {
                let stiffness = V::splat(pull_stiffness(k, weights));
                let before = row.offset(&self.anchor, &here, NEIGHBOURS[k].0, NEIGHBOURS[k].1);
                let [x, y] = each!([0, 1], |c| d[c] - before[c]);
                model.add_energy((x * x + y * y) * stiffness, self.part(row, k));
                model.add_direction([V::one(), zero], -(x * stiffness), stiffness);
                model.add_direction([zero, V::one()], -(y * stiffness), stiffness);
            }
        }
        if self.has_hold {
            // The direction across the border, with the root of the hold's weight, and the displacement along it.
            let across = each!([0, 1], |c| V::load(&self.hold[c], row.slot()));
            let moved = across[0] * u[0] + across[1] * u[1];
            model.add_energy(moved * moved, V::one());
            model.add_direction(across, moved, V::one());
        }
        model
    }

    /// True if an edge at one of a row's nodes has a weight above 0.
    #[inline(always)]
    pub fn has_stiff_edges<V: Lanes>(&self, row: Row) -> bool {
        let most = each!([0, 1, 2, 3, 4, 5, 6, 7], |k| self.weight::<V>(row, k));
        let most = each!([0, 1, 2, 3], |k| most[k].max(most[k + 4]));
        V::zero().lt(most[0].max(most[1]).max(most[2].max(most[3]))).any()
    }

    #[inline(always)]
    fn edge<V: Lanes>(&self, row: Row, p: &NodeState<V>, k: usize) -> Edge<V> {
        let (di, dj, e, neighbour_owns) = NEIGHBOURS[k];
        // Offset from the node to the edge's owner.
        let (oi, oj) = if neighbour_owns { (di, dj) } else { (0, 0) };
        Edge {
            value: each!([0, 1, 2], |c| row.near(&self.value[c], di, dj)),
            same_triangle: V::index_eq(row.near_index::<V>(&self.triangle, di, dj), p.samples.triangle),
            rest_length: row.near(&self.length[e], oi, oj),
            inverse_length: row.near(&self.inverse_length[e], oi, oj),
            weight: self.weight(row, k),
        }
    }

    /// The distortion of the edges to neighbours `k`.
    #[inline(always)]
    pub fn edge_energy<V: Lanes, S: Surface>(
        &self,
        row: Row,
        p: &NodeState<V>,
        d: &Offsets<V>,
        k: usize,
    ) -> V {
        let edge = self.edge(row, p, k);
        let length = S::length(&p.samples.value, &p.samples.tangents, &edge.value, edge.same_triangle, &d[k]);
        let strain = (length - edge.rest_length) * edge.inverse_length;
        edge.weight * strain * strain
    }

    /// The distortion of the edges to neighbours `k`, with its derivatives.
    #[inline(always)]
    pub fn edge_model<V: Lanes, S: Surface>(
        &self,
        row: Row,
        p: &NodeState<V>,
        d: &Offsets<V>,
        slopes: &Slopes<V>,
        k: usize,
    ) -> EdgeModel<V> {
        let edge = self.edge(row, p, k);
        let (value, tangents) = (&p.samples.value, &p.samples.tangents);
        let (length, near, terms) =
            S::gradient(value, tangents, slopes, &edge.value, edge.same_triangle, &d[k]);
        let strain = (length - edge.rest_length) * edge.inverse_length;
        let scaled = edge.weight * edge.inverse_length;
        let weighed = edge.weight * strain;
        let size = (strain * TENSION_STIFFNESS).max(strain * -COMPRESSION_STIFFNESS);
        let square =
            (d[k][0] * d[k][0] + d[k][1] * d[k][1]).max(V::splat(MIN_OFFSET_SQUARE * rest_square(k)));
        let added = (edge.weight - V::one()).max(V::zero());
        let stress_weight = edge.weight + added * (HARM_STRESS - 1.0);
        EdgeModel {
            energy: weighed * strain,
            near,
            terms,
            pull: scaled * strain,
            stiffness: scaled * edge.inverse_length,
            stress: stress_weight * size * (length * edge.inverse_length) / square,
        }
    }

    /// Adds the room terms of a row's corners.
    #[inline(always)]
    pub fn add_room<V: Lanes>(&self, row: Row, d: &Offsets<V>, weights: &Weights, model: &mut Model<V>) {
        for (a, b) in CORNERS {
            let jacobian = cross(&d[a], &d[b]);
            let lack = (V::splat(weights.room_threshold) - jacobian).max(V::zero());
            let active = jacobian.lt(V::splat(weights.room_threshold));
            let movable = self.movable_near::<V>(row, a) + self.movable_near::<V>(row, b) + 1.0;
            model.add_energy(lack * lack * weights.room, V::one() / movable);
            let beta = active.select(V::splat(weights.room), V::zero());
            model.add_direction(corner_gradient(&d[a], &d[b]), -(lack * weights.room), beta);
        }
    }
}

/// Stiffness of the smoothness term and of the pull of the edges of elastic nodes to neighbours `k`.
pub fn elastic_stiffness(k: usize, weights: &Weights) -> f32 {
    (weights.smoothness + weights.smoothness_floor + weights.pull) / rest_square(k)
}

/// |d0|² of the edge to neighbour `k`.
#[inline(always)]
fn rest_square(k: usize) -> f32 {
    let (di, dj, ..) = NEIGHBOURS[k];
    (di * di + dj * dj) as f32
}

/// d0 of the edge to neighbour `k` rotated by 90 degrees, with the length |d0|.
#[inline(always)]
pub fn normal(k: usize) -> [f32; 2] {
    [-NEIGHBOURS[k].1 as f32, NEIGHBOURS[k].0 as f32]
}

/// θ / |d0|² of the edge to neighbour `k`.
#[inline(always)]
pub fn pull_stiffness(k: usize, weights: &Weights) -> f32 {
    weights.pull / rest_square(k)
}

/// a x b.
#[inline(always)]
pub fn cross<V: Lanes>(a: &[V; 2], b: &[V; 2]) -> V {
    a[0] * b[1] - a[1] * b[0]
}

/// The gradient in a node of J = a x b, where a and b are offsets from the node.
#[inline(always)]
pub fn corner_gradient<V: Lanes>(a: &[V; 2], b: &[V; 2]) -> [V; 2] {
    [a[1] - b[1], b[0] - a[0]]
}

/// The minimum of 1 and the twelve corner Jacobians, lane by lane.
#[inline(always)]
pub fn least_jacobian<V: Lanes>(d: &Offsets<V>) -> V {
    let mut low = V::one();
    each!([0, 1, 2, 3, 4, 5, 6, 7, 8, 9, 10, 11], |k| {
        low = cross(&d[CORNERS[k].0], &d[CORNERS[k].1]).min(low);
    });
    low
}
