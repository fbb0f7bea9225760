//! The rest of a call after its tiles are solved: its time, and its share of the call's progress.

use std::time::Duration;

/// The share of a call's progress for what follows the solves of tiles, if charts go on beyond their borders.
pub(super) const SHARE: f32 = 0.2;

/// Time that the last call took after its tiles were solved.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct After {
    /// For the blend, if it was not the one before.
    pub blend: Duration,
    /// For all else.
    pub rest: Duration,
}

impl After {
    /// True if a call with this budget has the time for a blend: at most half of it.
    pub fn has_time(&self, budget: Duration) -> bool {
        2 * self.blend <= budget.saturating_sub(self.rest)
    }

    /// The time to keep free of a budget.
    pub fn of(&self, budget: Duration) -> Duration {
        self.rest + if self.has_time(budget) { self.blend } else { Duration::ZERO }
    }

    /// Somewhat less: what is not tried is not measured again, and a machine that is taken for a slow one is to be taken for a
    /// quicker one.
    pub fn less(self) -> After {
        After { blend: self.blend.mul_f64(0.95), rest: self.rest.mul_f64(0.75) }
    }
}
