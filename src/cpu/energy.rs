//! The energy of a level's present state, chart by chart, summed in a fixed order.

use std::marker::PhantomData;

use super::lanes::{Kernel, V, wide};
use super::patch::{NEIGHBOURS, Patch, QUADRANTS, Row, State, Weights, room};
use super::relax::MIN_JACOBIAN;
use super::surface::Surface;
use super::team::Shared;
use super::{Run, SurfaceFn};

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
        let shared = Shared::new(&mut sums);
        run.team.run(blocks.len(), |k| {
            let b = blocks[k] as usize;
            let sum = run.patches.with(|patch| {
                // SAFETY: nothing is written to the state now.
                unsafe { patch.load(level, state, surface, b) };
                wide(BlockEnergy {
                    patch,
                    weights: &run.weights,
                    as_is: self.as_is,
                    surface: PhantomData::<S>,
                })
            });
            // SAFETY: each item has its own sum.
            unsafe { *shared.get_mut(k) = sum };
        });
        run.per_chart(self.level, &sums)
    }
}

/// A block's share of its chart's energy: an edge or corner between several movable nodes is shared among them.
pub struct BlockEnergy<'a, S> {
    pub patch: &'a Patch,
    pub weights: &'a Weights,
    /// Crushed cells do not count as worthless.
    pub as_is: bool,
    pub surface: PhantomData<S>,
}

impl<S: Surface> Kernel for BlockEnergy<'_, S> {
    type Output = f64;

    #[inline(always)]
    fn run(self) -> f64 {
        let BlockEnergy { patch, weights, as_is, .. } = self;
        let mut sum = V::ZERO;
        let mut worst = V::ONE;
        for row in (0..4).flat_map(Row::of_colour) {
            let p = patch.here(row);
            let at = row.at(0, 0);
            let movable = |di, dj| V::load_u8(&patch.movable, row.at(di, dj));
            let mut energy = V::ZERO;
            for (k, &(di, dj, ..)) in NEIGHBOURS.iter().enumerate() {
                let edge = patch.edge(row, &p, k);
                let length = S::length(&p.value, &p.slope, &edge.value, edge.same, &edge.d);
                energy += (V::ONE - movable(di, dj) * 0.5) * edge.energy(k, length, weights);
            }
            let corners = patch.corners(row, &p);
            for (q, &(sx, sy)) in QUADRANTS.iter().enumerate() {
                let (a, b, c) = (movable(sx, 0), movable(0, sy), movable(sx, sy));
                let others = [a + b, a + c, b + c];
                for k in 0..3 {
                    let jacobian = corners[3 * q + k].0;
                    energy += room(jacobian, weights) / (others[k] + 1.0);
                    worst = jacobian.min(worst);
                }
            }
            let own = V::load_u8(&patch.movable, at);
            // Fixed lanes may hold anything, even what is not a number.
            sum += V::ZERO.lt(own).select(energy, V::ZERO);
        }
        // A state with crushed cells is worth nothing, however low its energy.
        let crushed = !as_is && worst.0.iter().any(|&jacobian| jacobian < 0.5 * MIN_JACOBIAN);
        if crushed { f64::INFINITY } else { f64::from(sum.sum()) }
    }
}
