//! relax: descent node by node (method §6). With its neighbours fixed, each node takes its 2x2 Gauss-Newton step,
//! limited so that no corner Jacobian falls below ε.
//!
//! Blocks of one block colour (x & 1, y & 1) do not touch. They are relaxed in parallel, each with its four node
//! colours in turn and with its halo frozen, so the bits do not depend on the order of the blocks. Gathering a block
//! takes a third of the time of a sweep; therefore two sweeps are done on a gathered block.

use vrtm_core::method::law::{MAX_NODE_STEP, MIN_JACOBIAN, MIN_NODE_STEP, SWEPT_MARGIN, passes};

use super::buffers::State;
use super::lanes::{LANES, Lanes, Mask, Vectorised, dispatch, each};
use super::patch::{NEIGHBOURS, NodeState, Patch, Source, Weights};
use super::row::{ROWS, Row};
use super::run::{Run, SurfaceFn};
use super::sampling::{GridRow, Surface};
use super::terms::pull_stiffness;

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
    let delta = Model::new::<S>(patch, row, &here, weights, stiff).newton_step();
    let delta = each!([0, 1], |c| delta[c] * fraction);
    // Steps that nobody sees are not worth a sample of the surface. A comparison with NaN is false: no step.
    let square = delta[0] * delta[0] + delta[1] * delta[1];
    lanes = lanes.and(V::splat(MIN_NODE_STEP * MIN_NODE_STEP).lt(square));
    if !lanes.any() {
        return;
    }
    let u = each!([0, 1], |c| here.u[c] + lanes.select(delta[c], V::zero()));
    let mut moved = NodeState { u, samples: here.samples };
    let found = surface.sample_row(&GridRow::new(level, b, row), &u, lanes, &mut moved.samples);
    patch.accept::<V, S>(row, lanes.and(found), &moved);
}

/// The offsets to the ends of the twelve corners that depend on a node, as indices in `NEIGHBOURS`, counterclockwise, so
/// that J = a x b.
const CORNERS: [(usize, usize); 12] =
    [(0, 1), (0, 2), (2, 1), (1, 4), (1, 3), (3, 4), (4, 5), (4, 6), (6, 5), (5, 0), (5, 7), (7, 0)];

/// The quadratic model of the energy at each node of a row: halves of the derivatives.
struct Model<V> {
    gradient: [V; 2],
    /// The entries (xx, xy, yy) of the Gauss-Newton matrix.
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
        let mut model = Model { gradient: [V::zero(); 2], matrix: [V::zero(); 3], offsets, jacobians };
        model.add_springs(patch, row, p, weights, stiff);
        if stiff {
            model.add_distortion::<S>(patch, row, p);
        }
        if least(&model.jacobians).lt(V::splat(weights.room_threshold)).any() {
            model.add_room(weights);
        }
        model
    }

    /// Adds the terms that are quadratic in the displacement: smoothness, orientation, pull and hold.
    #[inline(always)]
    fn add_springs(&mut self, patch: &Patch, row: Row, p: &NodeState<V>, weights: &Weights, stiff: bool) {
        let Model { gradient, matrix, .. } = self;
        each!([0, 1, 2, 3, 4, 5, 6, 7], |k| {
            let edge = patch.edge(row, p, k);
            let change = edge.offset_change(k);
            let smooth =
                if stiff { edge.smoothness(weights) } else { V::splat(edge.elastic_smoothness(weights)) };
            gradient[0] -= smooth * change[0];
            gradient[1] -= smooth * change[1];
            matrix[0] += smooth;
            matrix[2] += smooth;
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
                let (_, force) = patch.pull(row, &edge.d, k, weights);
                for c in 0..2 {
                    gradient[c] += force[c];
                    matrix[2 * c] += V::splat(pull_stiffness(k, weights));
                }
            }
        });
        if patch.has_hold {
            let ([x, y], moved) = patch.moved_across(row, p);
            gradient[0] += x * moved;
            gradient[1] += y * moved;
            matrix[0] += x * x;
            matrix[1] += x * y;
            matrix[2] += y * y;
        }
    }

    #[inline(always)]
    fn add_distortion<S: Surface>(&mut self, patch: &Patch, row: Row, p: &NodeState<V>) {
        let Model { gradient, matrix, .. } = self;
        let slopes = patch.slopes::<V, S>(row, p);
        each!([0, 1, 2, 3, 4, 5, 6, 7], |k| {
            let edge = patch.edge(row, p, k);
            let (value, tangents) = (&p.samples.value, &p.samples.tangents);
            let (length, near, _) =
                S::gradient(value, tangents, &slopes, &edge.value, edge.same_triangle, &edge.d);
            let scaled = edge.weight * edge.inverse_length;
            let pull = scaled * ((length - edge.rest_length) * edge.inverse_length);
            let stiffness = scaled * edge.inverse_length;
            let stress = edge.stress_stiffness(length);
            gradient[0] += pull * near[0];
            gradient[1] += pull * near[1];
            matrix[0] += stiffness * near[0] * near[0] + stress;
            matrix[1] += stiffness * near[0] * near[1];
            matrix[2] += stiffness * near[1] * near[1] + stress;
        });
    }

    #[inline(always)]
    fn add_room(&mut self, weights: &Weights) {
        let Model { gradient, matrix, offsets, jacobians } = self;
        let threshold = V::splat(weights.room_threshold);
        for (jacobian, (a, b)) in jacobians.iter().zip(CORNERS) {
            let ([ax, ay], [bx, by]) = (offsets[a], offsets[b]);
            let by_node = [ay - by, bx - ax];
            let beta = jacobian.lt(threshold).select(V::splat(weights.room), V::zero());
            let pull = (threshold - *jacobian).max(V::zero()) * weights.room;
            gradient[0] -= pull * by_node[0];
            gradient[1] -= pull * by_node[1];
            matrix[0] += beta * by_node[0] * by_node[0];
            matrix[1] += beta * by_node[0] * by_node[1];
            matrix[2] += beta * by_node[1] * by_node[1];
        }
    }

    /// The step -H⁻¹γ, clamped to `MAX_NODE_STEP` and limited so that every corner Jacobian keeps most of what it has
    /// over ε; NaN if the model has no minimum.
    #[inline(always)]
    fn newton_step(&self) -> [V; 2] {
        let ([gx, gy], [xx, xy, yy]) = (self.gradient, self.matrix);
        let inverse = V::one() / (xx * yy - xy * xy);
        let delta = [(xy * gy - yy * gx) * inverse, (xy * gx - xx * gy) * inverse];
        // This order keeps NaN.
        let delta = each!([0, 1], |c| V::splat(MAX_NODE_STEP).min(V::splat(-MAX_NODE_STEP).max(delta[c])));
        // J is linear in the node's displacement.
        let along = each!([0, 1, 2, 3, 4, 5, 6, 7], |k| cross(&delta, &self.offsets[k]));
        let changes =
            each!([0, 1, 2, 3, 4, 5, 6, 7, 8, 9, 10, 11], |n| along[CORNERS[n].0] - along[CORNERS[n].1]);
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
