//! Projection of one set of constraints (the paper's section 4.2): each segment takes its rest length as far as it is
//! rigid, is turned back toward its rest direction, and no end leaves the bounding box of its neighbours.

use crate::mesh::NONE;
use crate::method::law::TINY;
use crate::method::pbd::{Iteration, Set};
use crate::tile::Level;
use crate::tile::blocks::{NODES, Plane, SIDE};
use crate::tile::window::{self, WINDOW_NODES, Window};

use super::super::constants;
use super::super::lanes::{Kernel, Lanes, Truth, each, wide};
use super::super::patch::{NEIGHBOURS, State};
use super::super::row::Row;
use super::super::sampling::{GridRow, Samples, Surface};

/// One set's projection.
#[derive(Clone, Copy)]
pub struct Project {
    pub set: Set,
    pub iteration: Iteration,
}

impl Project {
    /// Projects the set's edges at block `b`'s own nodes. `density` is what the rotation's share grows by where rigid
    /// material is dense.
    ///
    /// # Safety
    /// Nothing writes `state` now, and nothing else touches block `b` of `next`.
    pub unsafe fn block<S: Surface>(
        self,
        level: &Level,
        state: State,
        next: State,
        surface: S,
        density: f32,
        b: usize,
    ) {
        wide(ProjectBlock { project: self, level, state, next, surface, density, b });
    }
}

struct ProjectBlock<'a, S> {
    project: Project,
    level: &'a Level,
    state: State,
    next: State,
    surface: S,
    density: f32,
    b: usize,
}

impl<S: Surface> Kernel for ProjectBlock<'_, S> {
    type Output = ();

    #[inline(always)]
    fn run<V: Lanes>(self) {
        let ProjectBlock { project: Project { set, iteration }, level, state, next, surface, density, b } =
            self;
        let neighbours = &level.blocks.neighbours[b];
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
                window::load(neighbours, 0.0, |b| &state.u.get(b)[c], &mut u[c]);
            }
            for c in 0..3 {
                window::load(neighbours, 0.0, |b| &state.value.get(b)[c], &mut value[c]);
            }
            if S::CHORDS {
                *next.triangle.get_mut(b) = *state.triangle.get(b);
            }
            let (to_u, to_value) = (next.u.get_mut(b), next.value.get_mut(b));
            *to_u = *state.u.get(b);
            *to_value = *state.value.get(b);
            (to_u, to_value)
        };
        constants::rigidity::<V>(level, b, &mut rigidity);
        window::load(neighbours, 0, |b| &level.movable[b], &mut movable);
        constants::rest_length::<V>(level, b, set.edge, &mut length);
        let dense = density > 0.0 && !level.density.is_empty();
        let mut near: Window = [0.0; WINDOW_NODES];
        if dense {
            window::load(neighbours, 0.0, |b| &level.density[b], &mut near);
        }
        for row in Row::all() {
            let ((di, dj), neighbour_owns) = set.partner(row.column(), row.line());
            let weight = row.near::<V>(&rigidity, 0, 0).max(row.near(&rigidity, di, dj));
            let lanes = V::zero().lt(V::load_u8(&movable, row.at(0, 0))).and(V::zero().lt(weight));
            if !lanes.any() {
                continue;
            }
            let here = each!([0, 1], |c| row.near::<V>(&u[c], 0, 0));
            let d0 = [di as f32, dj as f32];
            let d = row.offset(&u, &here, di, dj);
            let own = each!([0, 1, 2], |c| row.near::<V>(&value[c], 0, 0));
            let other = each!([0, 1, 2], |c| row.near::<V>(&value[c], di, dj));
            let apart = V::Mask::from_bits(0);
            let current = S::length(&own, &[V::zero(); 6], &other, apart, &d);
            let owner = if neighbour_owns { (di, dj) } else { (0, 0) };
            let rest = row.near::<V>(&length, owner.0, owner.1).max(floor);
            let mut share: V = V::splat(iteration.orientation);
            if dense {
                let sum = row.near::<V>(&near, 0, 0) + row.near::<V>(&near, di, dj);
                share = (share + sum * (0.5 * density)).min(V::one());
            }
            let correction = iteration.correction;
            let target = projected(d, d0, rest / current, weight * correction, share * correction);
            // An end that is fixed leaves the whole way to the other one.
            let both = V::load_u8(&movable, row.at(di, dj));
            let share = V::one() - both * 0.5;
            let mut moved = each!([0, 1], |c| here[c] + (d[c] - target[c]) * share);
            // The box around the eight neighbours, relative to the node's own place at rest.
            let (mut low, mut high) = ([V::splat(f32::MAX); 2], [V::splat(f32::MIN); 2]);
            for &(i, j, ..) in &NEIGHBOURS {
                let at = [row.near::<V>(&u[0], i, j) + i as f32, row.near::<V>(&u[1], i, j) + j as f32];
                for c in 0..2 {
                    low[c] = low[c].min(at[c]);
                    high[c] = high[c].max(at[c]);
                }
            }
            moved = each!([0, 1], |c| moved[c].max(low[c]).min(high[c]));
            // SAFETY: the caller's promise.
            unsafe {
                put(&moved, &here, lanes, row, &grid_row(row, b, origin), (to_u, to_value), next, surface)
            };
        }
    }
}

