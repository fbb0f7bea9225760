//! The progress of a solve, for a host that waits for it, and its cancellation.

use std::sync::Arc;

use crate::clock::Instant;
use crate::control::Control;

/// A solve's share of a call's progress.
#[derive(Debug)]
pub struct Progress {
    control: Option<Arc<Control>>,
    /// The remaining part of that share.
    left: f32,
    /// The share divided by the cost of the whole solve.
    per_cost: f32,
    /// The start of the solve; followed by the cost of the work done.
    start: Instant,
    done: f64,
}

/// The fraction of the share that is reserved until the solve is done: costs may be underestimated.
const RESERVE: f32 = 0.02;

impl Progress {
    /// The progress of a solve that is the fraction `part` of the call.
    pub fn new(control: Option<&Arc<Control>>, part: f32) -> Progress {
        let start = Instant::now();
        Progress { control: control.cloned(), left: part, per_cost: 0.0, start, done: 0.0 }
    }

    /// Begins a solve of this cost.
    pub fn begin(&mut self, cost: f64) {
        self.per_cost = (1.0 - RESERVE) * self.left / (cost as f32).max(1e-9);
        self.left -= RESERVE * self.left;
        self.start = Instant::now();
    }

    /// Does work of this cost.
    pub fn during<R>(&mut self, cost: f64, work: impl FnOnce() -> R) -> R {
        let Some(control) = &self.control else { return work() };
        let fraction = (self.per_cost * cost as f32).clamp(0.0, self.left);
        // At the pace of the work done, or initially of the machine that costs refer to.
        let pace = if self.done > 0.0 { self.start.elapsed().as_secs_f64() / self.done } else { 1e-6 };
        control.begin_stage(fraction, (pace * cost) as f32);
        let result = work();
        control.end_stage(fraction);
        self.left -= fraction;
        self.done += cost;
        result
    }

    /// Unwinds if the call was cancelled.
    pub fn check_or_unwind(&self) {
        if let Some(control) = &self.control {
            control.check_or_unwind();
        }
    }
}
