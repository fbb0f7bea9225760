//! pbd: the iterations of the paper's solver; the twin of `cpu/pbd.rs`. Passes read a level's state in one place and write
//! it to another one, the vectors', which this solver has no other use for.

use super::kernels::Kernel;
use super::layout::Params;
use super::{Run, Shared};
use crate::pbd::{Iteration, SETS};

/// Bits of a pass's mode beside its set; the numbers are `shaders/pbd.wgsl`'s.
const FROM_ASIDE: u32 = 16;
const LAST: u32 = 32;
const STILL: u32 = 64;

impl Run<'_> {
    /// One iteration: the eight sets in turn; at times regularisation, integration, and the next prediction.
    pub(super) fn iterate_level(&mut self, level: usize, iteration: &Iteration) {
        if iteration.first {
            // Both places, and velocities of 0.
            self.hand_over(level, 0);
            self.aside = false;
            let nodes: u64 =
                self.charts.iter().zip(&self.grid.movable).filter(|(solve, _)| **solve).map(|(_, n)| n).sum();
            self.nodes_of_level = nodes >> (2 * level);
        }
        let params = Params {
            correction: iteration.correction,
            preservation: iteration.orientation,
            momentum: iteration.momentum,
            smoothing: iteration.smoothing,
            ..self.at_level(level)
        };
        let kernel = if level == 0 { Kernel::ProjectChords } else { Kernel::ProjectMetrics };
        for set in SETS {
            let mode = (2 * set.edge + set.parity) as u32;
            self.pass(kernel, level, Params { mode, ..params });
        }
        if iteration.settle {
            let mode = if iteration.last { LAST } else { 0 };
            self.settle_pass(level, Params { mode, ..params });
        }
        self.node_updates += self.nodes_of_level;
        if iteration.last {
            self.come_home(level);
        }
    }

    /// Eq. 4-5 alone.
    pub(super) fn smooth_level(&mut self, level: usize, smoothing: f32) {
        self.hand_over(level, STILL);
        self.aside = false;
        self.settle_pass(level, Params { mode: STILL, smoothing, ..self.at_level(level) });
        self.come_home(level);
    }

    /// Brings a level's state to where the other stages look for it.
    pub fn come_home(&mut self, level: usize) {
        if self.aside {
            self.hand_over(level, STILL | FROM_ASIDE);
            self.aside = false;
        }
    }

    fn settle_pass(&mut self, level: usize, params: Params) {
        let kernel = if level == 0 { Kernel::SettleChords } else { Kernel::SettleMetrics };
        self.pass(kernel, level, params);
    }

    /// Runs a pass over all active blocks; the state is then in the other place.
    fn pass(&mut self, kernel: Kernel, level: usize, params: Params) {
        let mode = params.mode | if self.aside { FROM_ASIDE } else { 0 };
        for band in 0..self.memory.bands[level].len() {
            let own = [self.memory.buffers[level][band].vectors.clone()];
            let active = self.memory.lists[level][band].active;
            self.run_list(kernel, [level, band], &own, active, Params { mode, ..params });
        }
        self.aside = !self.aside;
        self.exchange(level, if self.aside { Shared::Vectors } else { Shared::State });
    }

    /// Copies the state of all stored blocks.
    fn hand_over(&mut self, level: usize, mode: u32) {
        for band in 0..self.memory.bands[level].len() {
            let own = [self.memory.buffers[level][band].vectors.clone()];
            let stored = self.memory.lists[level][band].stored;
            let params = Params { mode, ..self.at_level(level) };
            self.run_list(Kernel::HandOver, [level, band], &own, stored, params);
        }
        self.exchange(level, if mode & FROM_ASIDE == 0 { Shared::Vectors } else { Shared::State });
    }
}
