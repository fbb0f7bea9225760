//! The plan of a solve: its input, and the stages of each level that follow from its options (method §5).

use std::sync::Arc;
use std::time::Duration;

use super::acceptance::Correction;
use super::law::CG_ITERATIONS;
use super::stage::{Stage, Start};
use crate::grid::Grid;
use crate::grid::pose::Pose;
use crate::mesh::TileMesh;
use crate::report::StageTimes;
use crate::settings::{PbdSettings, Quality, SolveOptions, Solver, TileSettings};

/// The input of a backend: one tile, or several as one, in one pose.
pub struct Input<'a> {
    pub grid: &'a Arc<Grid>,
    /// The tile, or the first of several.
    pub mesh: &'a TileMesh,
    pub pose: &'a Pose,
    pub settings: &'a TileSettings,
    /// The setting `harm`; 0 for the paper's solver.
    pub harm: f32,
    /// Per feature, the multiplier that a solve from the last result starts from; empty for 0.
    pub multipliers: &'a [f32],
    /// Per chart, true if it is to be solved.
    pub charts: &'a [bool],
    /// λ(level + 1) / λ(level); see `Plan`.
    pub continuation: f32,
    /// Weight θ of the pull towards the last result, on level 0 (method §5); 0 for no pull.
    pub pull: f32,
}

impl Input<'_> {
    /// λ on a level (method §4).
    pub fn smoothness(&self, level: usize) -> f32 {
        self.settings.smoothness * self.continuation.powi(level as i32)
    }
}

/// Use of a solver's memory.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Purpose {
    pub solver: Solver,
    /// True if features that come out worse get stiffer (method §4, Harm).
    pub weighs: bool,
}

impl Purpose {
    pub fn new(solver: Solver, settings: &TileSettings) -> Purpose {
        Purpose { solver, weighs: solver == Solver::Descent && settings.harm > 0.0 }
    }
}

/// The result of a chart's solve, in numbers.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct ChartResult {
    pub energy_before: f64,
    pub energy: f64,
    pub min_jacobian: f64,
    pub folds: u64,
    pub max_displacement: f32,
    /// True if the identity replaced the solver's warp (method §8).
    pub fallback: bool,
}

/// The work to be done by a solve, derived from its options.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Plan {
    /// Sweeps after each correction, on levels 0 and 1; on a level without corrections, all of its sweeps. Coarser
    /// levels have none: what they leave rough does not reach the finer ones.
    pub sweeps: [u32; 2],
    /// The finest level that is worked on, unless the solve starts from the last result: its result is interpolated to
    /// level 0.
    pub finest: usize,
    /// Iterations of conjugate gradients in each correction, on levels 0 and 1; coarser levels have one.
    pub iterations: [u32; 2],
    /// Greatest number of corrections, on the finest level and on each of the others.
    pub corrections: [u32; 2],
    /// See `Correction`.
    pub tolerance: f32,
    /// See `Correction`.
    pub trusts_model: bool,
    /// λ(level + 1) / λ(level). A smoother warp on the coarser levels leaves to the finer ones the decision which of
    /// two features gives way: with 2, the energy of the squash to 40 % ends 2 % lower, that of strips 1.6 %, that of
    /// scenes with room 0.1 to 0.4 %.
    pub continuation: f32,
    /// The settings of the paper's solver, if it replaces the descent.
    pub pbd: Option<PbdSettings>,
    pub warm: bool,
    /// `SolveOptions::temporal_weight`, if it has an effect.
    pub temporal_weight: f32,
    pub budget: Option<Duration>,
}

/// Most corrections of `normal` on the finest level.
const CORRECTIONS: u32 = 4;

