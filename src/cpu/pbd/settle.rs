//! What follows the projections: regularisation (the paper's eq. 4-5), integration, and the prediction of the next
//! iteration's positions.

use crate::tile::Level;
use crate::tile::blocks::{Plane, SIDE};
use crate::tile::halo::{self, WINDOW_NODES, Window};

use super::super::lanes::{Kernel, LANES, Mask, V, each, wide};
use super::super::patch::{Row, State};
use super::super::surface::Surface;
use super::super::team::Shared;
use super::project::put;

/// Integration and prediction.
#[derive(Clone, Copy)]
pub struct Velocity {
    /// No iteration follows: nodes stay where they are integrated.
    pub last: bool,
    /// Share of its velocity that a node keeps.
    pub momentum: f32,
}

/// One pass.
#[derive(Clone, Copy)]
pub struct Settle {
    pub smoothing: f32,
    /// None: regularisation alone.
    pub velocity: Option<Velocity>,
}

impl Settle {
    /// Settles block `b`'s own nodes.
    ///
    /// # Safety
    /// Nothing writes `state` now, and nothing else touches block `b` of `next` and of `previous`.
    pub unsafe fn block<S: Surface>(
        self,
        level: &Level,
        state: State,
        next: State,
        previous: Shared<[Plane; 2]>,
        surface: S,
        b: usize,
    ) {
        wide(Block { settle: self, level, state, next, previous, surface, b });
    }
}

struct Block<'a, S> {
    settle: Settle,
    level: &'a Level,
    state: State,
    next: State,
    previous: Shared<[Plane; 2]>,
    surface: S,
    b: usize,
}

impl<S: Surface> Kernel for Block<'_, S> {
    type Output = ();

    #[inline(always)]
    fn run(self) {
        let Block { settle: Settle { smoothing, velocity }, level, state, next, previous, surface, b } = self;
        let around = &level.blocks.around[b];
        let block = &level.blocks.list[b];
        let origin = [i64::from(block.x) * SIDE as i64, i64::from(block.y) * SIDE as i64];
        let mut u: [Window; 2] = [[0.0; WINDOW_NODES]; 2];
        // SAFETY: the caller's promise.
        let (to_u, to_value, previous) = unsafe {
            for c in 0..2 {
                halo::load(around, 0.0, |b| &state.u.get(b)[c], &mut u[c]);
            }
            if S::CHORDS {
                *next.triangle.get_mut(b) = *state.triangle.get(b);
            }
            let (to_u, to_value) = (next.u.get_mut(b), next.value.get_mut(b));
            *to_u = *state.u.get(b);
            *to_value = *state.value.get(b);
            (to_u, to_value, previous.get_mut(b))
        };
        for row in (0..4).flat_map(Row::of_colour) {
            let (own, s) = (row.at(0, 0), row.slot());
            let mut lanes = Mask([0; LANES]);
            let mut any = 0;
            for k in 0..LANES {
                lanes.0[k] = if level.movable[b][s + k] != 0 { u32::MAX } else { 0 };
                any |= lanes.0[k];
            }
            if any == 0 {
                continue;
            }
            // Eq. 4 where M is 1: b = (1 - R) + R s.
            let rigidity = V::load(&level.rigidity[b], s);
            let blend = (V::ONE - rigidity) + rigidity * smoothing;
            let here = each!([0, 1], |c| V::load(&u[c], own));
            // Eq. 5. The Gaussian leaves the grid at rest as it is, so displacements can be smoothed for positions.
            let mut moved = each!([0, 1], |c| here[c] + blend * (gaussian(&u[c], row) - here[c]));
            if let Some(Velocity { last, momentum }) = velocity {
                let settled = moved;
                if !last {
                    let before = each!([0, 1], |c| V::load(&previous[c], s));
                    moved = each!([0, 1], |c| settled[c] + (settled[c] - before[c]) * momentum);
                }
                for c in 0..2 {
                    lanes.select(settled[c], V::ZERO).store(&mut previous[c], s);
                }
            }
            // SAFETY: the caller's promise.
            unsafe { put(&moved, &here, lanes, row, origin, (&mut *to_u, &mut *to_value), next, surface, b) };
        }
    }
}

/// The 3x3 Gaussian K_G at a row's nodes.
#[inline(always)]
fn gaussian(window: &Window, row: Row) -> V {
    let at = |i: i64, j: i64| V::load(window, row.at(i, j));
    let line = |j: i64| at(0, j) * 0.5 + (at(-1, j) + at(1, j)) * 0.25;
    line(0) * 0.5 + (line(-1) + line(1)) * 0.25
}
