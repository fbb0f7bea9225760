//! The stages that both backends implement, as the schedule calls them (method §5).

use super::acceptance::Correction;
use super::pbd::Iteration;
use crate::report::StageTimes;

/// A stage of a solve, with its arguments. Level 0 is the finest.
#[derive(Clone, Copy, Debug)]
pub enum Stage {
    /// Computes the pose's triangles and their metrics.
    Surface,
    /// Computes the pose's metrics on level 1 to the coarsest level of the solve.
    Pyramid { coarsest: usize },
    /// Sets the displacements that a level starts from.
    Start { level: usize, from: Start },
    /// Relaxes a level node by node (method §6).
    Relax { level: usize, sweeps: u32 },
    /// Does one Gauss-Newton step for all nodes of a level, relaxes, and accepts or rejects it for each chart (method
    /// §7).
    Correct { level: usize, correction: Correction },
    /// Does one iteration of the paper's solver on a level (method §10).
    Iterate { level: usize, iteration: Iteration },
    /// Computes the energies of the identity and of the present state on a level on which work ends before level 0.
    Energies { level: usize, allow_folds: bool },
    /// Computes corner Jacobians, and energies unless `Energies` has, and applies the fallback (method §8): a chart
    /// that is folded, or whose energy is not finite or above that of the identity, becomes the identity; with
    /// `allow_folds`, only one whose energy is not finite.
    Certify { allow_folds: bool },
}

/// The start of a level.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Start {
    Identity,
    /// The previous result. On level 0 only.
    Previous,
    /// The next coarser level, interpolated (method §3).
    Coarser,
    /// The next coarser level, interpolated and then smoothed with this weight, as the paper does (method §10).
    Smoothed(f32),
    /// The next coarser level, for a level on which no other work is done.
    Passing,
}

/// The milliseconds of a category in which stages are timed.
pub type Time = fn(&mut StageTimes) -> &mut f32;

impl Stage {
    pub fn time(&self) -> Time {
        match self {
            Stage::Surface => |times| &mut times.surface,
            Stage::Pyramid { .. } => |times| &mut times.pyramid,
            Stage::Start { .. } => |times| &mut times.prolong,
            Stage::Relax { .. } => |times| &mut times.relax,
            Stage::Correct { .. } => |times| &mut times.correct,
            Stage::Iterate { .. } => |times| &mut times.pbd,
            Stage::Energies { .. } | Stage::Certify { .. } => |times| &mut times.certify,
        }
    }

    /// The last iteration of a level, if this stage is an earlier one. It ends the level's steps instead, since the
    /// state after an earlier iteration is a prediction.
    pub fn last_instead(&self) -> Option<Stage> {
        let Stage::Iterate { level, iteration } = *self else { return None };
        Some(Stage::Iterate { level, iteration: Iteration { regularise: true, last: true, ..iteration } })
    }

    /// The level that the stage works on; the finest for stages without a level.
    pub fn level(&self) -> usize {
        match *self {
            Stage::Start { level, .. }
            | Stage::Relax { level, .. }
            | Stage::Energies { level, .. }
            | Stage::Correct { level, .. }
            | Stage::Iterate { level, .. } => level,
            Stage::Surface | Stage::Pyramid { .. } | Stage::Certify { .. } => 0,
        }
    }
}

/// A backend, for the charts of one tile that are to be solved.
pub trait Stages {
    /// Does a stage. The schedule depends on no outcome: a GPU records a solve in advance.
    fn run(&mut self, stage: &Stage);
    /// Waits until all stages called so far are done. Called before the clock is read for a time budget.
    fn wait(&mut self) {}
}
