//! The schedule of a solve (method §5), written once for the stages that both backends implement: surface; pyramid; on
//! each level, coarsest first, prolong, then correct, or relax alone; certify. The paper's solver has a schedule of its
//! own on each level (`pbd`).

use std::time::{Duration, Instant};

use super::acceptance::Correction;
use super::law::SWEEPS_PER_PASS;
use super::pbd;
use crate::mesh::TileMesh;
use crate::report::StageTimes;
use crate::settings::{PbdValues, Quality, SolveOptions, Solver, TileSettings};
use crate::tile::Grid;
use crate::tile::pose::Pose;

/// The input of a backend: one tile, one pose.
pub(crate) struct Input<'a> {
    pub grid: &'a Grid,
    pub mesh: &'a TileMesh,
    pub pose: &'a Pose,
    pub settings: &'a TileSettings,
    /// Per chart, true if it is to be solved.
    pub charts: &'a [bool],
    /// λ(level + 1) / λ(level); see `Plan`.
    pub continuation: f32,
    /// Weight θ of the pull towards the last result, on level 0 (method §5); 0 if there is none.
    pub pull: f32,
}

impl Input<'_> {
    /// λ on a level (method §4).
    pub fn smoothness(&self, level: usize) -> f32 {
        self.settings.smoothness * self.continuation.powi(level as i32)
    }
}

/// The result of a chart's solve, in numbers.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(crate) struct ChartResult {
    pub energy_before: f64,
    pub energy: f64,
    pub min_jacobian: f64,
    pub folds: u64,
    pub max_displacement: f32,
    /// True if the identity took the place of the solver's warp (method §8).
    pub fallback: bool,
}

/// The stages of a backend, for the charts of one tile that are to be solved. No stage returns anything on which the
/// schedule would have to decide: a GPU runs all of it without a readback.
pub(crate) trait Stages {
    /// Levels of the grid; 0 is the finest.
    fn levels(&self) -> usize;
    /// Computes the pose's triangles and their metrics.
    fn surface(&mut self);
    /// Computes the pose's metrics on all coarser levels.
    fn pyramid(&mut self);
    /// Sets a level to the identity.
    fn identity(&mut self, level: usize);
    /// Sets level 0 to the previous result.
    fn previous(&mut self);
    /// Interpolates the displacements of a level from the next coarser one (method §3).
    fn prolong(&mut self, level: usize);
    /// Relaxes a level node by node (method §6).
    fn relax(&mut self, level: usize, sweeps: u32);
    /// Does one Gauss-Newton step for all nodes of a level, relaxes, and accepts or refuses chart by chart (method §7).
    fn correct(&mut self, level: usize, correction: &Correction);
    /// Does one iteration of the paper's solver on a level (method §10).
    fn iterate(&mut self, level: usize, iteration: &pbd::Iteration);
    /// Smooths a level's displacements after interpolation, as the paper does.
    fn regularise(&mut self, level: usize, smoothing: f32);
    /// Computes energies and corner Jacobians, and applies the fallback (method §8): a chart that is folded, or whose
    /// energy is not finite or above that of the identity, becomes the identity; with `allow_folds`, only one whose
    /// energy is not finite.
    fn certify(&mut self, allow_folds: bool);
    /// Waits until all stages called so far are done. Called before the clock is read, if there is a time budget.
    fn wait(&mut self) {}
}

/// The work of a solve, from its options (method §5).
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Plan {
    /// Sweeps after each correction, on the finest level and on the others; on a level without corrections, all of its
    /// sweeps.
    pub sweeps: [u32; 2],
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
    /// The settings of the paper's solver, if it takes the place of the descent.
    pub pbd: Option<PbdValues>,
    pub warm: bool,
    /// `SolveOptions::temporal_weight`, if it has an effect.
    pub temporal_weight: f32,
    pub budget: Option<Duration>,
}

