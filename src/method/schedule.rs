//! The schedule of a solve, written once over the stages that a backend implements:
//! surface -> pyramid -> (prolong -> correct, or relax alone) per level, coarsest first -> certify. The paper's solver has its own
//! way through the levels (`pbd`).

use std::time::{Duration, Instant};

use super::acceptance::Correction;
use super::law::SWEEPS_PER_PASS;
use super::pbd;
use crate::mesh::TileMesh;
use crate::report::StageTimes;
use crate::settings::{PbdValues, Quality, SolveOptions, Solver, TileSettings};
use crate::tile::Grid;
use crate::tile::pose::Pose;

/// What a backend works with: one tile, one pose.
pub(crate) struct Input<'a> {
    pub grid: &'a Grid,
    pub mesh: &'a TileMesh,
    pub pose: &'a Pose,
    pub settings: &'a TileSettings,
    pub charts: &'a [bool],
    /// λ of a level, in that of the next finer one; see `Plan`.
    pub continuation: f32,
}

impl Input<'_> {
    /// λ of a level.
    pub fn smoothness(&self, level: usize) -> f32 {
        self.settings.smoothness * self.continuation.powi(level as i32)
    }
}

/// What a chart's solve ended with.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(crate) struct ChartResult {
    pub energy_before: f64,
    pub energy: f64,
    pub min_jacobian: f64,
    pub folds: u64,
    pub max_displacement: f32,
    /// True if the solve found nothing better than the identity.
    pub fallback: bool,
}

/// The stages of a backend, for one tile and the charts that it was given to solve. No stage hands back what the
/// schedule would need to decide on: a GPU runs the whole of it without a readback.
pub(crate) trait Stages {
    /// Levels of the grid; 0 is the finest.
    fn levels(&self) -> usize;
    /// Pose triangles and their metrics.
    fn surface(&mut self);
    /// Pose metrics on all coarser levels.
    fn pyramid(&mut self);
    /// Sets a level to the identity.
    fn identity(&mut self, level: usize);
    /// Sets level 0 to the previous result.
    fn previous(&mut self);
    /// Displacements of a level from the next coarser one.
    fn prolong(&mut self, level: usize);
    /// Block descent.
    fn relax(&mut self, level: usize, sweeps: u32);
    /// One Gauss-Newton step for all nodes of a level, relaxed and then accepted chart by chart.
    fn correct(&mut self, level: usize, correction: &Correction);
    /// One iteration of the paper's solver on a level.
    fn iterate(&mut self, level: usize, iteration: &pbd::Iteration);
    /// Smooths a level's displacements as the paper does after interpolation.
    fn smooth(&mut self, level: usize, smoothing: f32);
    /// Energies, corner Jacobians in f64, and the fallback: a chart that is folded or no better than the identity
    /// becomes the identity; with `as_is`, only one that is not a number does.
    fn certify(&mut self, as_is: bool);
    /// Waits until what was called has been done. Called before the clock is looked at, if there is a time budget.
    fn wait(&mut self) {}
}

/// How much work to do.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Plan {
    /// Sweeps after each correction, on the finest level and on the others; on a level without any, sweeps alone.
    pub sweeps: [u32; 2],
    /// Corrections on the finest level and on the others.
    pub corrections: [u32; 2],
    pub tolerance: f32,
    /// See `Correction`.
    pub trusts_model: bool,
    /// λ of a level, in that of the next finer one. What is smoother on coarser levels leaves the finer ones the choice
    /// which of two features gives way: the squash to 40 % ends 2 % lower, strips 1.6 %, scenes with room 0.1 to 0.4 %.
    pub continuation: f32,
    /// The paper's solver in place of these, with all of its settings.
    pub pbd: Option<PbdValues>,
    pub warm: bool,
    pub budget: Option<Duration>,
}

impl Plan {
    pub fn new(options: &SolveOptions) -> Plan {
        let pbd = (options.solver == Solver::Pbd).then(|| options.pbd.resolved());
        // The coarser levels cost a third of the finest, and their corrections move features where sweeps alone would
        // take hundreds. A chart with room is done after one correction on the finest; the others go to crowded ones.
        // `high` comes to the finest level as `normal` does, and goes on from there: it is never to end higher.
        let (sweeps, corrections, tolerance, trusts_model, continuation) = match options.quality {
            // No correction follows on the finest level, so the next one has to be as strained as it will be.
            Quality::Draft => ([3, 3], [0, 1], 0.0, true, 1.0),
            Quality::Normal => ([2, 2], [4, 1], 3e-3, true, 2.0),
            Quality::High => ([4, 2], [12, 1], 1e-4, false, 2.0),
        };
        let cap = |n: u32| options.max_corrections.unwrap_or(n);
        // What a solver does not look at must not make two plans differ.
        let of_descent = pbd.is_none();
        Plan {
            sweeps: if of_descent { sweeps } else { [0; 2] },
            corrections: if of_descent { corrections.map(cap) } else { [0; 2] },
            tolerance: if of_descent { options.tolerance.unwrap_or(tolerance) } else { 0.0 },
            trusts_model: of_descent && trusts_model,
            continuation: if of_descent { continuation } else { 1.0 },
            pbd,
            warm: options.warm,
            budget: options.time_budget,
        }
    }

    pub fn solver(&self) -> Solver {
        if self.pbd.is_some() { Solver::Pbd } else { Solver::Descent }
    }
}

/// What the schedule did.
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
                    // The last frame's result has not seen this pose on any level.
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

/// Corrections of a level, each with its sweeps; or sweeps alone. None come before the first correction: it starts from a
/// prolonged state as well as from a relaxed one (gaps of scenes with room are the same or smaller without).
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
        // Past the budget only prolongation is left: the state so far becomes the result.
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

/// The sweeps of each pass over a level.
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

fn timed(sum: &mut f32, f: impl FnOnce()) {
    let start = Instant::now();
    f();
    *sum += start.elapsed().as_secs_f32() * 1000.0;
}
