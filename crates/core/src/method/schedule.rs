//! The schedule of a solve (method §5), written once for both backends: surface; pyramid; on each level, coarsest
//! first, its start and its steps, which are corrections or relaxation alone, or the iterations of the paper's solver;
//! certify. A draft ends its steps on level 1, and is interpolated from there.
//!
//! Once the time is over, no further level is begun but small ones, and no further step of a level. The finest level
//! that was reached is then interpolated to level 0 and certified.

use super::cost::Costs;
use super::deadline::Deadline;
use super::plan::{Input, Plan, Summary};
use super::progress::Progress;
use super::stage::{Stage, Stages, Start};

/// Blocks of 16 x 16 nodes up to which a level is solved even if the time is over, as the coarsest level always is.
pub const SMALL_LEVEL_BLOCKS: usize = 16;

/// Runs the schedule; a `warm` solve starts from the previous result, on level 0.
pub fn run(
    stages: &mut impl Stages,
    input: &Input,
    plan: &Plan,
    warm: bool,
    deadline: &Deadline,
    progress: &mut Progress,
) -> Summary {
    let coarsest = if warm { 0 } else { plan.coarsest(input.grid) };
    let costs = Costs::new(input);
    progress.begin(costs.whole(plan, coarsest));
    let mut solve = Solve { stages, costs, deadline, progress, summary: Summary::default() };
    solve.run(&Stage::Surface);
    solve.run(&Stage::Pyramid { coarsest });
    let mut reached = coarsest;
    for level in (plan.finest.min(coarsest)..=coarsest).rev() {
        let is_small = input.grid.levels[level].blocks.list.len() <= SMALL_LEVEL_BLOCKS;
        if level < coarsest && !is_small && solve.is_over() {
            solve.summary.truncated = true;
            break;
        }
        solve.run(&match level {
            _ if level < coarsest => plan.start(level),
            _ if warm => Stage::Start { level, from: Start::Previous },
            _ => Stage::Start { level, from: Start::Identity },
        });
        solve.steps(plan, level, warm);
        reached = level;
    }
    let allow_folds = plan.pbd.is_some();
    if reached > 0 {
        solve.run(&Stage::Energies { level: reached, allow_folds });
    }
    for level in (0..reached).rev() {
        solve.run(&Stage::Start { level, from: Start::Passing });
    }
    solve.run(&Stage::Certify { allow_folds });
    solve.summary
}

/// A solve that is under way.
struct Solve<'a, S> {
    stages: &'a mut S,
    costs: Costs,
    deadline: &'a Deadline,
    progress: &'a mut Progress,
    summary: Summary,
}

impl<S: Stages> Solve<'_, S> {
    /// Runs a stage, and records its time.
    fn run(&mut self, stage: &Stage) {
        self.progress.check_or_unwind();
        let start = self.deadline.now();
        self.progress.during(self.costs.of(stage), || self.stages.run(stage));
        self.summary.count(stage, (self.deadline.now() - start).as_secs_f64());
    }

    /// Does the steps of a level, of which the first is always done.
    fn steps(&mut self, plan: &Plan, level: usize, warm: bool) {
        for n in 0.. {
            let Some(step) = plan.step(level, n, warm) else { return };
            if n > 0 && self.is_over() {
                self.summary.truncated = true;
                if let Some(last) = step.last_instead() {
                    self.run(&last);
                }
                return;
            }
            self.run(&step);
        }
    }

    /// True if the time is over, once all stages so far are done.
    fn is_over(&mut self) -> bool {
        if self.deadline.is_limited() {
            self.stages.wait();
        }
        self.deadline.is_over()
    }
}
