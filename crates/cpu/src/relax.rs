//! relax: descent node by node (method §6). With its neighbours fixed, each node takes its 2x2 Gauss-Newton step,
//! limited so that no corner Jacobian falls below ε; the step is kept if the node's energy does not rise.
//!
//! Blocks of one block colour (x & 1, y & 1) do not touch. They are relaxed in parallel, each with its four node
//! colours in turn and with its halo frozen, so the bits do not depend on the order of the blocks. Gathering a block
//! takes a third of the time of a sweep; therefore two sweeps are done on a gathered block.

use vrtm_core::method::law::{MAX_NODE_STEP, MIN_JACOBIAN, MIN_RELATIVE_GAIN, SWEPT_MARGIN, passes};

use super::buffers::State;
use super::lanes::{LANES, Lanes, Mask, Vectorised, dispatch, each};
use super::patch::{NEIGHBOURS, NodeState, Patch, Source, Weights};
use super::row::{ROWS, Row};
use super::run::{Run, SurfaceFn};
use super::sampling::{GridRow, Surface};
use super::terms::{self, pull_stiffness};

impl Run<'_> {
    /// Relaxes a level. `fraction` is the step fraction per chart (1 if absent).
    pub(super) fn relax_level(&mut self, level: usize, sweeps: u32, fraction: Option<&[f32]>) {
        self.count_updates(level, sweeps);
        self.with_surface(level, Relax { level, sweeps, fraction });
    }
}

/// Sweeps over all active blocks of a level.
pub struct Relax<'a> {
    pub level: usize,
    pub sweeps: u32,
    /// Step fraction per chart (1 if absent). Sweeps after a partial correction use the same fraction, so that both
    /// fade in together.
    pub fraction: Option<&'a [f32]>,
}

impl SurfaceFn<()> for Relax<'_> {
    fn call<S: Surface>(self, run: &Run, state: State, surface: S) {
        let level = &run.grid.levels[self.level];
        for sweeps in passes(self.sweeps) {
            // Blocks of one colour do not touch.
            for blocks in &run.work[self.level].colours {
                let next = |b| Patch::prefetch_next(level, state, b);
                run.each_of(blocks, next, |worker, _, b| {
                    let source = run.source(self.level, state, surface, b);
                    let fraction =
                        self.fraction.map_or(1.0, |fraction| fraction[level.blocks.list[b].chart as usize]);
                    run.patches
                        .with(worker, |patch| dispatch(RelaxBlock { patch, source, sweeps, fraction }));
                });
            }
        }
    }
}

/// Does some sweeps over a block with its halo frozen. No other item may access this block, or write to its neighbour
/// blocks, meanwhile.
struct RelaxBlock<'a, S> {
    patch: &'a mut Patch,
    source: Source<'a, S>,
    sweeps: u32,
    fraction: f32,
}

impl<S: Surface> Vectorised for RelaxBlock<'_, S> {
    type Output = ();

    #[inline(always)]
    fn run<V: Lanes>(self) {
        let RelaxBlock { patch, source, sweeps, fraction } = self;
        // SAFETY: no other item accesses the block, or writes to its neighbour blocks.
        unsafe { patch.load::<V, S>(&source) };
        let mut stiff = [false; ROWS];
        for (row, stiff) in Row::all().zip(&mut stiff) {
            *stiff = patch.has_stiff_edges::<V>(row, source.weights);
        }
        for _ in 0..sweeps {
            for (row, stiff) in Row::all().zip(stiff) {
                step::<V, S>(patch, &source, row, stiff, fraction);
            }
        }
        // SAFETY: no other item accesses the block.
        unsafe { store::<S>(patch, source.state, source.b) };
    }
}

/// Writes the nodes of block `b` back to the state.
///
/// # Safety
/// No other item accesses this block meanwhile.
#[inline(always)]
unsafe fn store<S: Surface>(patch: &Patch, state: State, b: usize) {
    // SAFETY: promised by the caller.
    let (u, value) = unsafe { (state.u.get_mut(b), state.value.get_mut(b)) };
    for row in Row::all() {
        let (at, s) = (row.at(0, 0), row.slot());
        for c in 0..2 {
            u[c][s..s + LANES].copy_from_slice(&patch.u[c][at..at + LANES]);
        }
        for c in 0..3 {
            value[c][s..s + LANES].copy_from_slice(&patch.value[c][at..at + LANES]);
        }
    }
    if S::CHORDS {
        // SAFETY: promised by the caller.
        let triangle = unsafe { state.triangle.get_mut(b) };
        for row in Row::all() {
            let (at, s) = (row.at(0, 0), row.slot());
            triangle[s..s + LANES].copy_from_slice(&patch.triangle[at..at + LANES]);
        }
    }
}

