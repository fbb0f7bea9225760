//! Projection of one set of edges (method §10, the paper's section 4.2): each edge is scaled towards its rest length by
//! its weight and turned back towards its rest direction. Its ends are limited to the bounding boxes of their
//! neighbours.

use vrtm_core::grid::Level;
use vrtm_core::grid::planes::{NODES, Plane, SIDE};
use vrtm_core::grid::window::{self, WINDOW_NODES, Window};
use vrtm_core::mesh::NONE;
use vrtm_core::method::law::TINY;
use vrtm_core::method::pbd::{Iteration, Set};

use super::super::buffers::State;
use super::super::decode;
use super::super::lanes::{Lanes, Mask, Vectorised, dispatch, each};
use super::super::patch::NEIGHBOURS;
use super::super::row::Row;
use super::super::sampling::{GridRow, Samples, Surface};

/// The projection of one set of edges.
#[derive(Clone, Copy)]
pub struct Project {
    pub set: Set,
    pub iteration: Iteration,
}

impl Project {
    /// Projects the set's edges at the nodes of block `b`. `density` is κ₁: the increase of the turn's fraction where
    /// the density of rigid material is 1.
    ///
    /// # Safety
    /// No item writes `state`, and no other item accesses block `b` of `next` meanwhile.
    pub unsafe fn block<S: Surface>(
        self,
        level: &Level,
        state: State,
        next: State,
        surface: S,
        density: f32,
        b: usize,
    ) {
        dispatch(ProjectBlock { project: self, level, state, next, surface, density, b });
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

impl<S: Surface> Vectorised for ProjectBlock<'_, S> {
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
        // SAFETY: promised by the caller.
        let (next_u, next_value) = unsafe {
            for c in 0..2 {
                window::load(neighbours, 0.0, |b| &state.u.get(b)[c], &mut u[c]);
            }
            for c in 0..3 {
                window::load(neighbours, 0.0, |b| &state.value.get(b)[c], &mut value[c]);
            }
            if S::CHORDS {
                *next.triangle.get_mut(b) = *state.triangle.get(b);
            }
            let (next_u, next_value) = (next.u.get_mut(b), next.value.get_mut(b));
            *next_u = *state.u.get(b);
            *next_value = *state.value.get(b);
            (next_u, next_value)
        };
        decode::rigidity::<V>(level, b, &mut rigidity);
        window::load(neighbours, 0, |b| &level.movable[b], &mut movable);
        decode::rest_length::<V>(level, b, set.edge, &mut length);
        let has_density = density > 0.0 && !level.density.is_empty();
        let mut densities: Window = [0.0; WINDOW_NODES];
        if has_density {
            window::load(neighbours, 0.0, |b| &level.density[b], &mut densities);
        }
        for row in Row::all() {
            let ((di, dj), partner_owns) = set.partner(row.column(), row.line());
            let weight = row.near::<V>(&rigidity, 0, 0).max(row.near(&rigidity, di, dj));
            let lanes = V::zero().lt(V::load_u8(&movable, row.at(0, 0))).and(V::zero().lt(weight));
            if !lanes.any() {
                continue;
            }
            let here = each!([0, 1], |c| row.near::<V>(&u[c], 0, 0));
            let d0 = [di as f32, dj as f32];
            let d = row.offset(&u, &here, di, dj);
            let value_here = each!([0, 1, 2], |c| row.near::<V>(&value[c], 0, 0));
            let value_there = each!([0, 1, 2], |c| row.near::<V>(&value[c], di, dj));
            // On the finest level lengths are distances between positions, so the two ends are never treated as on one
            // triangle.
            let same_triangle = V::Mask::from_bits(0);
            let length_now = S::length(&value_here, &[V::zero(); 6], &value_there, same_triangle, &d);
            let owner = if partner_owns { (di, dj) } else { (0, 0) };
            let rest = row.near::<V>(&length, owner.0, owner.1).max(floor);
            let mut turn: V = V::splat(iteration.orientation);
            if has_density {
                let sum = row.near::<V>(&densities, 0, 0) + row.near::<V>(&densities, di, dj);
                turn = (turn + sum * (0.5 * density)).min(V::one());
            }
            let correction = iteration.correction;
            let target = projected(d, d0, rest / length_now, weight * correction, turn * correction);
            // Each of two movable ends takes half of the change; if one end is fixed, the movable one takes all of it.
            let partner_movable = V::load_u8(&movable, row.at(di, dj));
            let fraction = V::one() - partner_movable * 0.5;
            let mut moved = each!([0, 1], |c| here[c] + (d[c] - target[c]) * fraction);
            // The bounding box of the eight neighbours, relative to the node's position at rest.
            let (mut low, mut high) = ([V::splat(f32::MAX); 2], [V::splat(f32::MIN); 2]);
            for &(i, j, ..) in &NEIGHBOURS {
                let at = [row.near::<V>(&u[0], i, j) + i as f32, row.near::<V>(&u[1], i, j) + j as f32];
                for c in 0..2 {
                    low[c] = low[c].min(at[c]);
                    high[c] = high[c].max(at[c]);
                }
            }
            moved = each!([0, 1], |c| moved[c].max(low[c]).min(high[c]));
            // SAFETY: promised by the caller.
            unsafe {
                store_moved(
                    &moved,
                    &here,
                    lanes,
                    row,
                    &grid_row(row, b, origin),
                    (next_u, next_value),
                    next,
                    surface,
                )
            };
        }
    }
}

