//! The energy of a level's present state, chart by chart, summed in a fixed order.

use super::lanes::{Kernel, Lanes, Truth, wide};
use super::patch::{NEIGHBOURS, Patch, QUADRANTS, State, Weights};
use super::row::Row;
use super::sampling::Surface;
use super::team::SharedSlice;
use super::terms::{Terms, lowest, room};
use super::{Run, SurfaceFn};
use crate::method::law::CRUSHED_JACOBIAN;
use crate::tile::Level;

impl Run<'_> {
    /// Per chart, the energy of a level's present state (only charts that are solved; others 0).
    pub(super) fn energies(&mut self, level: usize) -> Vec<f64> {
        self.with_surface(level, Energies { level, as_is: false })
    }

    /// The same of a state that may be folded.
    pub(super) fn energies_as_is(&mut self, level: usize) -> Vec<f64> {
        self.with_surface(level, Energies { level, as_is: true })
    }
}

struct Energies {
    level: usize,
    as_is: bool,
}

impl SurfaceFn<Vec<f64>> for Energies {
    fn call<S: Surface>(self, run: &mut Run, state: State, surface: S) -> Vec<f64> {
        let level = &run.grid.levels[self.level];
        let blocks = &run.work[self.level].active;
        let mut sums = vec![0.0f64; blocks.len()];
        let shared = SharedSlice::new(&mut sums);
        run.team.run_on(blocks.len(), |worker, k| {
            let b = blocks[k] as usize;
            let sum = run.patches.with(worker, |patch| {
                wide(StateEnergy {
                    patch,
                    level,
                    state,
                    surface,
                    weights: &run.weights[self.level],
                    b,
                    as_is: self.as_is,
                })
            });
            // SAFETY: each item has its own sum.
            unsafe { *shared.get_mut(k) = sum };
        });
        run.per_chart(self.level, &sums)
    }
}

/// The energy of block `b` as it is. Nothing may write the state meanwhile.
struct StateEnergy<'a, S> {
    patch: &'a mut Patch,
    level: &'a Level,
    state: State,
    surface: S,
    weights: &'a Weights,
    b: usize,
    /// Crushed cells do not count as worthless.
    as_is: bool,
}

impl<S: Surface> Kernel for StateEnergy<'_, S> {
    type Output = f64;

    #[inline(always)]
    fn run<V: Lanes>(self) -> f64 {
        let StateEnergy { patch, level, state, surface, weights, b, as_is } = self;
        // SAFETY: nothing writes the state.
        unsafe { patch.load::<V, S>(level, state, b) };
        if S::CHORDS {
            patch.load_slopes::<V, S>(surface);
        }
        let mut total = Total::<V>::new();
        for row in Row::all() {
            let own = patch.movable_lanes::<V>(row);
            if own.any() {
                let p = patch.here::<V>(row);
                total.add(
                    patch,
                    row,
                    own,
                    weights,
                    &patch.terms::<V, S>(row, &p, weights, patch.is_rigid::<V>(row, weights)),
                );
            }
        }
        if as_is { total.sum() } else { total.energy() }
    }
}

/// A block's share of its chart's energy: an edge or corner between several movable nodes is shared among them.
pub struct Total<V> {
    sum: V,
    worst: V,
}

impl<V: Lanes> Total<V> {
    #[inline(always)]
    pub fn new() -> Total<V> {
        Total { sum: V::zero(), worst: V::one() }
    }

    /// Takes in a row, of which the lanes `own` may move.
    #[inline(always)]
    pub fn add(&mut self, patch: &Patch, row: Row, own: V::Mask, weights: &Weights, terms: &Terms<V>) {
        let mut energy = V::zero();
        for (k, &(di, dj, ..)) in NEIGHBOURS.iter().enumerate() {
            energy += (V::one() - patch.movable_near::<V>(row, di, dj) * 0.5) * terms.edges[k];
        }
        let low = lowest(&terms.corners);
        self.worst = low.min(self.worst);
        // Corners that lack no room are most of them.
        if low.lt(V::splat(weights.room_threshold)).any() {
            for (q, &(sx, sy)) in QUADRANTS.iter().enumerate() {
                let (a, b) = (patch.movable_near::<V>(row, sx, 0), patch.movable_near::<V>(row, 0, sy));
                let c = patch.movable_near::<V>(row, sx, sy);
                let others = [a + b, a + c, b + c];
                for k in 0..3 {
                    energy += room(terms.corners[3 * q + k].0, weights) / (others[k] + 1.0);
                }
            }
        }
        // Fixed lanes may hold anything, even what is not a number.
        self.sum += own.select(energy, V::zero());
    }

    /// The block's share, whatever the state.
    #[inline(always)]
    fn sum(&self) -> f64 {
        f64::from(self.sum.sum())
    }

    /// The block's share.
    #[inline(always)]
    pub fn energy(&self) -> f64 {
        // A state with crushed cells is worth nothing, however low its energy.
        let crushed = self.worst.lt(V::splat(CRUSHED_JACOBIAN)).any();
        if crushed { f64::INFINITY } else { self.sum() }
    }
}
