//! How far a solve is, for a host that waits for it, and whether it goes on.

use std::sync::Arc;

use crate::control::Control;

/// A solve's part of a call's progress.
#[derive(Debug, Default)]
pub(crate) struct Progress {
    control: Option<Arc<Control>>,
    /// What is left of that part.
    left: f32,
    /// That part over the seconds that the solve is expected to take.
    per_second: f32,
}

/// What stays until the solve is done, as a fraction of its part: predictions may fall short.
const RESERVE: f32 = 0.02;

impl Progress {
    /// For a solve that is the fraction `part` of what a host waits for.
    pub fn new(control: Option<&Arc<Control>>, part: f32) -> Progress {
        Progress { control: control.cloned(), left: part, per_second: 0.0 }
    }

    /// Whether anyone wants to know.
    pub fn is_told(&self) -> bool {
        self.control.is_some()
    }

    /// Begins a solve that is expected to take so many seconds.
    pub fn begin(&mut self, seconds: f64) {
        self.per_second = (1.0 - RESERVE) * self.left / (seconds as f32).max(1e-9);
        self.left -= RESERVE * self.left;
    }

    /// Does work that was expected to take `forecast` seconds when the solve began, and is expected to take `seconds` now.
    pub fn during<R>(&mut self, forecast: f64, seconds: f64, work: impl FnOnce() -> R) -> R {
        let Some(control) = &self.control else { return work() };
        let fraction = (self.per_second * forecast as f32).clamp(0.0, self.left);
        control.begin_stage(fraction, seconds as f32);
        let result = work();
        control.end_stage(fraction);
        self.left -= fraction;
        result
    }

    /// Unwinds if the call was cancelled.
    pub fn check_or_unwind(&self) {
        if let Some(control) = &self.control {
            control.check_or_unwind();
        }
    }
}
