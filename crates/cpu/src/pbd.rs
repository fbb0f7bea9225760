//! pbd: the iterations of the paper's solver (method §10). Each pass reads a level's state and writes a second copy of
//! it; then the two are swapped. No node depends on values that the same pass writes, so neither the number of threads
//! nor their order affects the result.

mod block;
mod project;
mod regularise;
#[cfg(test)]
mod tests;

use vrtm_core::grid::planes::Plane;
use vrtm_core::method::pbd::{Iteration, SETS};

use super::buffers::State;
use super::lanes::dispatch;
use super::run::{Run, SurfaceFn};
use super::sampling::Surface;
use block::PassBlock;
use project::Project;
use regularise::Regularise;
use vrtm_core::team::SharedSlice;

impl Run<'_> {
    /// Does one iteration: projects the eight sets in turn; then, if the iteration includes it, regularises, integrates
    /// and predicts.
    pub(super) fn iterate_level(&mut self, level: usize, iteration: &Iteration) {
        if iteration.first {
            self.begin_level(level);
        }
        let density = self.weights[level].orientation_density;
        for set in SETS {
            self.pass(level, Pass::Project(Project { set, iteration: *iteration, density }));
        }
        if iteration.regularise {
            let (smoothing, iteration) = (iteration.smoothing, Some(*iteration));
            self.pass(level, Pass::Regularise(Regularise { smoothing, iteration }));
        }
        self.count_updates(level, 1);
    }

    /// Regularises a level (the paper's eq. 4 and 5) without integration and prediction.
    pub(super) fn regularise_level(&mut self, level: usize, smoothing: f32) {
        self.copy_inactive_blocks(level);
        self.pass(level, Pass::Regularise(Regularise { smoothing, iteration: None }));
    }

    /// Sets the velocities of a level to 0.
    fn begin_level(&mut self, level: usize) {
        self.copy_inactive_blocks(level);
        for &b in &self.work[level].active {
            let b = b as usize;
            self.memory.pbd[level].previous[b] = self.memory.levels[level].u[b];
        }
    }

    /// Copies to the second copy of the state those stored blocks that are inactive, which no pass visits.
    fn copy_inactive_blocks(&mut self, level: usize) {
        let (state, next) = (&self.memory.levels[level], &mut self.memory.pbd[level].next);
        for &b in &self.work[level].stored {
            let b = b as usize;
            if !self.grid.levels[level].blocks.list[b].active {
                next.u[b] = state.u[b];
                next.value[b] = state.value[b];
                if level == 0 {
                    next.triangle[b] = state.triangle[b];
                }
            }
        }
    }

    /// Runs a pass over all active blocks of a level, and makes its output the level's state.
    fn pass(&mut self, level: usize, pass: Pass) {
        let buffers = &mut self.memory.pbd[level];
        let (next, previous) = (buffers.next.state(), SharedSlice::new(&mut buffers.previous));
        self.with_surface(level, RunPass { level, pass, next, previous });
        let (state, next) = (&mut self.memory.levels[level], &mut self.memory.pbd[level].next);
        std::mem::swap(&mut state.u, &mut next.u);
        std::mem::swap(&mut state.value, &mut next.value);
        std::mem::swap(&mut state.triangle, &mut next.triangle);
    }
}

/// A pass over the nodes of a level.
#[derive(Clone, Copy)]
enum Pass {
    Project(Project),
    Regularise(Regularise),
}

/// Runs a pass over all active blocks of a level.
struct RunPass {
    level: usize,
    pass: Pass,
    next: State,
    previous: SharedSlice<[Plane; 2]>,
}

impl SurfaceFn<()> for RunPass {
    fn call<S: Surface>(self, run: &Run, state: State, surface: S) {
        let RunPass { level, pass, next, previous } = self;
        let blocks = &run.work[level].active;
        let level = &run.grid.levels[level];
        run.team.run(blocks.len(), |k| {
            // No item writes `state`, and each item has its own block of `next` and `previous`.
            let b = blocks[k] as usize;
            match pass {
                Pass::Project(pass) => {
                    dispatch(PassBlock { pass, level, state, next, previous, surface, b });
                }
                Pass::Regularise(pass) => {
                    dispatch(PassBlock { pass, level, state, next, previous, surface, b });
                }
            }
        });
    }
}
