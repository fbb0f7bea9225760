//! The energy of a level's present state per chart (method §4), summed in a fixed order.

use super::buffers::State;
use super::lanes::{Lanes, Mask, Vectorised, dispatch, each};
use super::patch::{Patch, Source, Weights};
use super::row::Row;
use super::run::{Run, SurfaceFn};
use super::sampling::Surface;
use super::terms::{Model, least_jacobian};
use std::hint::black_box;
use vrtm_core::allocation::Vec;
use vrtm_core::method::law::CRUSHED_JACOBIAN;

impl Run<'_> {
    /// The energy of a level's present state per chart; infinite if a corner Jacobian is under `CRUSHED_JACOBIAN`, 0
    /// for charts that are not solved.
    pub fn energies(&mut self, level: usize) -> Vec<f64> {
        self.with_surface(level, Energies::of_state(level, self.weights[level].without_pull()))
    }

    /// The energy including the pull towards the previous result, which corrections reduce.
    pub(super) fn energies_with_pull(&mut self, level: usize) -> Vec<f64> {
        self.with_surface(level, Energies::of_state(level, self.weights[level]))
    }

    /// Stores the energy of the identity on a level. On level 0 the level's present state must be the identity.
    pub(super) fn store_identity_energy(&mut self, level: usize) {
        let weights = self.weights[level].without_pull();
        let identity = Energies { is_identity: true, ..Energies::of_state(level, weights) };
        let energies = self.with_surface(level, identity);
        for (result, energy) in self.results.iter_mut().zip(energies) {
            result.energy_before = energy;
        }
    }

    /// Computes the energies of a level's present state, unless those of all charts that are solved are known. With
    /// `allow_folds` those of folded states, too, whatever their corner Jacobians.
    pub(super) fn complete_energies(&mut self, level: usize, allow_folds: bool) {
        let list = &self.grid.levels[level].blocks.list;
        let is_known = |&b: &u32| self.known_energies[list[b as usize].chart as usize].is_some();
        if !self.work[level].active.iter().all(is_known) {
            let weights = self.weights[level].without_pull();
            let state = Energies { allow_folds, ..Energies::of_state(level, weights) };
            let energies = self.with_surface(level, state);
            self.known_energies = energies.into_iter().map(Some).collect();
        }
        // A chart without movable nodes on this level has no energy.
        for energy in &mut self.known_energies {
            energy.get_or_insert(0.0);
        }
    }
}

/// The energy of a level per chart.
struct Energies {
    level: usize,
    weights: Weights,
    /// True if crushed cells count with their terms instead of making the energy infinite.
    allow_folds: bool,
    /// True if the state is the identity, whatever is stored. On level 0 the stored samples must be those of
    /// the identity.
    is_identity: bool,
}

impl Energies {
    fn of_state(level: usize, weights: Weights) -> Energies {
        Energies { level, weights, allow_folds: false, is_identity: false }
    }
}

impl SurfaceFn<Vec<f64>> for Energies {
    fn call<S: Surface>(self, run: &Run, state: State, surface: S) -> Vec<f64> {
        let Energies { level, ref weights, allow_folds, is_identity } = self;
        let next = |b| Patch::prefetch(&run.grid.levels[level], state, b);
        run.sum_blocks(level, next, |worker, b| {
            let source = Source { weights, ..run.source(level, state, surface, b) };
            run.patches
                .with(worker, |patch| dispatch(BlockEnergy { patch, source, allow_folds, is_identity }))
        })
    }
}

/// A block's part in its chart's energy. No other item may write the state meanwhile.
struct BlockEnergy<'a, S> {
    patch: &'a mut Patch,
    source: Source<'a, S>,
    /// As in `Energies`.
    allow_folds: bool,
    is_identity: bool,
}

impl<S: Surface> Vectorised for BlockEnergy<'_, S> {
    type Output = f64;

    #[inline(always)]
    fn run<V: Lanes>(self) -> f64 {
        let BlockEnergy { patch, source, allow_folds, is_identity } = self;
        if is_identity {
            // Where nothing is rigid, the identity has no energy.
            patch.load_rigidity::<V, S>(&source);
            if !patch.is_stiff {
                return 0.0;
            }
        }
        // SAFETY: nothing writes the state.
        unsafe { patch.load::<V, S>(&source, false) };
        if is_identity {
            patch.load_identity(&source);
        }
        let mut total = Total::<V>::new();
        for row in Row::all() {
            let ((patch, row), weights) = (black_box((&*patch, row)), source.weights);
            let movable = patch.movable_lanes::<V>(row);
            if movable.any() {
                let p = patch.node_state::<V>(row);
                let d = row.offsets(&patch.u, &p.u);
                // The identity has no energy but that of distortion.
                let mut model =
                    if is_identity { Model::zero() } else { patch.elastic_model(row, &p.u, &d, weights) };
                if patch.stiff[row.index()] {
                    each!([0, 1, 2, 3, 4, 5, 6, 7], |k| {
                        model.energy += patch.part::<V>(row, k) * patch.edge_energy::<V, S>(row, &p, &d, k);
                    });
                }
                let least = if is_identity { V::one() } else { least_jacobian(&d) };
                // Most corners are above the threshold.
                if least.lt(V::splat(weights.room_threshold)).any() {
                    patch.add_room(row, &d, weights, &mut model);
                }
                total.add(movable, model.energy, least);
            }
        }
        if allow_folds { total.sum() } else { total.energy() }
    }
}

/// Sums a block's part of its chart's energy.
pub struct Total<V> {
    sum: V,
    /// The least corner Jacobian, at most 1.
    least_jacobian: V,
}

impl<V: Lanes> Total<V> {
    #[inline(always)]
    pub fn new() -> Total<V> {
        Total { sum: V::zero(), least_jacobian: V::one() }
    }

    /// Adds a row: its movable nodes, their parts of the energy, and the least Jacobian of their corners.
    #[inline(always)]
    pub fn add(&mut self, movable: V::Mask, part: V, least: V) {
        self.least_jacobian = least.min(self.least_jacobian);
        // Lanes of fixed nodes may hold anything, even NaN.
        self.sum += movable.select(part, V::zero());
    }

    /// The sum, regardless of the corner Jacobians.
    #[inline(always)]
    fn sum(&self) -> f64 {
        f64::from(self.sum.sum())
    }

    /// The sum, or infinity if a corner Jacobian is below `CRUSHED_JACOBIAN`, which makes the state invalid.
    #[inline(always)]
    pub fn energy(&self) -> f64 {
        let crushed = self.least_jacobian.lt(V::splat(CRUSHED_JACOBIAN)).any();
        if crushed { f64::INFINITY } else { self.sum() }
    }
}