/// Relaxes the nodes of one row. Their steps are multiplied by `fraction`.
#[inline(always)]
fn step<V: Lanes, S: Surface>(patch: &mut Patch, source: &Source<S>, row: Row, stiff: bool, fraction: f32) {
    let &Source { level, surface, weights, b, .. } = source;
    let mut lanes = patch.movable_lanes::<V>(row);
    if !lanes.any() {
        return;
    }
    let here = patch.node_state::<V>(row);
    let model = Model::new::<S>(patch, row, &here, weights, stiff);
    let delta = model.newton_step();
    let predicted = -(model.gradient[0] * delta[0] + model.gradient[1] * delta[1]);
    let energy = model.distortion + model.room + model.spring.energy;
    lanes = lanes.and((energy * MIN_RELATIVE_GAIN).lt(predicted));
    if !lanes.any() {
        return;
    }
    let delta = each!([0, 1], |c| lanes.select(delta[c] * fraction, V::zero()));
    let u = each!([0, 1], |c| here.u[c] + delta[c]);
    let mut trial = NodeState { u, samples: here.samples };
    let found = surface.sample_row(&GridRow::new(level, b, row), &u, lanes, &mut trial.samples);
    // The springs' energy changes by a known amount; the rest is computed anew.
    let room = room_energy(&model.jacobians_after(&delta), weights);
    let distortion = if stiff { distortion::<V, S>(patch, row, &trial) } else { V::zero() };
    let after = distortion + room + model.spring.change(&delta);
    // An infinite energy is never accepted, although `le` is true for two infinite energies.
    let lower = after.le(model.distortion + model.room).and(after.lt(V::splat(f32::INFINITY)));
    patch.accept::<V, S>(row, found.and(lower), &trial);
}

/// The offsets of the ends of the twelve corners that depend on a node, as indices in `NEIGHBOURS`, counterclockwise, so
/// that J = a x b.
const CORNERS: [(usize, usize); 12] =
    [(0, 1), (0, 2), (2, 1), (1, 4), (1, 3), (3, 4), (4, 5), (4, 6), (6, 5), (5, 0), (5, 7), (7, 0)];

/// The terms of the energy that are quadratic in the node's displacement: smoothness, orientation, pull and hold.
struct Spring<V> {
    energy: V,
    /// Half of the derivative.
    gradient: [V; 2],
    /// Half of the second derivative: (xx, xy, yy).
    matrix: [V; 3],
}

impl<V: Lanes> Spring<V> {
    /// The change of the energy if the node moves by (x, y).
    #[inline(always)]
    fn change(&self, [x, y]: &[V; 2]) -> V {
        let [xx, xy, yy] = self.matrix;
        let along = [self.gradient[0] + self.gradient[0], self.gradient[1] + self.gradient[1]];
        *x * (along[0] + xx * *x + xy * *y) + *y * (along[1] + xy * *x + yy * *y)
    }
}

/// The energy at each node of a row, its gradient and its Gauss-Newton matrix (halves of the derivatives).
struct Model<V> {
    distortion: V,
    room: V,
    spring: Spring<V>,
    gradient: [V; 2],
    /// The entries (xx, xy, yy).
    matrix: [V; 3],
    /// Offsets to the eight neighbours.
    offsets: [[V; 2]; 8],
    /// J of the twelve corners.
    jacobians: [V; 12],
}

