//! Projection of one set of constraints (the paper's section 4.2): each segment takes its rest length as far as it is
//! rigid, is turned back toward its rest direction, and no end leaves the bounding box of its neighbours.

use crate::mesh::NONE;
use crate::pbd::{Iteration, Set};
use crate::tile::Level;
use crate::tile::blocks::SIDE;
use crate::tile::halo::{self, WINDOW_NODES, Window};

use super::super::lanes::{Kernel, LANES, Mask, V, each, wide};
use super::super::patch::{NEIGHBOURS, Row, State};
use super::super::surface::Surface;

/// Keeps 1 / |d| finite.
const TINY: f32 = 1e-24;

/// One set's projection.
#[derive(Clone, Copy)]
pub struct Project {
    pub set: Set,
    pub iteration: Iteration,
}

impl Project {
    /// Projects the set's edges at block `b`'s own nodes.
    ///
    /// # Safety
    /// Nothing writes `state` now, and nothing else touches block `b` of `next`.
    pub unsafe fn block<S: Surface>(self, level: &Level, state: State, next: State, surface: S, b: usize) {
        wide(Block { project: self, level, state, next, surface, b });
    }
}

struct Block<'a, S> {
    project: Project,
    level: &'a Level,
    state: State,
    next: State,
    surface: S,
    b: usize,
}

impl<S: Surface> Kernel for Block<'_, S> {
    type Output = ();

    #[inline(always)]
    fn run(self) {
        let Block { project: Project { set, iteration }, level, state, next, surface, b } = self;
        let around = &level.blocks.around[b];
        let block = &level.blocks.list[b];
        let origin = [i64::from(block.x) * SIDE as i64, i64::from(block.y) * SIDE as i64];
        let floor = V::splat(level.floor[block.chart as usize]);
        let mut u: [Window; 2] = [[0.0; WINDOW_NODES]; 2];
        let mut value: [Window; 3] = [[0.0; WINDOW_NODES]; 3];
        let mut rigidity: Window = [0.0; WINDOW_NODES];
        let mut movable: Window<u8> = [0; WINDOW_NODES];
        let mut length: Window = [0.0; WINDOW_NODES];
        // SAFETY: the caller's promise.
        let (to_u, to_value) = unsafe {
            for c in 0..2 {
                halo::load(around, 0.0, |b| &state.u.get(b)[c], &mut u[c]);
            }
            for c in 0..3 {
                halo::load(around, 0.0, |b| &state.value.get(b)[c], &mut value[c]);
            }
            if S::CHORDS {
                *next.triangle.get_mut(b) = *state.triangle.get(b);
            }
            let (to_u, to_value) = (next.u.get_mut(b), next.value.get_mut(b));
            *to_u = *state.u.get(b);
            *to_value = *state.value.get(b);
            (to_u, to_value)
        };
        halo::load(around, 0.0, |b| &level.rigidity[b], &mut rigidity);
        halo::load(around, 0, |b| &level.movable[b], &mut movable);
        halo::load(around, 0.0, |b| &level.rest_length[b][set.edge], &mut length);
        for row in (0..4).flat_map(Row::of_colour) {
            let ((di, dj), theirs) = set.partner(row.ci, row.j);
            let (own, other) = (row.at(0, 0), row.at(di, dj));
            let weight = V::load(&rigidity, own).max(V::load(&rigidity, other));
            let mut lanes = Mask([0; LANES]);
            let mut any = 0;
            for k in 0..LANES {
                lanes.0[k] = if movable[own + k] != 0 && weight.0[k] > 0.0 { u32::MAX } else { 0 };
                any |= lanes.0[k];
            }
            if any == 0 {
                continue;
            }
            let here = each!([0, 1], |c| V::load(&u[c], own));
            let d0 = [di as f32, dj as f32];
            let d = each!([0, 1], |c| (V::load(&u[c], other) - here[c]) + d0[c]);
            let ends = each!([0, 1, 2], |c| [V::load(&value[c], own), V::load(&value[c], other)]);
            let none = Mask([0; LANES]);
            let current = S::length(&ends.map(|e| e[0]), &[V::ZERO; 6], &ends.map(|e| e[1]), none, &d);
            let rest = V::load(&length, if theirs { other } else { own }).max(floor);
            let target = projected(d, d0, rest / current, weight * iteration.correction, iteration);
            // An end that is fixed leaves the whole way to the other one.
            let both = V::load_u8(&movable, other);
            let share = V::ONE - both * 0.5;
            let mut moved = each!([0, 1], |c| here[c] + (d[c] - target[c]) * share);
            // The box around the eight neighbours, relative to the node's own place at rest.
            let (mut low, mut high) = ([V::splat(f32::MAX); 2], [V::splat(f32::MIN); 2]);
            for &(i, j, ..) in &NEIGHBOURS {
                let n = row.at(i, j);
                let at = [V::load(&u[0], n) + i as f32, V::load(&u[1], n) + j as f32];
                for c in 0..2 {
                    low[c] = low[c].min(at[c]);
                    high[c] = high[c].max(at[c]);
                }
            }
            moved = each!([0, 1], |c| moved[c].max(low[c]).min(high[c]));
            // SAFETY: the caller's promise.
            unsafe { put(&moved, &here, lanes, row, origin, (to_u, to_value), next, surface, b) };
        }
    }
}

