//! What a time budget leaves time for (method §5). The work of a solve is predicted from what earlier solves of the
//! device took for a block of nodes, so that enough time is kept for bringing the best level up and certifying it. Without
//! a budget nothing depends on a clock.

use crate::allocation::Grow;

use std::time::{Duration, Instant};

/// Kinds of work that take different times per block. `Finest` stands for work on level 0, which samples chords.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Work {
    Surface,
    Pyramid,
    Prolong,
    Skip,
    Relax,
    Correct,
    Iterate,
    FinestStart,
    FinestRelax,
    FinestFirst,
    FinestFurther,
    FinestIterate,
    Certify,
    CertifyKnown,
}

impl Work {
    /// Work that does much the same and is part of each solve, for work that few solves do.
    fn relative(self) -> Option<Work> {
        match self {
            Work::Skip => Some(Work::Prolong),
            Work::Certify | Work::CertifyKnown | Work::FinestRelax => Some(Work::FinestStart),
            Work::FinestFurther => Some(Work::FinestFirst),
            _ => None,
        }
    }
}

const KINDS: usize = Work::CertifyKnown as usize + 1;

/// Seconds that any stage takes at least: waking threads, lists of charts.
const LEAST: f64 = 50e-6;

/// Microseconds per block (256 triangles, for the surface) of a solve that nothing is known of: on two cores at 2.5 GHz,
/// rounded up. What a solve measures on its coarse levels corrects them, before its finer levels are begun.
const BUILT_IN: [f64; KINDS] =
    [20.0, 25.0, 15.0, 2.0, 10.0, 60.0, 12.0, 30.0, 8.0, 80.0, 60.0, 12.0, 18.0, 6.0];

/// The first use of memory costs its pages: more than work on memory in use by up to this factor.
const FRESH: f64 = 3.0;

/// Fewer blocks than these tell nothing of the time of many.
const ENOUGH: f64 = 24.0;

/// Predictions are multiplied by this: charts and poses differ.
const MARGIN: f64 = 1.15;

/// Seconds per block by kind, on memory in use and on fresh memory; as far as measured.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct Costs([[Option<f64>; 2]; KINDS]);

impl Costs {
    /// Takes a measurement in: at once if the work has become slower, bit by bit if quicker.
    fn learn(&mut self, work: Work, fresh: bool, rate: f64) {
        let cost = &mut self.0[work as usize][usize::from(fresh)];
        *cost = Some(match *cost {
            Some(known) if rate < known => known + 0.3 * (rate - known),
            Some(known) => known + 0.7 * (rate - known),
            None => rate,
        });
    }

    /// Lowers all costs a little, after a solve that was not begun for want of time: it measured nothing, and a moment in
    /// which the machine was busy must not keep all later solves from being tried.
    fn doubt(&mut self) {
        self.0.iter_mut().flatten().flatten().for_each(|rate| *rate *= 0.95);
    }

    /// Seconds per block, and whether they were measured.
    fn rate(&self, work: Work, fresh: bool) -> (f64, bool) {
        let [used, new] = self.0[work as usize];
        let built_in = BUILT_IN[work as usize] * 1e-6;
        match (fresh, used, new) {
            (true, _, Some(rate)) | (false, Some(rate), _) => (rate, true),
            (true, Some(rate), None) => (rate * FRESH, true),
            (_, None, _) => {
                let factor = if fresh { FRESH } else { 1.0 };
                match work.relative().and_then(|kin| Some((kin, self.0[kin as usize][0]?))) {
                    Some((kin, rate)) => (built_in * factor * rate / (BUILT_IN[kin as usize] * 1e-6), true),
                    None => (built_in * factor, false),
                }
            }
        }
    }
}

/// Which kinds of work a tile's memory has been used for, per level.
#[derive(Clone, Debug, Default)]
pub(crate) struct History(Vec<[bool; KINDS]>);

impl History {
    fn is_fresh(&self, work: Work, level: usize) -> bool {
        !self.0.get(level).is_some_and(|done| done[work as usize])
    }

