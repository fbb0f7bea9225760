//! The schedule of a solve (method §5), written once for both backends: surface; pyramid; on each level, coarsest first,
//! its start and its steps, which are corrections or relaxation alone, or the iterations of the paper's solver; certify. A
//! draft ends its steps on level 1, and is interpolated from there.
//!
//! With a time budget the schedule asks before each step whether there is time for it and for making a result of it
//! (`deadline`). If not, the best level so far is interpolated to level 0 and certified.

use std::time::Instant;

use super::cost::Costs;
use super::deadline::Deadline;
use super::law::SWEEPS_PER_PASS;
use super::plan::{Input, Plan, Summary};
use super::progress::Progress;
use super::stage::{Stage, Stages, Start};

/// Runs the schedule; a `warm` solve starts from the previous result, on level 0.
pub fn run(
    stages: &mut impl Stages,
    input: &Input,
    plan: &Plan,
    warm: bool,
    deadline: &mut Deadline,
    progress: &mut Progress,
) -> Summary {
    let coarsest = if warm { 0 } else { input.grid.levels.len() - 1 };
    let costs = Costs::new(input, plan.pbd.is_some());
    progress.begin(costs.whole(plan, coarsest));
    let mut run = Schedule { stages, plan, costs, deadline, progress, summary: Summary::default() };
    if !run.deadline.may_begin(run.costs.least(plan, coarsest)) {
        return run.give_up();
    }
    run.stage(&Stage::Surface);
    run.stage(&Stage::Pyramid);
    if run.deadline.is_over(run.costs.result_of(coarsest)) {
        return run.give_up();
    }
    let mut reached = coarsest;
    let finest = plan.finest.min(coarsest);
    for level in (finest..=coarsest).rev() {
        let start = match level {
            _ if level < coarsest => plan.start(level),
            _ if warm => Stage::Start { level, from: Start::Previous },
            _ => Stage::Start { level, from: Start::Identity },
        };
        // A level without time for a step is of no use.
        if level < coarsest && !run.may_start(level, warm, run.costs.of(&start)) {
            run.summary.truncated = true;
            break;
        }
        run.stage(&start);
        run.steps(level, warm);
        reached = level;
        if run.summary.truncated {
            break;
        }
    }
    // There was no time for any work: the identity needs no certificate.
    if run.summary.truncated && !warm && run.summary.sweeps == 0 {
        return run.give_up();
    }
    let allow_folds = plan.pbd.is_some();
    if run.deadline.is_over(run.costs.result_of(reached)) {
        return run.give_up();
    }
    if reached > 0 {
        run.stage(&Stage::Energies { level: reached, allow_folds });
    }
    for level in (0..reached).rev() {
        run.stage(&Stage::Start { level, from: Start::Passing });
    }
    let certify = Stage::Certify { allow_folds };
    if run.deadline.is_over(run.costs.of(&certify)) {
        return run.give_up();
    }
    run.stage(&certify);
    run.summary
}

/// The greatest number of relaxation stages that replace a level's first correction. Each of them gains less than the one
/// before.
const MOST_INSTEAD: u32 = 8;

/// The relaxation stage that can replace this step if there is no time for it. Only a level's first correction has one.
fn instead(step: &Stage) -> Option<Stage> {
    match *step {
        Stage::Correct { level, ref correction, .. } if correction.first => {
            Some(Stage::Relax { level, sweeps: correction.sweeps })
        }
        _ => None,
    }
}

/// A schedule in progress.
struct Schedule<'a, S> {
    stages: &'a mut S,
    plan: &'a Plan,
    costs: Costs,
    deadline: &'a mut Deadline,
    progress: &'a mut Progress,
    summary: Summary,
}

impl<S: Stages> Schedule<'_, S> {
    /// Runs a stage and records its time. Returns false if it ended early.
    fn stage(&mut self, stage: &Stage) -> bool {
        self.progress.check_or_unwind();
        let cost = self.costs.of(stage);
        let start = Instant::now();
        let whole = self.progress.during(cost, || self.stages.run(stage));
        if self.deadline.is_limited() {
            self.stages.wait();
        }
        let seconds = start.elapsed().as_secs_f64();
        *stage.kind().of(&mut self.summary.times) += seconds as f32 * 1000.0;
        if whole && self.costs.is_typical(stage) {
            self.deadline.learn(cost, seconds);
        }
        whole
    }

    /// True if there is time for a level's first step after work of this cost, or for relaxation in its place.
    fn may_start(&self, level: usize, warm: bool, before: f64) -> bool {
        let fits = |step: Stage| self.has_time_for(before + self.costs.of(&step), level);
        self.plan.step(level, 0, warm).is_some_and(|step| fits(step) || instead(&step).is_some_and(fits))
    }

    /// Does a level's steps, as far as time allows.
    fn steps(&mut self, level: usize, warm: bool) {
        for n in 0.. {
            let Some(mut step) = self.plan.step(level, n, warm) else { return };
            if !self.has_time_for(self.costs.of(&step), level) {
                self.relax_instead(&step);
                self.summary.truncated = true;
                return;
            }
            match &mut step {
                Stage::Relax { sweeps, .. } => self.summary.sweeps += *sweeps,
                Stage::Correct { stop, .. } => *stop = self.deadline.stop_before(self.costs.result_of(level)),
                // The last iteration does not predict, so it must be known beforehand to be the last.
                Stage::Iterate { iteration, .. } => {
                    self.summary.sweeps += 1;
                    let two = 2.0 * self.costs.first_step(self.plan, level);
                    if !iteration.last && !self.has_time_for(two, level) {
                        (iteration.last, iteration.regularise) = (true, true);
                        self.summary.truncated = true;
                    }
                }
                _ => {}
            }
            self.summary.truncated |= !self.stage(&step);
            if self.summary.truncated {
                return;
            }
            if let Stage::Correct { correction, .. } = step {
                self.summary.sweeps += correction.sweeps;
                self.summary.corrections += 1;
            }
        }
    }

    /// Replaces a level's first correction, for which there is no time, by as many relaxation stages as there is time for.
    fn relax_instead(&mut self, step: &Stage) {
        let Some(Stage::Relax { level, sweeps }) = instead(step) else { return };
        for _ in 0..MOST_INSTEAD {
            let relax = Stage::Relax { level, sweeps };
            if !self.has_time_for(self.costs.of(&relax), level) {
                return;
            }
            self.stage(&relax);
            self.summary.sweeps += sweeps;
        }
    }

    /// True if there is time for stages of this cost on a level and for making a result of the level.
    fn has_time_for(&self, cost: f64, level: usize) -> bool {
        self.deadline.fits(cost + self.costs.result_of(level))
    }

    /// Makes the identity the result, for lack of time.
    fn give_up(mut self) -> Summary {
        self.stages.run(&Stage::GiveUp);
        self.summary.truncated = true;
        self.summary
    }
}

/// The number of sweeps of each pass over a level.
pub fn passes(sweeps: u32) -> impl Iterator<Item = u32> {
    (0..sweeps).step_by(SWEEPS_PER_PASS as usize).map(move |done| (sweeps - done).min(SWEEPS_PER_PASS))
}
