//! The schedule of a solve, written once over the stages that a backend implements:
//! surface -> pyramid -> (prolong -> relax -> correct) per level, coarsest first -> certify. The paper's solver has its own
//! way through the levels (`pbd`).

use std::time::{Duration, Instant};

use crate::mesh::TileMesh;
use crate::pbd;
use crate::report::StageTimes;
use crate::settings::{PbdSettings, Quality, SolveOptions, Solver, TileSettings};
use crate::tile::Grid;
use crate::tile::pose::Pose;

/// What a backend works with: one tile, one pose.
pub(crate) struct Input<'a> {
    pub grid: &'a Grid,
    pub mesh: &'a TileMesh,
    pub pose: &'a Pose,
    pub settings: &'a TileSettings,
    pub charts: &'a [bool],
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
    fn settle(&mut self) {}
}

/// One correction.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Correction {
    /// The first one on its level: all charts take part again.
    pub first: bool,
    /// Sweeps after the step.
    pub sweeps: u32,
    /// A chart that gains less than this share of its energy sits out the level's further corrections.
    pub tolerance: f32,
}

impl Correction {
    /// The share of the next correction's step that a chart is to take; 0: it sits out the level's further corrections.
    /// It does so if this one gained too little, or if it was the first and gained what its quadratic model had foretold:
    /// the next one would gain about what the model missed, which on scenes with room is under 0.1 % of the energy after
    /// a gain of 5 to 25 %, and in crowded ones, where steps are cut, 1 to 3 %. In between the share rises smoothly, so
    /// that a warp does not jump from frame to frame where a chart crosses the line.
    pub fn next(&self, energy: f64, gain: f64, predicted: f64) -> f32 {
        let tolerance = f64::from(self.tolerance) * energy;
        // A comparison with NaN is false: no gain.
        let gained = gain > tolerance;
        match (gained, self.first) {
            (false, _) => 0.0,
            (true, false) => 1.0,
            (true, true) => {
                let missed = (gain - predicted).abs() / tolerance;
                ((missed - FORETOLD[0]) / (FORETOLD[1] - FORETOLD[0])).clamp(0.0, 1.0) as f32
            }
        }
    }
}

/// How far a first correction's gain may be from what its model foretold, in tolerances: up to the first there is no
/// further correction, from the second on a whole one.
const FORETOLD: [f64; 2] = [0.1, 0.9];

/// How much work to do.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Plan {
    /// Sweeps before and after each correction.
    pub sweeps: u32,
    /// Corrections on the finest level and on the others.
    pub corrections: [u32; 2],
    pub tolerance: f32,
    /// The paper's solver in place of these, with all of its settings.
    pub pbd: Option<PbdSettings>,
    pub warm: bool,
    pub budget: Option<Duration>,
}

impl Plan {
    pub fn new(options: &SolveOptions) -> Plan {
        let pbd = (options.solver == Solver::Pbd).then(|| options.pbd.resolved());
        // A chart with room is done after one or two corrections; the others go to crowded ones, which need them.
        let (sweeps, corrections, tolerance) = match options.quality {
            Quality::Draft => (4, [0, 0], 0.0),
            Quality::Normal => (2, [4, 1], 3e-3),
            Quality::High => (4, [12, 2], 2e-4),
        };
        let cap = |n: u32| if options.max_corrections > 0 { options.max_corrections } else { n };
        // What a solver does not look at must not make two plans differ.
        let of_descent = pbd.is_none();
        Plan {
            sweeps: if of_descent { sweeps } else { 0 },
            corrections: if of_descent { corrections.map(cap) } else { [0; 2] },
            tolerance: match options.tolerance {
                _ if !of_descent => 0.0,
                0.0 => tolerance,
                own => own,
            },
            pbd,
            warm: options.warm,
            // A budget beyond what a duration can hold is none.
            budget: Some(options.time_budget_ms)
                .filter(|&ms| ms > 0.0)
                .and_then(|ms| Duration::try_from_secs_f32(ms / 1000.0).ok()),
        }
    }

    pub fn solver(&self) -> Solver {
        if self.pbd.is_some() { Solver::Pbd } else { Solver::Descent }
    }
}

/// What the schedule did.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(crate) struct Outcome {
    pub times: StageTimes,
    pub sweeps: u32,
    pub corrections: u32,
    pub truncated: bool,
}

/// Runs the schedule. The plan's budget counts from `start`.
pub(crate) fn run(stages: &mut impl Stages, plan: &Plan, warm: bool, start: Instant) -> Outcome {
    let mut outcome = Outcome::default();
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
            None => descend(stages, plan, level, start, &mut outcome, &mut times),
            Some(settings) => {
                let late = |stages: &mut _| is_late(stages, plan, start);
                timed(&mut times.pbd, || {
                    pbd::level(stages, settings, level, coarsest, late, &mut outcome);
                });
            }
        }
    }
    timed(&mut times.certify, || stages.certify(plan.pbd.is_some()));
    outcome.times = times;
    outcome
}

/// Relaxation and corrections of a level.
fn descend(
    stages: &mut impl Stages,
    plan: &Plan,
    level: usize,
    start: Instant,
    outcome: &mut Outcome,
    times: &mut StageTimes,
) {
    for step in 0..=plan.corrections[usize::from(level > 0)] {
        // Past the budget only prolongation is left: the state so far becomes the result.
        if is_late(stages, plan, start) {
            outcome.truncated = true;
            break;
        }
        outcome.sweeps += plan.sweeps;
        if step == 0 {
            timed(&mut times.relax, || stages.relax(level, plan.sweeps));
        } else {
            let correction = Correction { first: step == 1, sweeps: plan.sweeps, tolerance: plan.tolerance };
            timed(&mut times.correct, || stages.correct(level, &correction));
            outcome.corrections += 1;
        }
    }
}

/// True past the time budget.
fn is_late(stages: &mut impl Stages, plan: &Plan, start: Instant) -> bool {
    plan.budget.is_some_and(|budget| {
        stages.settle();
        start.elapsed() > budget
    })
}

fn timed(sum: &mut f32, f: impl FnOnce()) {
    let start = Instant::now();
    f();
    *sum += start.elapsed().as_secs_f32() * 1000.0;
}