impl<V: Lanes> Model<V> {
    /// `stiff` is the result of `has_stiff_edges`.
    #[inline(always)]
    fn new<S: Surface>(
        patch: &Patch,
        row: Row,
        p: &NodeState<V>,
        weights: &Weights,
        stiff: bool,
    ) -> Model<V> {
        let offsets = each!([0, 1, 2, 3, 4, 5, 6, 7], |k| {
            row.offset(&patch.u, &p.u, NEIGHBOURS[k].0, NEIGHBOURS[k].1)
        });
        let jacobians = each!([0, 1, 2, 3, 4, 5, 6, 7, 8, 9, 10, 11], |n| {
            cross(&offsets[CORNERS[n].0], &offsets[CORNERS[n].1])
        });
        let spring = patch.springs(row, p, &offsets, weights, stiff);
        let (mut gradient, mut matrix) = (spring.gradient, spring.matrix);
        let mut distortion = V::zero();
        if stiff {
            let slopes = patch.slopes::<V, S>(row, p);
            each!([0, 1, 2, 3, 4, 5, 6, 7], |k| {
                let edge = patch.edge(row, p, k);
                let (value, tangents) = (&p.samples.value, &p.samples.tangents);
                let (length, near, _) =
                    S::gradient(value, tangents, &slopes, &edge.value, edge.same_triangle, &edge.d);
                let strain = (length - edge.rest_length) * edge.inverse_length;
                let scaled = edge.weight * edge.inverse_length;
                let (pull, stiffness) = (scaled * strain, scaled * edge.inverse_length);
                let stress = edge.stress_stiffness(length);
                distortion += edge.weight * strain * strain;
                gradient[0] += pull * near[0];
                gradient[1] += pull * near[1];
                matrix[0] += stiffness * near[0] * near[0] + stress;
                matrix[1] += stiffness * near[0] * near[1];
                matrix[2] += stiffness * near[1] * near[1] + stress;
            });
        }
        let mut room = V::zero();
        let threshold = V::splat(weights.room_threshold);
        if least(&jacobians).lt(threshold).any() {
            for (jacobian, (a, b)) in jacobians.iter().zip(CORNERS) {
                let ([ax, ay], [bx, by]) = (offsets[a], offsets[b]);
                let by_node = [ay - by, bx - ax];
                let lack = (threshold - *jacobian).max(V::zero());
                let beta = jacobian.lt(threshold).select(V::splat(weights.room), V::zero());
                let pull = lack * weights.room;
                room += lack * pull;
                gradient[0] -= pull * by_node[0];
                gradient[1] -= pull * by_node[1];
                matrix[0] += beta * by_node[0] * by_node[0];
                matrix[1] += beta * by_node[0] * by_node[1];
                matrix[2] += beta * by_node[1] * by_node[1];
            }
        }
        Model { distortion, room, spring, gradient, matrix, offsets, jacobians }
    }

    /// The changes of J of the twelve corners if the node moves by `delta`: J is linear in the node's displacement.
    #[inline(always)]
    fn changes(&self, delta: &[V; 2]) -> [V; 12] {
        let along = each!([0, 1, 2, 3, 4, 5, 6, 7], |k| cross(delta, &self.offsets[k]));
        each!([0, 1, 2, 3, 4, 5, 6, 7, 8, 9, 10, 11], |n| along[CORNERS[n].0] - along[CORNERS[n].1])
    }

    /// J of the twelve corners once the node has moved by `delta`.
    #[inline(always)]
    fn jacobians_after(&self, delta: &[V; 2]) -> [V; 12] {
        let changes = self.changes(delta);
        each!([0, 1, 2, 3, 4, 5, 6, 7, 8, 9, 10, 11], |n| self.jacobians[n] + changes[n])
    }

    /// The step -H⁻¹γ, clamped to `MAX_NODE_STEP` and limited so that every corner Jacobian keeps most of what it has
    /// over ε.
    #[inline(always)]
    fn newton_step(&self) -> [V; 2] {
        let ([gx, gy], [xx, xy, yy]) = (self.gradient, self.matrix);
        let inverse = V::one() / (xx * yy - xy * xy);
        let delta = [(xy * gy - yy * gx) * inverse, (xy * gx - xx * gy) * inverse];
        // The clamp also turns NaN into a finite step, which is then accepted or refused by its energy.
        let delta = each!([0, 1], |c| delta[c].max(V::splat(-MAX_NODE_STEP)).min(V::splat(MAX_NODE_STEP)));
        let changes = self.changes(&delta);
        let most = each!([0, 1, 2, 3, 4, 5, 6, 7, 8, 9, 10, 11], |n| {
            (self.jacobians[n] - V::splat(MIN_JACOBIAN)).max(V::zero()) * SWEPT_MARGIN
        });
        let left = each!([0, 1, 2, 3, 4, 5, 6, 7, 8, 9, 10, 11], |n| most[n] + changes[n]);
        // Only the few corners that would lose more limit the step.
        if !least(&left).lt(V::zero()).any() {
            return delta;
        }
        let mut fraction = V::one();
        for n in 0..12 {
            let limits = left[n].lt(V::zero());
            fraction = fraction.min(limits.select(most[n] / -changes[n], V::one()));
        }
        each!([0, 1], |c| delta[c] * fraction)
    }
}

