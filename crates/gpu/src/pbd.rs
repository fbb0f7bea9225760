//! pbd: the iterations of the paper's solver (method §10); the counterpart of `cpu/pbd.rs`. Passes read one copy of a
//! level's state and write the other, which uses the memory of the vectors, since this solver needs no vectors.

use super::kernels::Kernel;
use super::layout::{PBD_FROM_VECTORS, PBD_LAST, PBD_WITHOUT_VELOCITY, Params};
use super::run::Run;
use vrtm_core::method::pbd::{Iteration, SETS};

impl Run<'_> {
    /// One iteration: projects the eight sets in turn; then, if `iteration` includes it, regularises, integrates and
    /// predicts.
    pub(super) fn iterate_level(&mut self, level: usize, iteration: &Iteration) {
        if iteration.first {
            // Make both copies equal, and set velocities to 0.
            self.copy_state(level, 0);
            self.state_in_vectors = false;
            let nodes: u64 =
                self.charts.iter().zip(&self.grid.movable).filter(|(solve, _)| **solve).map(|(_, n)| n).sum();
            self.nodes_of_level = nodes >> (2 * level);
        }
        let params = Params {
            correction: iteration.correction,
            orientation_fraction: iteration.orientation,
            momentum: iteration.momentum,
            smoothing: iteration.smoothing,
            ..self.at_level(level)
        };
        let kernel = if level == 0 { Kernel::ProjectChords } else { Kernel::ProjectMetrics };
        for set in SETS {
            let mode = (2 * set.edge + set.parity) as u32;
            self.pass(kernel, level, Params { mode, ..params });
        }
        if iteration.regularise {
            let mode = if iteration.last { PBD_LAST } else { 0 };
            self.regularise_pass(level, Params { mode, ..params });
        }
        self.node_updates += self.nodes_of_level;
        if iteration.last {
            self.copy_back(level);
        }
    }

    /// Regularisation alone (the paper's eq. 4 and 5), without velocities.
    pub(super) fn regularise_level(&mut self, level: usize, smoothing: f32) {
        self.copy_state(level, PBD_WITHOUT_VELOCITY);
        self.state_in_vectors = false;
        self.regularise_pass(level, Params { mode: PBD_WITHOUT_VELOCITY, smoothing, ..self.at_level(level) });
        self.copy_back(level);
    }

    /// Copies a level's state back to the buffer in which the other stages expect it.
    pub fn copy_back(&mut self, level: usize) {
        if self.state_in_vectors {
            self.copy_state(level, PBD_WITHOUT_VELOCITY | PBD_FROM_VECTORS);
            self.state_in_vectors = false;
        }
    }

    fn regularise_pass(&mut self, level: usize, params: Params) {
        let kernel = if level == 0 { Kernel::RegulariseChords } else { Kernel::RegulariseMetrics };
        self.pass(kernel, level, params);
    }

    /// Dispatches a pass over all active blocks; afterwards the other copy is the present state.
    fn pass(&mut self, kernel: Kernel, level: usize, params: Params) {
        let mode = params.mode | if self.state_in_vectors { PBD_FROM_VECTORS } else { 0 };
        let extra = [self.memory.levels[level].vectors.clone()];
        self.dispatch_active(kernel, level, &extra, Params { mode, ..params });
        self.state_in_vectors = !self.state_in_vectors;
    }

    /// Copies the state of all stored blocks to the other copy.
    fn copy_state(&mut self, level: usize, mode: u32) {
        let extra = [self.memory.levels[level].vectors.clone()];
        self.dispatch_stored(Kernel::CopyState, level, &extra, Params { mode, ..self.at_level(level) });
    }
}