/// A segment's offset after projection and rotation: d scaled by 1 + stiffness (l / L - 1), its direction then blended
/// with that at rest. A blend of unit vectors turns by the given share up to third order of the angle, without an arc
/// cosine.
#[inline(always)]
pub fn projected<V: Lanes>(d: [V; 2], d0: [f32; 2], ratio: V, stiffness: V, share: V) -> [V; 2] {
    let scale = (ratio - V::one()) * stiffness + V::one();
    let d = each!([0, 1], |c| d[c] * scale);
    let length = (d[0] * d[0] + d[1] * d[1] + V::splat(TINY)).sqrt();
    let norm = (d0[0] * d0[0] + d0[1] * d0[1]).sqrt();
    let along = each!([0, 1], |c| (d[c] / length) * (V::one() - share) + share * (d0[c] / norm));
    let norm = length / (along[0] * along[0] + along[1] * along[1] + V::splat(TINY)).sqrt();
    each!([0, 1], |c| along[c] * norm)
}

/// Where a row of block `b`, whose first node is `origin`, lies.
#[inline(always)]
pub fn grid_row(row: Row, b: usize, origin: [i64; 2]) -> GridRow {
    GridRow { block: b, i: origin[0] + row.column() as i64, j: origin[1] + row.line() as i64 }
}

/// Writes the lanes that move, where the surface is there to be sampled: a node that would leave its chart stays.
///
/// # Safety
/// Nothing else touches block `nodes.block` of `next`.
#[inline(always)]
#[allow(clippy::too_many_arguments, reason = "what a row of a block is")]
pub unsafe fn put<V: Lanes, S: Surface>(
    moved: &[V; 2],
    here: &[V; 2],
    lanes: V::Mask,
    row: Row,
    nodes: &GridRow,
    to: (&mut [Plane; 2], &mut [Plane; 3]),
    next: State,
    surface: S,
) {
    let slot = row.slot();
    let still =
        moved[0].le(here[0]).and(here[0].le(moved[0])).and(moved[1].le(here[1])).and(here[1].le(moved[1]));
    let lanes = lanes.and_not(still);
    if !lanes.any() {
        return;
    }
    let mut nowhere: Plane<u32> = [NONE; NODES];
    // SAFETY: the caller's promise.
    let triangle = if S::CHORDS { unsafe { next.triangle.get_mut(nodes.block) } } else { &mut nowhere };
    let mut samples =
        Samples { value: [V::zero(); 3], slope: [V::zero(); 6], triangle: V::load_index(triangle, slot) };
    let start = samples.triangle;
    let found = surface.sample_row(nodes, moved, lanes, &mut samples);
    for c in 0..2 {
        found.select(moved[c], row.load(&to.0[c])).store(&mut to.0[c], slot);
    }
    for c in 0..3 {
        found.select(samples.value[c], row.load(&to.1[c])).store(&mut to.1[c], slot);
    }
    if S::CHORDS {
        V::store_index(V::select_index(found, samples.triangle, start), triangle, slot);
    }
}
