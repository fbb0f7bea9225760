//! The end of a time budget. Without a budget nothing depends on a clock.

use std::time::Duration;

use crate::clock::Instant;

/// The time by which a call, or the solve of one of its tiles, is to end.
#[derive(Clone, Copy, Debug)]
pub struct Deadline {
    end: Option<Instant>,
    /// Tests have a clock of their own.
    clock: fn() -> Instant,
}

impl Deadline {
    /// The deadline of a call that began at `start`; without a budget it never comes.
    pub fn new(start: Instant, budget: Option<Duration>, clock: fn() -> Instant) -> Deadline {
        Deadline { end: budget.and_then(|budget| start.checked_add(budget)), clock }
    }

    /// A deadline that never comes.
    pub fn unlimited() -> Deadline {
        Deadline { end: None, clock: Instant::now }
    }

    pub fn is_limited(&self) -> bool {
        self.end.is_some()
    }

    pub fn now(&self) -> Instant {
        (self.clock)()
    }

    /// True if the time is over.
    pub fn is_over(&self) -> bool {
        self.end.is_some_and(|end| self.now() >= end)
    }

    /// The deadline of work that may take this part of the remaining time.
    pub fn part(&self, part: f64) -> Deadline {
        let end = self.end.map(|end| {
            let now = self.now();
            now + end.saturating_duration_since(now).mul_f64(part)
        });
        Deadline { end, ..*self }
    }
}
