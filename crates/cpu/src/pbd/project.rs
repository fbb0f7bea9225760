//! Projection of one set of edges (method §10, the paper's section 4.2): each edge is scaled towards its rest length by
//! its weight and turned back towards its rest direction. Its ends are limited to the bounding boxes of their
//! neighbours.

use vrtm_core::grid::window::{self, WINDOW_NODES, Window};
use vrtm_core::method::law::TINY;
use vrtm_core::method::pbd::{Iteration, Set};

use super::super::decode;
use super::super::lanes::{Lanes, Mask, Vectorised, each};
use super::super::row::NEIGHBOURS;
use super::super::row::Row;
use super::super::sampling::Surface;
use super::block::PassBlock;

/// The projection of one set of edges.
#[derive(Clone, Copy)]
pub struct Project {
    pub set: Set,
    pub iteration: Iteration,
    /// κ₁: the increase of the turn's fraction where the density of rigid material is 1.
    pub density: f32,
}

impl<S: Surface> Vectorised for PassBlock<'_, Project, S> {
    type Output = ();

    #[inline(always)]
    fn run<V: Lanes>(self) {
        let PassBlock { pass: Project { set, iteration, density }, level, state, b, .. } = self;
        let neighbours = &level.blocks.neighbours[b];
        let floor = V::splat(level.floor[level.blocks.list[b].chart as usize]);
        let u = self.displacements();
        let mut rigidity: Window = [0.0; WINDOW_NODES];
        let mut movable: Window<u8> = [0; WINDOW_NODES];
        let mut length: Window = [0.0; WINDOW_NODES];
        // SAFETY: nothing writes the state.
        let value: [Window; 3] = window::planes(neighbours, |b, c| unsafe { &state.value.get(b)[c] });
        let (next_u, next_value) = self.copied();
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
            self.store_moved(&moved, &here, lanes, row, (&mut *next_u, &mut *next_value));
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
