//! The schedule of a solve (method §5), written once for the stages that both backends implement: surface; pyramid; on
//! each level, coarsest first, prolong, then correct, or relax alone; certify. The paper's solver has a schedule of its
//! own on each level (`pbd`).

use std::time::{Duration, Instant};

use super::acceptance::Correction;
use super::budget::{Clock, Work};
use super::law::SWEEPS_PER_PASS;
use super::progress::Progress;
pub(crate) use super::stages::Stages;
use crate::grid::Grid;
use crate::grid::pose::Pose;
use crate::mesh::TileMesh;
use crate::report::StageTimes;
use crate::settings::{PbdValues, Quality, SolveOptions, Solver, TileSettings};

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

/// Runs the schedule.
pub(crate) fn run(
    stages: &mut impl Stages,
    plan: &Plan,
    warm: bool,
    clock: &mut Clock,
    progress: &mut Progress,
) -> Summary {
    let coarsest = if warm { 0 } else { stages.levels() - 1 };
    let (summary, state_is_corrected) = (Summary::default(), false);
    let forecast = progress.is_told().then(|| clock.clone());
    let mut run = Schedule { stages, plan, clock, progress, forecast, coarsest, summary, state_is_corrected };
    if run.progress.is_told() {
        let seconds = run.expected();
        run.progress.begin(seconds);
    }
    let least = run.least(warm);
    if !run.clock.fits(least) {
        run.clock.doubt(least);
        return run.give_up();
    }
    run.stage(Work::Surface, 0, |times| &mut times.surface, |stages| stages.surface());
    run.stage(Work::Pyramid, 0, |times| &mut times.pyramid, |stages| stages.pyramid());
    let mut reached = coarsest;
    for level in (0..=coarsest).rev() {
        if level < coarsest && !run.has_time_for(level) {
            run.summary.truncated = true;
            break;
        }
        if level == 0 && run.clock.is_over(run.start(0) + run.certificate()) {
            return run.give_up();
        }
        run.enter(level, warm);
        run.work(level, warm);
        reached = level;
        if run.summary.truncated {
            break;
        }
    }
    if reached > 0 {
        run.bring_up(reached);
        if run.clock.is_over(run.start(0) + run.certificate()) {
            return run.give_up();
        }
        run.enter(0, false);
    }
    if run.clock.is_over(run.certificate()) {
        return run.give_up();
    }
    let work = if run.state_is_corrected { Work::CertifyKnown } else { Work::Certify };
    let allow_folds = plan.pbd.is_some();
    run.stage(work, 0, |times| &mut times.certify, |stages| stages.certify(allow_folds));
    run.summary
}

/// A schedule that is being run.
struct Schedule<'a, S> {
    stages: &'a mut S,
    plan: &'a Plan,
    clock: &'a mut Clock,
    progress: &'a mut Progress,
    /// The clock as it was when the solve began, if its progress is told: the shares of the stages then add up, whatever is
    /// learnt meanwhile.
    forecast: Option<Clock>,
    coarsest: usize,
    summary: Summary,
    /// Whether a correction was the last to change level 0, so that its energy is known.
    state_is_corrected: bool,
}

