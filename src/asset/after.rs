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

    /// Somewhat less: what is not tried is not measured again, and a machine that is taken for a slow one is to be
    /// taken for a quicker one.
    pub fn less(self) -> After {
        After { blend: self.blend.mul_f64(0.95), rest: self.rest.mul_f64(0.75) }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_blend_has_half_of_a_budget() {
        let ms = Duration::from_millis;
        let after = After { blend: ms(20), rest: ms(2) };
        assert!(after.has_time(ms(42)) && !after.has_time(ms(41)) && !after.has_time(ms(0)));
        assert_eq!([42, 41].map(|budget| after.of(ms(budget))), [ms(22), ms(2)]);
        // What was not tried is tried again one day.
        let mut less = after;
        let calls = (0..100).find(|_| {
            less = less.less();
            less.has_time(ms(21))
        });
        assert!(calls.is_some_and(|calls| calls > 5), "{calls:?}");
    }
}
