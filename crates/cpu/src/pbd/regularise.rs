//! Regularisation (the paper's eq. 4 and 5), integration, and the prediction of the positions from which the next
//! projections begin (method §10).

use vrtm_core::grid::codes::RIGIDITY_STEPS;
use vrtm_core::grid::mirrors;
use vrtm_core::grid::window::Window;

use super::super::lanes::{LANES, Lanes, Mask, Vectorised, each};
use super::super::row::Row;
use super::super::sampling::Surface;
use super::block::PassBlock;
use vrtm_core::method::law::TINY;
use vrtm_core::method::pbd::Iteration;

/// A pass of regularisation.
#[derive(Clone, Copy)]
pub struct Regularise {
    /// The setting s of eq. 4.
    pub smoothing: f32,
    /// `None` for regularisation without integration and prediction.
    pub iteration: Option<Iteration>,
}

impl<S: Surface> Vectorised for PassBlock<'_, Regularise, S> {
    type Output = ();

    #[inline(always)]
    fn run<V: Lanes>(self) {
        let PassBlock { pass: Regularise { smoothing, iteration }, level, b, .. } = self;
        let u = self.displacements();
        let (next_u, next_value) = self.copied();
        // SAFETY: nothing else accesses the block.
        let previous = unsafe { self.previous.get_mut(b) };
        for row in Row::all() {
            let s = row.slot();
            let lanes = V::zero().lt(V::load_u8(&level.movable[b], s));
            if !lanes.any() {
                continue;
            }
            // Eq. 4 at movable nodes (M = 1): b = (1 - R) + R s.
            let rigidity = V::load_u16(&level.rigidity[b], row.slot()) / V::splat(RIGIDITY_STEPS);
            let blend = (V::one() - rigidity) + rigidity * smoothing;
            let here = each!([0, 1], |c| row.near::<V>(&u[c], 0, 0));
            // Eq. 5, applied to displacements, which is equivalent to positions because the Gaussian reproduces the
            // grid at rest.
            let mut moved = each!([0, 1], |c| here[c] + blend * (gaussian::<V>(&u[c], row) - here[c]));
            if let Some(Iteration { last, momentum, .. }) = iteration {
                let integrated = moved;
                if !last {
                    let before = each!([0, 1], |c| V::load(&previous[c], s));
                    moved = each!([0, 1], |c| integrated[c] + (integrated[c] - before[c]) * momentum);
                }
                for c in 0..2 {
                    lanes.select(integrated[c], V::zero()).store(&mut previous[c], s);
                }
            }
            if let Some(hold) = level.hold.get(b) {
                let mut across = [[0.0; LANES]; 2];
                for (lane, &hold) in hold[s..s + LANES].iter().enumerate() {
                    [across[0][lane], across[1][lane]] = mirrors::decode(hold);
                }
                // At an open border along which texture slides, nothing moves across it.
                let across = across.map(|across| V::load(&across, 0));
                let square = (across[0] * across[0] + across[1] * across[1]).max(V::splat(TINY));
                let far = (across[0] * moved[0] + across[1] * moved[1]) / square;
                moved = each!([0, 1], |c| moved[c] - across[c] * far);
            }
            self.store_moved(&moved, &here, lanes, row, (&mut *next_u, &mut *next_value));
        }
    }
}

/// The 3x3 Gaussian of a window at a row's nodes.
#[inline(always)]
fn gaussian<V: Lanes>(window: &Window, row: Row) -> V {
    let [low, middle, high] = each!([0, 1, 2], |k| {
        let j = k as i64 - 1;
        let sides = row.near::<V>(window, -1, j) + row.near::<V>(window, 1, j);
        row.near::<V>(window, 0, j) * 0.5 + sides * 0.25
    });
    middle * 0.5 + (low + high) * 0.25
}