    fn mark(&mut self, work: Work, level: usize) {
        if self.0.len() <= level {
            self.0.fill_to(level + 1, [false; KINDS]);
        }
        self.0[level][work as usize] = true;
    }
}

/// A solve's view of the time.
#[derive(Clone, Debug)]
pub(crate) struct Clock {
    /// When the time is up, and when it is up beyond doubt: by then a result that takes more time is given up.
    ends: Option<[Instant; 2]>,
    pub costs: Costs,
    pub history: History,
    /// Seconds of this solve's work, as predicted from measured and from built-in costs, and as it turned out.
    measured: [f64; 2],
    built_in: [f64; 2],
}

impl Clock {
    /// For a solve that began at `start` and may take so long.
    pub fn new(start: Instant, budget: Option<Duration>, costs: Costs, history: History) -> Clock {
        let ends = budget.and_then(|budget| {
            // The rest of the fifth and of the 5 ms that the API allows is for what comes after the solve.
            let over = budget.mul_f64(1.17).saturating_add(Duration::from_millis(3));
            Some([start.checked_add(budget)?, start.checked_add(over)?])
        });
        Clock { ends, costs, history, measured: [0.0; 2], built_in: [0.0; 2] }
    }

    /// Without a budget.
    #[cfg(all(feature = "lab", feature = "gpu"))]
    pub fn unlimited() -> Clock {
        Clock::new(Instant::now(), None, Costs::default(), History::default())
    }

    pub fn is_limited(&self) -> bool {
        self.ends.is_some()
    }

    /// Seconds that work on `blocks` blocks of a level will take.
    pub fn predict(&self, work: Work, level: usize, blocks: f64) -> f64 {
        let (rate, known) = self.costs.rate(work, self.history.is_fresh(work, level));
        // The machine may be busier than when the costs were measured, and another one than the built-in costs are of.
        let busy = ratio(self.measured).unwrap_or(1.0).clamp(1.0, 4.0);
        let speed = ratio(self.built_in).unwrap_or(1.0).clamp(0.2, 20.0);
        LEAST + rate * blocks * if known { busy } else { speed }
    }

    /// Whether work of so many seconds fits into what is left of the budget.
    pub fn fits(&self, seconds: f64) -> bool {
        self.ends.is_none_or(|[end, _]| within(end, seconds * MARGIN))
    }

    /// Whether work of so many seconds cannot be done any more, come what may.
    pub fn is_over(&self, seconds: f64) -> bool {
        self.ends.is_some_and(|[_, end]| !within(end, seconds))
    }

    /// When work has to stop that is followed by so many seconds of further work.
    pub fn stop_before(&self, seconds: f64) -> Option<Instant> {
        let [end, _] = self.ends?;
        Some(end.checked_sub(Duration::from_secs_f64(seconds)).unwrap_or_else(Instant::now))
    }

    /// Takes in that a solve was not begun for want of so many seconds. If it is not a matter of a few times the budget,
    /// the costs are not to blame.
    pub fn doubt(&mut self, seconds: f64) {
        if self.fits(seconds / 6.0) {
            self.costs.doubt();
        }
    }

    /// Takes in that work took so many seconds.
    pub fn learn(&mut self, work: Work, level: usize, blocks: f64, seconds: f64) {
        let fresh = self.history.is_fresh(work, level);
        self.history.mark(work, level);
        if blocks < ENOUGH {
            return;
        }
        let spent = (seconds - LEAST).max(0.0);
        let (rate, known) = self.costs.rate(work, fresh);
        let sums = if known { &mut self.measured } else { &mut self.built_in };
        sums[0] += rate * blocks;
        sums[1] += spent;
        self.costs.learn(work, fresh, spent / blocks);
    }
}

fn within(end: Instant, seconds: f64) -> bool {
    let left = end.saturating_duration_since(Instant::now());
    seconds <= left.as_secs_f64()
}

/// What was measured over what was predicted, if something was.
fn ratio([predicted, measured]: [f64; 2]) -> Option<f64> {
    (predicted > 0.0).then(|| measured / predicted)
}
