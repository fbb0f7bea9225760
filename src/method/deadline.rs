//! Time budgets: how long stages of known cost (`cost`) take here and now, and what still fits into a solve's budget. Without a
//! budget nothing depends on a clock.

use std::time::{Duration, Instant};

/// Seconds that any stage takes at least: waking threads, lists of charts.
const LEAST: f64 = 50e-6;
/// Seconds of cost for which the pace of earlier solves counts against what this solve measures.
const PRIOR: f64 = 500e-6;
/// The first use of memory costs its pages.
const FRESH: f64 = 1.5;
/// Predictions are multiplied by this: charts and poses differ.
const MARGIN: f64 = 1.1;

/// The time that a solve may take, and its pace.
#[derive(Clone, Debug)]
pub(crate) struct Deadline {
    /// When the time is up, and when it is up beyond doubt: by then a result that takes more time is given up.
    ends: Option<[Instant; 2]>,
    /// Seconds per second of cost, as earlier solves of the device measured it.
    prior: f64,
    /// Seconds of this solve's stages: by their cost, and as measured.
    cost: f64,
    measured: f64,
    fresh: f64,
}

impl Deadline {
    /// For a solve that began at `start` and may take so long, on a device of this pace; `fresh` if its memory has never been
    /// used.
    pub fn new(start: Instant, budget: Option<Duration>, pace: f64, fresh: bool) -> Deadline {
        let ends = budget.and_then(|budget| {
            // The rest of the fifth and of the 5 ms that the API allows is for what comes after the solve.
            let over = budget.mul_f64(1.17).saturating_add(Duration::from_millis(3));
            Some([start.checked_add(budget)?, start.checked_add(over)?])
        });
        let fresh = if fresh { FRESH } else { 1.0 };
        Deadline { ends, prior: pace, cost: 0.0, measured: 0.0, fresh }
    }

    /// Without a budget.
    #[cfg(all(feature = "lab", feature = "gpu"))]
    pub fn unlimited() -> Deadline {
        Deadline::new(Instant::now(), None, 1.0, false)
    }

    pub fn is_limited(&self) -> bool {
        self.ends.is_some()
    }

    /// Seconds per second of cost.
    fn pace(&self) -> f64 {
        (self.prior * self.fresh * PRIOR + self.measured) / (PRIOR + self.cost)
    }

    /// The pace for the device's next solves. It follows a slower pace soon, a quicker one slowly.
    pub fn learnt(&self) -> f64 {
        let now = self.pace() / self.fresh;
        if self.cost == 0.0 {
            return self.prior;
        }
        self.prior + if now > self.prior { 0.7 } else { 0.3 } * (now - self.prior)
    }

    fn seconds(&self, cost: f64) -> f64 {
        LEAST + cost * 1e-6 * self.pace()
    }

    /// Whether stages of some cost fit into what is left of the budget.
    pub fn fits(&self, cost: f64) -> bool {
        self.ends.is_none_or(|[end, _]| within(end, self.seconds(cost) * MARGIN))
    }

    /// Whether stages of some cost cannot be done any more, come what may.
    pub fn is_over(&self, cost: f64) -> bool {
        self.ends.is_some_and(|[_, end]| !within(end, self.seconds(cost)))
    }

    /// Whether a solve that costs at least this much is worth its beginning. If not, the pace is taken for a little quicker
    /// afterwards, unless the budget is hopeless: nothing was measured, and a moment in which the machine was busy must
    /// not keep all later solves from being tried.
    pub fn may_begin(&mut self, least: f64) -> bool {
        let begins = !self.is_over(least);
        if !begins && self.fits(least / 6.0) {
            self.prior *= 0.95;
        }
        begins
    }

    /// When a stage has to stop that is followed by others of some cost.
    pub fn stop_before(&self, cost: f64) -> Option<Instant> {
        let [end, _] = self.ends?;
        let seconds = Duration::from_secs_f64(self.seconds(cost));
        Some(end.checked_sub(seconds).unwrap_or_else(Instant::now))
    }

    /// Takes in that a stage of some cost took so many seconds.
    pub fn learn(&mut self, cost: f64, seconds: f64) {
        if self.is_limited() {
            self.cost += cost * 1e-6;
            self.measured += (seconds - LEAST).max(0.0);
        }
    }
}

fn within(end: Instant, seconds: f64) -> bool {
    seconds <= end.saturating_duration_since(Instant::now()).as_secs_f64()
}