impl Plan {
    pub fn new(options: &SolveOptions) -> Plan {
        let pbd = (options.solver == Solver::Pbd).then_some(options.pbd);
        // A draft does not work on the finest level: who asks for corrections there gets those of `normal`.
        let draft = options.quality == Quality::Draft && options.max_corrections.is_none();
        let most = options.max_corrections.unwrap_or(CORRECTIONS);
        // The coarser levels together cost a third of the finest one, and their correction moves features as far as
        // hundreds of sweeps alone would. A chart with room is done after one correction on the finest level; the
        // further ones go to crowded charts.
        let (sweeps, corrections, tolerance, trusts_model) = if draft {
            // No correction follows on the finest level: the coarser levels have to be solved with the λ of the finest.
            // The sweeps of level 0 are those of a solve that starts from the last result.
            ([3, 1], [0, 1], 0.0, true)
        } else if most <= CORRECTIONS {
            ([2, 2], [most, 1], 3e-3, true)
        } else {
            // They gain hardly any energy, and let rounding decide where crowded charts end. More sweeps make the warp
            // of crowded charts smoother in the pose.
            ([5, 2], [most, 1], 1e-4, false)
        };
        let continuation = if draft { 1.0 } else { 2.0 };
        // A second iteration on level 1 lowers the strain of a draft by a tenth, for a fifth of its time, and makes
        // crowded charts rougher. `normal` needs it there: where charts are crowded, it is rougher without.
        let iterations = [CG_ITERATIONS, if draft { 1 } else { CG_ITERATIONS }];
        // Options that the solver ignores must not make two plans differ.
        let descent = pbd.is_none();
        // Where features have room, level 1 leaves 1.1 to 1.8 times the strain that a whole solve leaves, in a third of
        // the time (method §5).
        Plan {
            finest: usize::from(descent && draft),
            sweeps: if descent { sweeps } else { [0; 2] },
            iterations: if descent { iterations } else { [0; 2] },
            corrections: if descent { corrections } else { [0; 2] },
            tolerance: if descent { options.tolerance.unwrap_or(tolerance) } else { 0.0 },
            trusts_model: descent && trusts_model,
            continuation: if descent { continuation } else { 1.0 },
            pbd,
            warm: options.warm,
            temporal_weight: if descent && options.warm { options.temporal_weight } else { 0.0 },
            budget: options.time_budget,
        }
    }

    /// The setting `harm`, which only the descent has.
    pub fn harm(&self, settings: &TileSettings) -> f32 {
        if self.pbd.is_some() { 0.0 } else { settings.harm }
    }

    pub fn solver(&self) -> Solver {
        if self.pbd.is_some() { Solver::Pbd } else { Solver::Descent }
    }

    /// The coarsest level that is worked on.
    pub fn coarsest(&self, grid: &Grid) -> usize {
        if self.pbd.is_some() { grid.levels.len() - 1 } else { grid.coarsest() }
    }

    /// The start of a level, unless it is the coarsest level of the solve.
    pub fn start(&self, level: usize) -> Stage {
        let from = self.pbd.map_or(Start::Coarser, |settings| Start::Smoothed(settings.smoothing));
        Stage::Start { level, from }
    }

    /// The `n`-th stage after a level's start, from 0; `None` after the last. Corrections include their sweeps; no
    /// sweeps come before the first correction: a prolonged state is as good a start as a relaxed one (the gaps of
    /// scenes with room are the same or smaller without). `warm` on level 0 of a warm solve: the last frame's result is
    /// relaxed for this pose first.
    pub fn step(&self, level: usize, n: u32, warm: bool) -> Option<Stage> {
        let coarser = usize::from(level > 0);
        let corrections = self.corrections[coarser];
        let sweeps = self.sweeps.get(level).copied().unwrap_or(0);
        if let Some(settings) = self.pbd {
            let iteration = settings.iteration(level, n);
            return (n < settings.iterations).then_some(Stage::Iterate { level, iteration });
        }
        let Some(n) = n.checked_sub(u32::from(warm)) else { return Some(Stage::Relax { level, sweeps }) };
        if corrections == 0 {
            return (n == 0 && !warm).then_some(Stage::Relax { level, sweeps });
        }
        let Plan { tolerance, trusts_model, .. } = *self;
        let iterations = self.iterations.get(level).copied().unwrap_or(1);
        let correction = Correction { first: n == 0, iterations, sweeps, tolerance, trusts_model };
        (n < corrections).then_some(Stage::Correct { level, correction })
    }
}

/// The work that a solve did.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Summary {
    pub times: StageTimes,
    pub sweeps: u32,
    pub corrections: u32,
    pub truncated: bool,
}

impl Summary {
    /// The summary of a part of the work that takes this share of the times.
    pub fn share(mut self, share: f32) -> Summary {
        let StageTimes { surface, pyramid, prolong, relax, correct, pbd, certify, .. } = &mut self.times;
        for ms in [surface, pyramid, prolong, relax, correct, pbd, certify] {
            *ms *= share;
        }
        self
    }

    /// Counts a stage that took this many seconds.
    pub fn count(&mut self, stage: &Stage, seconds: f64) {
        *stage.time()(&mut self.times) += seconds as f32 * 1000.0;
        match *stage {
            Stage::Relax { sweeps, .. } => self.sweeps += sweeps,
            Stage::Iterate { .. } => self.sweeps += 1,
            Stage::Correct { ref correction, .. } => {
                self.sweeps += correction.sweeps;
                self.corrections += 1;
            }
            _ => {}
        }
    }
}