/// A segment's offset after projection and rotation: d scaled by 1 + stiffness (l / L - 1), its direction then blended
/// with that at rest. A blend of unit vectors turns by the given share up to third order of the angle, without an arc
/// cosine.
#[inline(always)]
pub fn projected(d: [V; 2], d0: [f32; 2], ratio: V, stiffness: V, iteration: Iteration) -> [V; 2] {
    let scale = (ratio - V::ONE) * stiffness + V::ONE;
    let d = each!([0, 1], |c| d[c] * scale);
    let length = (d[0] * d[0] + d[1] * d[1] + V::splat(TINY)).sqrt();
    let share = iteration.orientation * iteration.correction;
    let rest = share / (d0[0] * d0[0] + d0[1] * d0[1]).sqrt();
    let along = each!([0, 1], |c| (d[c] / length) * (1.0 - share) + V::splat(d0[c] * rest));
    let norm = length / (along[0] * along[0] + along[1] * along[1] + V::splat(TINY)).sqrt();
    each!([0, 1], |c| along[c] * norm)
}

/// Writes the lanes that move, where the surface is there to be sampled: a node that would leave its chart stays.
///
/// # Safety
/// Nothing else touches block `b` of `next`.
#[inline(always)]
#[allow(clippy::too_many_arguments, reason = "what a row of a block is")]
pub unsafe fn put<S: Surface>(
    moved: &[V; 2],
    here: &[V; 2],
    lanes: Mask,
    row: Row,
    origin: [i64; 2],
    to: (&mut [crate::tile::blocks::Plane; 2], &mut [crate::tile::blocks::Plane; 3]),
    next: State,
    surface: S,
    b: usize,
) {
    let slot = row.slot();
    for k in 0..LANES {
        let (x, y) = (moved[0].0[k], moved[1].0[k]);
        if lanes.0[k] == 0 || (x == here[0].0[k] && y == here[1].0[k]) {
            continue;
        }
        let (i, j) = (origin[0] + row.column(k) as i64, origin[1] + row.j as i64);
        let s = slot + k;
        // SAFETY: the caller's promise.
        let start = if S::CHORDS { unsafe { next.triangle.get(b)[s] } } else { NONE };
        let Some(sample) = surface.sample(b, i, j, [x, y], start) else { continue };
        (to.0[0][s], to.0[1][s]) = (x, y);
        for c in 0..3 {
            to.1[c][s] = sample.value[c];
        }
        if S::CHORDS {
            // SAFETY: the caller's promise.
            unsafe { next.triangle.get_mut(b)[s] = sample.triangle };
        }
    }
}
