//! The schedule of a solve (method §5), written once for both backends: surface; pyramid; on each level, coarsest
//! first, its start and its steps, which are corrections or relaxation alone, or the iterations of the paper's solver;
//! certify. A draft ends its steps on level 1, and is interpolated from there.
//!
//! With a time budget, only steps are begun that leave time for making a result of their level (`timed`). After the
//! first one that does not, the best level so far is interpolated to level 0 and certified.

use std::iter::repeat_n;

use super::deadline::Deadline;
use super::plan::{Input, Plan, Summary};
use super::progress::Progress;
use super::stage::{Stage, Stages, Start};
use super::timed::Timed;

/// Runs the schedule; a `warm` solve starts from the previous result, on level 0.
pub fn run(
    stages: &mut impl Stages,
    input: &Input,
    plan: &Plan,
    warm: bool,
    deadline: &mut Deadline,
    progress: &mut Progress,
) -> Summary {
    let coarsest = if warm { 0 } else { plan.coarsest(input.grid) };
    let mut timed = Timed::new(stages, input, plan, coarsest, deadline, progress);
    if !solve(&mut timed, plan, warm, coarsest) {
        timed.run(&Stage::GiveUp);
        timed.summary.truncated = true;
    }
    timed.summary
}

/// Returns false if there is no time for a result.
fn solve(timed: &mut Timed<impl Stages>, plan: &Plan, warm: bool, coarsest: usize) -> bool {
    if !timed.may_begin(plan, coarsest) {
        return false;
    }
    timed.run(&Stage::Surface);
    // Level 0 has what it loses of its weight from level 1.
    timed.run(&Stage::Pyramid { coarsest: coarsest.max(1) });
    let mut reached = coarsest;
    'levels: for level in (plan.finest.min(coarsest)..=coarsest).rev() {
        let mut start = Some(match level {
            _ if level < coarsest => plan.start(level),
            _ if warm => Stage::Start { level, from: Start::Previous },
            _ => Stage::Start { level, from: Start::Identity },
        });
        if level == coarsest {
            start.take().iter().for_each(|start| timed.run(start));
        }
        for n in 0.. {
            let Some(step) = plan.step(level, n, warm) else { break };
            if !try_step(timed, &mut start, step, warm) {
                let relax = step.instead().into_iter();
                relax.for_each(|relax| {
                    _ = (0..MOST_INSTEAD).all(|_| try_step(timed, &mut start, relax, warm))
                });
            }
            if start.is_none() {
                reached = level;
            }
            if timed.summary.truncated {
                break 'levels;
            }
        }
    }
    let Summary { truncated, sweeps, corrections, .. } = timed.summary;
    // The identity needs no certificate.
    if truncated && !warm && sweeps + corrections == 0 || !timed.may_end(reached) {
        return false;
    }
    let allow_folds = plan.pbd.is_some();
    if reached > 0 {
        timed.run(&Stage::Energies { level: reached, allow_folds });
    }
    for level in (0..reached).rev() {
        timed.run(&Stage::Start { level, from: Start::Passing });
    }
    timed.run(&Stage::Certify { allow_folds });
    true
}

/// Does a step, after its level's start unless that was done, if there is time. A level without time for a step is not
/// started.
fn try_step(timed: &mut Timed<impl Stages>, start: &mut Option<Stage>, mut step: Stage, warm: bool) -> bool {
    let stages = |n| start.iter().chain(repeat_n(&step, n));
    // Without a step there is no result, so the first one may take the grace period, as in `may_begin`.
    let is_first = start.is_none() && timed.summary.sweeps + timed.summary.corrections == 0;
    let once = timed.fits(stages(1), step.level(), is_first && !warm);
    let twice = timed.fits(stages(2), step.level(), false);
    timed.summary.truncated |= !once;
    // The last iteration does not predict, so it must be known beforehand to be the last.
    if let Stage::Iterate { iteration, .. } = &mut step
        && !iteration.last
        && !twice
    {
        (iteration.last, iteration.regularise) = (true, true);
        timed.summary.truncated = true;
    }
    if once {
        start.take().iter().chain([&step]).for_each(|stage| timed.run(stage));
    }
    once
}

/// The greatest number of relaxations in the place of a correction: each gains less than the one before.
const MOST_INSTEAD: usize = 8;