impl Patch {
    /// The springs at a row's nodes.
    #[inline(always)]
    fn springs<V: Lanes>(
        &self,
        row: Row,
        p: &NodeState<V>,
        offsets: &[[V; 2]; 8],
        weights: &Weights,
        stiff: bool,
    ) -> Spring<V> {
        let mut spring = Spring { energy: V::zero(), gradient: [V::zero(); 2], matrix: [V::zero(); 3] };
        each!([0, 1, 2, 3, 4, 5, 6, 7], |k| {
            let edge = self.edge(row, p, k);
            let d = &offsets[k];
            let change = edge.offset_change(k);
            let smooth =
                if stiff { edge.smoothness(weights) } else { V::splat(edge.elastic_smoothness(weights)) };
            spring.energy += smooth * (change[0] * change[0] + change[1] * change[1]);
            spring.gradient[0] -= smooth * change[0];
            spring.gradient[1] -= smooth * change[1];
            spring.matrix[0] += smooth;
            spring.matrix[2] += smooth;
            if weights.orients() {
                let [nx, ny] = edge.normal;
                let kappa = edge.orientation(weights);
                let normal_offset = edge.normal_offset();
                spring.energy += normal_offset * normal_offset * kappa;
                spring.gradient[0] -= normal_offset * kappa * nx;
                spring.gradient[1] -= normal_offset * kappa * ny;
                spring.matrix[0] += kappa * (nx * nx);
                spring.matrix[1] += kappa * (nx * ny);
                spring.matrix[2] += kappa * (ny * ny);
            }
            if weights.pull > 0.0 {
                let (energy, force) = self.pull(row, d, k, weights);
                spring.energy += energy;
                for c in 0..2 {
                    spring.gradient[c] += force[c];
                    spring.matrix[2 * c] += V::splat(pull_stiffness(k, weights));
                }
            }
        });
        if self.has_hold {
            let ([x, y], moved) = self.moved_across(row, p);
            spring.energy += moved * moved;
            spring.gradient[0] += x * moved;
            spring.gradient[1] += y * moved;
            spring.matrix[0] += x * x;
            spring.matrix[1] += x * y;
            spring.matrix[2] += y * y;
        }
        spring
    }
}

/// The distortion of the edges at a row's nodes.
#[inline(always)]
fn distortion<V: Lanes, S: Surface>(patch: &Patch, row: Row, p: &NodeState<V>) -> V {
    let mut energy = V::zero();
    each!([0, 1, 2, 3, 4, 5, 6, 7], |k| {
        let edge = patch.edge(row, p, k);
        let length =
            S::length(&p.samples.value, &p.samples.tangents, &edge.value, edge.same_triangle, &edge.d);
        let strain = (length - edge.rest_length) * edge.inverse_length;
        energy += edge.weight * strain * strain;
    });
    energy
}

/// The room terms of twelve corners.
#[inline(always)]
fn room_energy<V: Lanes>(jacobians: &[V; 12], weights: &Weights) -> V {
    let mut energy = V::zero();
    if least(jacobians).lt(V::splat(weights.room_threshold)).any() {
        for &jacobian in jacobians {
            energy += terms::room_energy(jacobian, weights);
        }
    }
    energy
}

/// a x b.
#[inline(always)]
fn cross<V: Lanes>(a: &[V; 2], b: &[V; 2]) -> V {
    a[0] * b[1] - a[1] * b[0]
}

/// The least of twelve numbers, lane by lane; those that are not numbers are left out.
#[inline(always)]
fn least<V: Lanes>(numbers: &[V; 12]) -> V {
    let mut least = V::splat(f32::INFINITY);
    each!([0, 1, 2, 3, 4, 5, 6, 7, 8, 9, 10, 11], |n| least = numbers[n].min(least));
    least
}