impl<S: Stages> Schedule<'_, S> {
    /// Runs a stage, and adds the milliseconds that it takes to one of the times.
    fn stage(
        &mut self,
        work: Work,
        level: usize,
        time: impl FnOnce(&mut StageTimes) -> &mut f32,
        stage: impl FnOnce(&mut S),
    ) {
        self.progress.check_or_unwind();
        let blocks = self.blocks(work, level);
        let forecast = self.forecast.as_ref().map_or(0.0, |clock| clock.predict(work, level, blocks));
        let expected = if self.progress.is_told() { self.seconds(work, level) } else { 0.0 };
        let start = Instant::now();
        self.progress.during(forecast, expected, || stage(self.stages));
        if self.clock.is_limited() {
            self.stages.wait();
        }
        let seconds = start.elapsed().as_secs_f64();
        *time(&mut self.summary.times) += seconds as f32 * 1000.0;
        // Without a budget, a GPU has only been told what to do by now. A stage that was stopped tells nothing.
        let tells = self.clock.is_limited() || self.stages.is_done_on_return();
        if tells && !self.stages.was_stopped() {
            self.clock.learn(work, level, blocks, seconds);
        }
        self.state_is_corrected = level == 0 && matches!(work, Work::FinestFirst | Work::FinestFurther);
    }

    /// What the time of a kind of work on a level is proportional to.
    fn blocks(&self, work: Work, level: usize) -> f64 {
        let count = match work {
            Work::Surface => self.stages.triangle_count().div_ceil(256),
            // Each level has a quarter of the blocks of the next finer one.
            Work::Pyramid => self.stages.blocks(1.min(self.stages.levels() - 1)),
            Work::FinestFurther => self.stages.open_blocks(level),
            _ => self.stages.blocks(level),
        };
        let sweeps = self.plan.sweeps[usize::from(level > 0)];
        count as f64 * if matches!(work, Work::Relax | Work::FinestRelax) { f64::from(sweeps) } else { 1.0 }
    }

    fn seconds(&self, work: Work, level: usize) -> f64 {
        self.clock.predict(work, level, self.blocks(work, level))
    }

    /// The kind of work that `n` steps on a level are followed by.
    fn step(&self, level: usize, n: u32) -> Work {
        let finest = level == 0;
        match (self.plan.pbd.is_some(), self.plan.corrections[usize::from(!finest)]) {
            (true, _) if finest => Work::FinestIterate,
            (true, _) => Work::Iterate,
            (false, 0) if finest => Work::FinestRelax,
            (false, 0) => Work::Relax,
            (false, _) if finest && n == 0 => Work::FinestFirst,
            (false, _) if finest => Work::FinestFurther,
            (false, _) => Work::Correct,
        }
    }

    /// Seconds for the start of a level.
    fn start(&self, level: usize) -> f64 {
        self.seconds(if level == 0 { Work::FinestStart } else { Work::Prolong }, level)
    }

    /// Seconds for certifying level 0 as it is.
    fn certificate(&self) -> f64 {
        self.seconds(if self.state_is_corrected { Work::CertifyKnown } else { Work::Certify }, 0)
    }

    /// Seconds for making a result of a level as it is.
    fn finish(&self, level: usize) -> f64 {
        if level == 0 {
            return self.certificate();
        }
        let skips: f64 = (1..level).map(|level| self.seconds(Work::Skip, level)).sum();
        skips + self.start(0) + self.seconds(Work::Certify, 0)
    }

    /// Seconds for the whole solve, if no chart is crowded.
    fn expected(&self) -> f64 {
        let level = |level: usize| {
            let first = self.step(level, 0);
            let steps = self.plan.pbd.map_or(1, |settings| settings.iterations);
            self.start(level) + f64::from(steps) * self.seconds(first, level)
        };
        let before = self.seconds(Work::Surface, 0) + self.seconds(Work::Pyramid, 0);
        before + (0..=self.coarsest).map(level).sum::<f64>() + self.seconds(Work::CertifyKnown, 0)
    }

    /// Seconds for a result of the coarsest level.
    fn least(&self, warm: bool) -> f64 {
        let way = self.seconds(Work::Surface, 0) + self.seconds(Work::Pyramid, 0) + self.start(self.coarsest);
        // The state that a warm solve starts from is a result already.
        let step = if warm { 0.0 } else { self.seconds(self.step(self.coarsest, 0), self.coarsest) };
        way + step + self.finish(self.coarsest)
    }

    /// Whether there is time for a level's start, one step, and making a result of it.
    fn has_time_for(&self, level: usize) -> bool {
        // The finest level's start belongs to making a result, which has its time.
        if level == 0 {
            return true;
        }
        self.clock.fits(self.start(level) + self.seconds(self.step(level, 0), level) + self.finish(level))
    }

    /// Sets the state that a level starts from.
    fn enter(&mut self, level: usize, warm: bool) {
        let work = if level == 0 { Work::FinestStart } else { Work::Prolong };
        let coarsest = self.coarsest;
        self.stage(
            work,
            level,
            |times| &mut times.prolong,
            |stages| {
                if level < coarsest {
                    stages.prolong(level);
                } else if warm {
                    stages.previous();
                } else {
                    stages.identity(level);
                }
            },
        );
    }

    /// Brings the displacements of a level up to level 1.
    fn bring_up(&mut self, from: usize) {
        for level in (1..from).rev() {
            self.stage(Work::Skip, level, |times| &mut times.prolong, |stages| stages.skip(level));
        }
    }

    /// The result is the identity, for want of time.
    fn give_up(mut self) -> Summary {
        self.stages.give_up();
        self.summary.truncated = true;
        self.summary
    }

    /// Does a level's steps.
    fn work(&mut self, level: usize, warm: bool) {
        match self.plan.pbd {
            None => {
                if warm && self.allows(level, Work::FinestRelax) {
                    // On no level has the last frame's result been relaxed for this pose.
                    self.relax(level);
                }
                self.correct(level);
            }
            Some(settings) => self.iterate(&settings, level),
        }
    }

    /// Whether there is time for some work on a level's state and for making a result of it.
    fn allows(&self, level: usize, work: Work) -> bool {
        // After a correction, level 0 has a known energy.
        let known = level == 0 && matches!(work, Work::FinestFirst | Work::FinestFurther);
        let finish = if known { self.seconds(Work::CertifyKnown, 0) } else { self.finish(level) };
        self.clock.fits(self.seconds(work, level) + finish)
    }

    /// Does the iterations of the paper's solver on a level (method §10).
    fn iterate(&mut self, settings: &PbdValues, level: usize) {
        if level < self.coarsest {
            let start = Instant::now();
            self.stages.regularise(level, settings.smoothing);
            self.summary.times.pbd += start.elapsed().as_secs_f32() * 1000.0;
        }
        let work = self.step(level, 0);
        if !self.allows(level, work) {
            self.summary.truncated = true;
            return;
        }
        for n in 0..settings.iterations {
            // The last iteration does not predict, so it has to be known before it that it is the last.
            let two = 2.0 * self.seconds(work, level) + self.finish(level);
            self.summary.truncated = n + 1 < settings.iterations && !self.clock.fits(two);
            let iteration = settings.iteration(level, n, self.summary.truncated);
            self.summary.sweeps += 1;
            self.stage(work, level, |times| &mut times.pbd, |stages| stages.iterate(level, &iteration));
            if self.summary.truncated {
                return;
            }
        }
    }

    fn relax(&mut self, level: usize) {
        let sweeps = self.plan.sweeps[usize::from(level > 0)];
        self.summary.sweeps += sweeps;
        let work = if level == 0 { Work::FinestRelax } else { Work::Relax };
        self.stage(work, level, |times| &mut times.relax, |stages| stages.relax(level, sweeps));
    }

    /// Does the corrections of a level, each with its sweeps; or sweeps alone. No sweeps come before the first
    /// correction: a prolonged state is as good a start as a relaxed one (the gaps of scenes with room are the same or
    /// smaller without).
    fn correct(&mut self, level: usize) {
        let coarser = usize::from(level > 0);
        let (corrections, sweeps) = (self.plan.corrections[coarser], self.plan.sweeps[coarser]);
        for n in 0..corrections.max(1) {
            let work = self.step(level, n);
            // Without time for more, the present state becomes the result.
            if !self.allows(level, work) {
                self.summary.truncated = true;
                break;
            }
            if corrections == 0 {
                self.relax(level);
                continue;
            }
            let Plan { tolerance, trusts_model, .. } = *self.plan;
            let correction = Correction { first: n == 0, sweeps, tolerance, trusts_model };
            let finish = if level == 0 { self.seconds(Work::CertifyKnown, 0) } else { self.finish(level) };
            let stop = self.clock.stop_before(finish);
            self.stage(
                work,
                level,
                |times| &mut times.correct,
                |stages| {
                    stages.stop_at(stop);
                    stages.correct(level, &correction);
                },
            );
            if self.stages.was_stopped() {
                self.summary.truncated = true;
                break;
            }
            self.summary.sweeps += sweeps;
            self.summary.corrections += 1;
        }
    }
}

/// The number of sweeps of each pass over a level.
pub(crate) fn passes(sweeps: u32) -> impl Iterator<Item = u32> {
    (0..sweeps).step_by(SWEEPS_PER_PASS as usize).map(move |done| (sweeps - done).min(SWEEPS_PER_PASS))
}