/// The offset of an edge after projection: d is scaled by 1 + stiffness (ratio - 1) with the ratio l / L, and then its
/// direction is blended with that of d0. A blend of unit vectors turns by the fraction `turn` of the angle, up to an
/// error of third order in the angle, and needs no inverse cosine.
#[inline(always)]
pub fn projected<V: Lanes>(d: [V; 2], d0: [f32; 2], ratio: V, stiffness: V, turn: V) -> [V; 2] {
    let scale = (ratio - V::one()) * stiffness + V::one();
    let d = each!([0, 1], |c| d[c] * scale);
    let length = (d[0] * d[0] + d[1] * d[1] + V::splat(TINY)).sqrt();
    let norm = (d0[0] * d0[0] + d0[1] * d0[1]).sqrt();
    let blend = each!([0, 1], |c| (d[c] / length) * (V::one() - turn) + turn * (d0[c] / norm));
    let scale = length / (blend[0] * blend[0] + blend[1] * blend[1] + V::splat(TINY)).sqrt();
    each!([0, 1], |c| blend[c] * scale)
}

/// The nodes of a row of block `b`, whose first node is `origin`, in the coordinates of the level.
#[inline(always)]
pub fn grid_row(row: Row, b: usize, origin: [i64; 2]) -> GridRow {
    GridRow { block: b, i: origin[0] + row.column() as i64, j: origin[1] + row.line() as i64 }
}

/// Samples the surface at a row's nodes displaced by `moved`, and writes the given lanes whose nodes move and have a
/// sample. A node that would leave its chart stays.
///
/// # Safety
/// No other item accesses block `nodes.block` of `next` meanwhile.
#[inline(always)]
#[allow(clippy::too_many_arguments, reason = "the parts of a row of a block")]
pub unsafe fn store_moved<V: Lanes, S: Surface>(
    moved: &[V; 2],
    here: &[V; 2],
    lanes: V::Mask,
    row: Row,
    nodes: &GridRow,
    (next_u, next_value): (&mut [Plane; 2], &mut [Plane; 3]),
    next: State,
    surface: S,
) {
    let slot = row.slot();
    let unmoved =
        moved[0].le(here[0]).and(here[0].le(moved[0])).and(moved[1].le(here[1])).and(here[1].le(moved[1]));
    let lanes = lanes.and_not(unmoved);
    if !lanes.any() {
        return;
    }
    let mut no_triangles: Plane<u32> = [NONE; NODES];
    // SAFETY: promised by the caller.
    let triangle = if S::CHORDS { unsafe { next.triangle.get_mut(nodes.block) } } else { &mut no_triangles };
    let mut samples =
        Samples { value: [V::zero(); 3], tangents: [V::zero(); 6], triangle: V::load_index(triangle, slot) };
    let start = samples.triangle;
    let found = surface.sample_row(nodes, moved, lanes, &mut samples);
    for c in 0..2 {
        found.select(moved[c], row.load(&next_u[c])).store(&mut next_u[c], slot);
    }
    for c in 0..3 {
        found.select(samples.value[c], row.load(&next_value[c])).store(&mut next_value[c], slot);
    }
    if S::CHORDS {
        V::store_index(V::select_index(found, samples.triangle, start), triangle, slot);
    }
}