impl Plan {
    pub fn new(options: &SolveOptions) -> Plan {
        let pbd = (options.solver == Solver::Pbd).then(|| options.pbd.resolved());
        // The coarser levels together cost a third of the finest one, and their corrections move features as far as
        // hundreds of sweeps alone would. A chart with room is done after one correction on the finest level; the
        // further ones go to crowded charts. `high` reaches the finest level in the same way as `normal` and continues
        // from there: it is never to end with a higher energy.
        let (sweeps, corrections, tolerance, trusts_model, continuation) = match options.quality {
            // No correction follows on the finest level: the coarser levels have to be solved with the λ of the finest.
            Quality::Draft => ([3, 3], [0, 1], 0.0, true, 1.0),
            Quality::Normal => ([2, 2], [4, 1], 3e-3, true, 2.0),
            Quality::High => ([4, 2], [12, 1], 1e-4, false, 2.0),
        };
        let cap = |n: u32| options.max_corrections.unwrap_or(n);
        // Options that the solver does not use must not make two plans differ.
        let descent = pbd.is_none();
        Plan {
            sweeps: if descent { sweeps } else { [0; 2] },
            corrections: if descent { corrections.map(cap) } else { [0; 2] },
            tolerance: if descent { options.tolerance.unwrap_or(tolerance) } else { 0.0 },
            trusts_model: descent && trusts_model,
            continuation: if descent { continuation } else { 1.0 },
            pbd,
            warm: options.warm,
            temporal_weight: if descent && options.warm { options.temporal_weight } else { 0.0 },
            budget: options.time_budget,
        }
    }

    pub fn solver(&self) -> Solver {
        if self.pbd.is_some() { Solver::Pbd } else { Solver::Descent }
    }
}

/// The work that the schedule did.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(crate) struct Summary {
    pub times: StageTimes,
    pub sweeps: u32,
    pub corrections: u32,
    pub truncated: bool,
}

/// Runs the schedule. The plan's budget counts from `start`.
pub(crate) fn run(stages: &mut impl Stages, plan: &Plan, warm: bool, start: Instant) -> Summary {
    let mut summary = Summary::default();
    let mut times = StageTimes::default();
    timed(&mut times.surface, || stages.surface());
    timed(&mut times.pyramid, || stages.pyramid());
    let coarsest = if warm { 0 } else { stages.levels() - 1 };
    for level in (0..=coarsest).rev() {
        timed(&mut times.prolong, || {
            if level < coarsest {
                stages.prolong(level);
            } else if warm {
                stages.previous();
            } else {
                stages.identity(level);
            }
        });
        match &plan.pbd {
            None => {
                if warm && !is_late(stages, plan, start) {
                    // On no level has the last frame's result been relaxed for this pose.
                    summary.sweeps += plan.sweeps[0];
                    timed(&mut times.relax, || stages.relax(level, plan.sweeps[0]));
                }
                correct_level(stages, plan, level, start, &mut summary, &mut times);
            }
            Some(settings) => {
                let late = |stages: &mut _| is_late(stages, plan, start);
                timed(&mut times.pbd, || {
                    pbd::level(stages, settings, level, coarsest, late, &mut summary);
                });
            }
        }
    }
    timed(&mut times.certify, || stages.certify(plan.pbd.is_some()));
    summary.times = times;
    summary
}

/// Does the corrections of a level, each with its sweeps; or sweeps alone. No sweeps come before the first correction:
/// a prolonged state is as good a start as a relaxed one (the gaps of scenes with room are the same or smaller
/// without).
fn correct_level(
    stages: &mut impl Stages,
    plan: &Plan,
    level: usize,
    start: Instant,
    summary: &mut Summary,
    times: &mut StageTimes,
) {
    let coarser = usize::from(level > 0);
    let (corrections, sweeps) = (plan.corrections[coarser], plan.sweeps[coarser]);
    for step in 0..corrections.max(1) {
        // Past the budget only prolongation and certification are left: the present state becomes the result.
        if is_late(stages, plan, start) {
            summary.truncated = true;
            break;
        }
        summary.sweeps += sweeps;
        if corrections == 0 {
            timed(&mut times.relax, || stages.relax(level, sweeps));
        } else {
            let Plan { tolerance, trusts_model, .. } = *plan;
            let correction = Correction { first: step == 0, sweeps, tolerance, trusts_model };
            timed(&mut times.correct, || stages.correct(level, &correction));
            summary.corrections += 1;
        }
    }
}

/// The number of sweeps of each pass over a level.
pub(crate) fn passes(sweeps: u32) -> impl Iterator<Item = u32> {
    (0..sweeps).step_by(SWEEPS_PER_PASS as usize).map(move |done| (sweeps - done).min(SWEEPS_PER_PASS))
}

/// True past the time budget.
fn is_late(stages: &mut impl Stages, plan: &Plan, start: Instant) -> bool {
    plan.budget.is_some_and(|budget| {
        stages.wait();
        start.elapsed() > budget
    })
}

/// Adds the milliseconds that `f` takes.
fn timed(sum: &mut f32, f: impl FnOnce()) {
    let start = Instant::now();
    f();
    *sum += start.elapsed().as_secs_f32() * 1000.0;
}
