//! Time budgets: the actual time of stages of known cost (`cost`), and what still fits into a solve's budget. Without a
//! budget nothing depends on a clock.

use std::time::Duration;

use crate::clock::Instant;

/// Seconds that a stage takes at least, for waking threads and lists of charts.
const LEAST_SECONDS: f64 = 50e-6;
/// Weight of the pace of earlier solves against this solve's measurements, in seconds of cost.
const PRIOR_SECONDS: f64 = 500e-6;
/// Factor for the first use of memory, which also allocates its pages.
const FIRST_USE_FACTOR: f64 = 1.5;
/// Safety factor on predictions, since charts and poses differ.
const PREDICTION_MARGIN: f64 = 1.1;
/// Clamp on the change of a machine's pace from one solve to the next.
const LARGEST_CHANGE: f64 = 2.0;
/// Clamp on a stage's time, in the time that was predicted for it: a machine that was busy for a moment is not a slow
/// one, and a slow one is known after a few stages.
const LARGEST_DELAY: f64 = 2.0;

/// The time that a solve may take, and its pace.
#[derive(Clone, Debug)]
pub struct Deadline {
    /// The end of the time limit, and the end of its grace period, by which a result that takes longer is abandoned.
    ends: Option<[Instant; 2]>,
    /// Seconds per second of cost, as measured by the device's earlier solves.
    prior: f64,
    /// Seconds of this solve's stages: first by their cost, then as measured and limited (`LARGEST_DELAY`).
    cost: f64,
    measured: f64,
    fresh: f64,
    /// The clock; tests have one of their own.
    pub clock: fn() -> Instant,
}

impl Deadline {
    /// The deadline of a solve that is to end `budget` after `start`, the start of a call with the budget `whole`, on a
    /// device of this pace; `fresh` if its memory has never been used.
    pub fn new(start: Instant, [budget, whole]: [Option<Duration>; 2], pace: f64, fresh: bool) -> Deadline {
        let ends = budget.and_then(|budget| {
            // The API allows a fifth more plus 5 ms for the whole call; the rest of that is for work after the solves.
            let most = budget.min(whole.unwrap_or(budget));
            // A budget of microseconds gives the identity at once, and not a result after 3 ms.
            let over = most.mul_f64(1.17).saturating_add(most.min(Duration::from_millis(3)));
            Some([start.checked_add(budget)?, start.checked_add(over)?])
        });
        let fresh = if fresh { FIRST_USE_FACTOR } else { 1.0 };
        Deadline { ends, prior: pace, cost: 0.0, measured: 0.0, fresh, clock: Instant::now }
    }

    /// A deadline without a budget.
    pub fn unlimited() -> Deadline {
        Deadline::new(Instant::now(), [None; 2], 1.0, false)
    }

    pub fn is_limited(&self) -> bool {
        self.ends.is_some()
    }

    pub fn now(&self) -> Instant {
        (self.clock)()
    }

    /// Seconds per second of cost.
    fn pace(&self) -> f64 {
        (self.prior * self.fresh * PRIOR_SECONDS + self.measured) / (PRIOR_SECONDS + self.cost)
    }

    /// The pace for the device's next solves: this solve's, or as near to it as may be. One moment in which the machine
    /// was busy must not spoil all later solves.
    pub fn learnt(&self) -> f64 {
        if self.cost == 0.0 {
            return self.prior;
        }
        (self.pace() / self.fresh).clamp(self.prior / LARGEST_CHANGE, self.prior * LARGEST_CHANGE)
    }

    /// The cost of work that took this many seconds.
    pub fn cost_of(&self, seconds: f64) -> f64 {
        (seconds - LEAST_SECONDS).max(0.0) * 1e6 / self.pace()
    }

    /// True if stages of this cost end before this time at a pace.
    fn within(&self, end: Instant, cost: f64, pace: f64) -> bool {
        LEAST_SECONDS + cost * 1e-6 * pace <= end.saturating_duration_since(self.now()).as_secs_f64()
    }

    /// True if stages of this cost fit into the remaining budget.
    pub fn fits(&self, cost: f64) -> bool {
        self.ends.is_none_or(|[end, _]| self.within(end, cost, PREDICTION_MARGIN * self.pace()))
    }

    /// True if stages of this cost cannot end even within the grace period.
    pub fn is_over(&self, cost: f64) -> bool {
        self.ends.is_some_and(|[_, end]| !self.within(end, cost, self.pace()))
    }

