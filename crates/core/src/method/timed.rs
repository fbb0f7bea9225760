//! The stages of a solve, with the time that they take: for reports, for progress, and for time budgets.

use super::cost::Costs;
use super::deadline::Deadline;
use super::plan::{Input, Plan, Summary};
use super::progress::Progress;
use super::stage::{Stage, Stages};

/// Factor on the time of a level's first correction where charts are crowded.
const CROWDED_FACTOR: f64 = 1.3;

/// A backend whose stages are timed.
pub struct Timed<'a, S> {
    stages: &'a mut S,
    costs: Costs,
    deadline: &'a mut Deadline,
    progress: &'a mut Progress,
    /// Cost of the last correction, in seconds at a pace of 1.
    correction: f64,
    pub summary: Summary,
}

impl<'a, S: Stages> Timed<'a, S> {
    pub fn new(
        stages: &'a mut S,
        input: &Input,
        plan: &Plan,
        coarsest: usize,
        deadline: &'a mut Deadline,
        progress: &'a mut Progress,
    ) -> Timed<'a, S> {
        let costs = Costs::new(input, plan.pbd.is_some());
        progress.begin(costs.whole(plan, coarsest));
        Timed { stages, costs, deadline, progress, correction: 0.0, summary: Summary::default() }
    }

    /// Runs a stage and records its time.
    pub fn run(&mut self, stage: &Stage) {
        self.progress.check_or_unwind();
        let (cost, start) = (self.costs.of(stage), self.deadline.now());
        self.progress.during(cost, || self.stages.run(stage));
        if self.deadline.is_limited() {
            self.stages.wait();
        }
        let seconds = (self.deadline.now() - start).as_secs_f64();
        self.summary.count(stage, seconds);
        if self.costs.is_typical(stage) {
            self.deadline.learn(cost, seconds);
        }
        if matches!(stage, Stage::Correct { .. }) {
            self.correction = self.deadline.cost_of(seconds);
        }
    }

    /// True if there is time for a result of the coarsest level.
    pub fn may_begin(&mut self, plan: &Plan, coarsest: usize) -> bool {
        self.deadline.may_begin(self.costs.least(plan, coarsest))
    }

    /// True if there is time for stages on a level and for making a result of the level; `in_grace` if both may end
    /// within the grace period.
    pub fn fits<'b>(&self, stages: impl Iterator<Item = &'b Stage>, level: usize, in_grace: bool) -> bool {
        let most = |stage: &Stage| match stage {
            Stage::Correct { correction, .. } if correction.first => CROWDED_FACTOR * self.costs.of(stage),
            // Charts may skip it, but need not.
            Stage::Correct { .. } => self.correction,
            _ => self.costs.of(stage),
        };
        let cost = stages.map(most).sum::<f64>() + self.costs.result_of(level);
        if in_grace { !self.deadline.is_over(cost) } else { self.deadline.fits(cost) }
    }

    /// True if a result of a level can be made within the grace period.
    pub fn may_end(&self, level: usize) -> bool {
        !self.deadline.is_over(self.costs.result_of(level))
    }
}
