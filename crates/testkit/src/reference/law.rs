//! What corner Jacobians cost: the room term, and the barrier of the minimisation (method §4).

use vrtm_core::settings::TileSettings;

/// ε: no corner Jacobian of a result is less.
pub(super) const BOUND: f64 = 0.02;

/// The barrier is 0 for Jacobians that exceed the bound by this or more, so that it has no effect on a warp with room.
pub(super) const BARRIER_WIDTH: f64 = 0.1;

/// The room term as a function of a corner Jacobian, with the barrier that is added during the minimisation.
#[derive(Clone, Copy)]
pub struct Law {
    room: f64,
    threshold: f64,
    /// Strength μ of the barrier; 0 for E itself.
    pub barrier: f64,
}

impl Law {
    pub fn new(settings: &TileSettings) -> Law {
        Law { room: f64::from(settings.room), threshold: f64::from(settings.room_threshold), barrier: 0.0 }
    }

    /// The value, its first derivative, and the positive part of its second derivative with respect to J.
    ///
    /// The barrier is that of Li et al., "Incremental Potential Contact" (2020), eq. 6: -(s - 1)² ln s with
    /// s = (J - ε) / `BARRIER_WIDTH`: twice differentiable, and exactly 0 from s = 1 on.
    pub fn of(&self, j: f64) -> (f64, f64, f64) {
        let deficit = (self.threshold - j).max(0.0);
        let mut value = (self.room * deficit * deficit, -2.0 * self.room * deficit, 0.0);
        if deficit > 0.0 {
            value.2 = 2.0 * self.room;
        }
        let s = (j - BOUND) / BARRIER_WIDTH;
        if self.barrier > 0.0 && s < 1.0 {
            if s <= 0.0 {
                return (f64::INFINITY, 0.0, 0.0);
            }
            let ln = s.ln();
            value.0 -= self.barrier * (s - 1.0).powi(2) * ln;
            value.1 -= self.barrier * (2.0 * (s - 1.0) * ln + (s - 1.0).powi(2) / s) / BARRIER_WIDTH;
            let second = -2.0 * ln - 3.0 + 2.0 / s + 1.0 / (s * s);
            value.2 += self.barrier * second / (BARRIER_WIDTH * BARRIER_WIDTH);
        }
        value
    }
}