    /// True if a solve of at least this cost can end within the grace period. If only a quicker machine could, this one
    /// is then taken for a quicker one, since nothing was measured.
    pub fn may_begin(&mut self, least: f64) -> bool {
        let begins = !self.is_over(least);
        if !begins && self.prior > 1.0 && self.ends.is_some_and(|[_, end]| self.within(end, least, 1.0)) {
            self.prior = (self.prior / LARGEST_CHANGE).max(1.0);
        }
        begins
    }

    /// Records that a stage of this cost took this many seconds.
    pub fn learn(&mut self, cost: f64, seconds: f64) {
        if self.is_limited() {
            let cost = cost * 1e-6;
            let most = LARGEST_DELAY * cost * self.pace();
            self.cost += cost;
            self.measured += (seconds - LEAST_SECONDS).clamp(0.0, most);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A second of cost, in the unit of costs.
    const SECOND: f64 = 1e6;

    /// A budget so long that the test's own time does not matter.
    fn hundred_seconds(pace: f64) -> Deadline {
        Deadline::new(Instant::now(), [Some(Duration::from_secs(100)); 2], pace, false)
    }

    #[test]
    fn a_prediction_needs_a_margin_to_fit_and_has_grace_before_it_is_over() {
        let deadline = hundred_seconds(2.0);
        assert!(deadline.fits(44.0 * SECOND));
        // 96 seconds are less than the budget, but not by the margin.
        assert!(!deadline.fits(48.0 * SECOND));
        assert!(!deadline.is_over(58.0 * SECOND));
        assert!(deadline.is_over(60.0 * SECOND));
        let unlimited = Deadline::new(Instant::now(), [None; 2], 2.0, false);
        assert!(unlimited.fits(f64::MAX) && !unlimited.is_over(f64::MAX));
    }

    #[test]
    fn measured_stages_replace_the_pace_of_earlier_solves() {
        let mut deadline = hundred_seconds(1.0);
        assert_eq!(deadline.learnt(), 1.0);
        deadline.learn(SECOND, 1.5);
        assert!((deadline.pace() - 1.5).abs() < 0.01, "{}", deadline.pace());
        assert!(deadline.fits(60.0 * SECOND) && !deadline.fits(62.0 * SECOND));
        assert!((deadline.learnt() - 1.5).abs() < 0.01, "{}", deadline.learnt());
        let mut quick = hundred_seconds(4.0);
        quick.learn(SECOND, 1.0);
        assert_eq!(quick.learnt(), 2.0);
    }

    #[test]
    fn a_busy_moment_does_not_make_a_machine_slow() {
        // Of ten equal stages, one takes twenty times as long: the mean would be 2.9.
        let mut deadline = hundred_seconds(1.0);
        (0..10).for_each(|n| deadline.learn(SECOND, if n == 4 { 20.0 } else { 1.0 }));
        assert!(deadline.pace() < 1.25, "{}", deadline.pace());
        // Three stages of growing cost suffice to know a machine that is ten times as slow.
        let mut slow = hundred_seconds(1.0);
        [0.1, 0.4, 1.6].into_iter().for_each(|cost| slow.learn(cost * SECOND, 10.0 * cost));
        assert!((6.0..10.0).contains(&slow.pace()), "{}", slow.pace());
    }

    #[test]
    fn all_tiles_of_a_call_share_its_grace() {
        let start = Instant::now() - Duration::from_millis(100);
        let budget = |ms| Some(Duration::from_millis(ms));
        // What is left for the last of many tiles, once the call's own time is over.
        let last = Deadline::new(start, [budget(101), budget(30)], 1.0, false);
        assert!(last.is_over(0.0));
        assert!(!Deadline::new(start, [budget(101), budget(101)], 1.0, false).is_over(0.0));
    }

    #[test]
    fn a_machine_that_was_slow_once_is_tried_again() {
        // A moment in which everything took a thousand times as long.
        let mut slow = hundred_seconds(1.0);
        slow.learn(SECOND, 1000.0);
        let mut next = hundred_seconds(slow.learnt());
        assert!(next.may_begin(45.0 * SECOND));
        next.learn(SECOND, 1.0);
        assert!(next.fits(90.0 * SECOND));
        assert!((next.learnt() - 1.0).abs() < 0.01, "{}", next.learnt());
        // However slow it has been, a solve is begun after some calls.
        let mut pace = 1e6;
        let refused = (0..100).position(|_| {
            let mut deadline = hundred_seconds(pace);
            let begins = deadline.may_begin(SECOND);
            pace = deadline.learnt();
            begins
        });
        assert!(refused.is_some_and(|calls| calls < 40), "{refused:?}");
        // A budget that no machine could keep says nothing about this one.
        let mut hopeless = hundred_seconds(3.0);
        assert!(!hopeless.may_begin(1000.0 * SECOND));
        assert_eq!(hopeless.learnt(), 3.0);
    }
}
