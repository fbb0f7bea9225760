//! Decisions from a correction's gain (method §7.7): whether it is accepted, and the step fraction of the next
//! correction.

use super::law::{FRACTION_GROWTH, GAIN_RAMP, IDENTITY_ENERGY_WEIGHT, MODEL_ERROR_RAMP, SUFFICIENT_DECREASE};

/// One correction: a Gauss-Newton step for all nodes of a level, then sweeps.
#[derive(Clone, Copy, Debug)]
pub struct Correction {
    /// True for the first correction on its level: all charts take part again.
    pub first: bool,
    /// Iterations of conjugate gradients, at most [`CG_ITERATIONS`].
    ///
    /// [`CG_ITERATIONS`]: super::law::CG_ITERATIONS
    pub iterations: u32,
    /// Sweeps after the step.
    pub sweeps: u32,
    /// Minimum gain, as a fraction of a chart's energy, for the chart to take part in the level's next correction.
    pub tolerance: f32,
    /// True if a chart stops after a first correction whose gain matches the quadratic model's prediction.
    pub trusts_model: bool,
}

/// One chart's energies around a correction, in the precision in which a backend sums them.
#[derive(Clone, Copy, Debug)]
pub struct Gain<F> {
    /// Energy before the correction.
    pub before: F,
    /// Energy after it.
    pub after: F,
    /// Energy of the identity; 0 on the coarser levels, where it is unknown.
    pub identity: F,
    /// Gain that the quadratic model predicts for the whole step.
    pub predicted: F,
    /// The largest part of the step that the step limit's first fractions cut off at a corner, 0 to 1.
    pub cut: F,
    /// The chart's step fraction ψ in this correction.
    pub fraction: f32,
}

impl<F: Real> Gain<F> {
    /// True if a trial gained enough to be accepted. A comparison with NaN is false: not accepted.
    pub fn suffices(&self) -> bool {
        self.before - self.after > F::from(SUFFICIENT_DECREASE * self.fraction) * self.predicted
    }
}

impl Correction {
    /// The chart's step fraction ψ' in the next correction; 0 if it skips the further corrections of the level.
    ///
    /// It grows with the gain of this correction, but to at most [`FRACTION_GROWTH`] times this one's fraction. After a
    /// first correction whose model is trusted it grows with the error of the model's prediction instead: the next
    /// correction gains about as much as the prediction was wrong, which is next to nothing on scenes with room and 1
    /// to 3 % of the energy in crowded ones. Where the step was limited, the sweeps may by chance make up for the gain
    /// that was cut off, so that this counts as an error, too. Both ramps are continuous, so that a warp does not jump
    /// from one frame to the next where a chart comes to need another correction.
    pub fn next_fraction<F: Real>(&self, gain: &Gain<F>) -> F {
        let identity = F::from_f64(IDENTITY_ENERGY_WEIGHT) * gain.identity;
        let unit = F::from(self.tolerance) * (gain.before + identity);
        // `draft` has a tolerance of 0.
        let unit = if unit > F::from(0.0) { unit } else { F::from(f32::MIN_POSITIVE) };
        let gained = gain.before - gain.after;
        let most = if self.first && self.trusts_model {
            let (error, cut) = ((gained - gain.predicted).abs(), gain.cut * gain.predicted);
            ramp(if cut > error { cut } else { error } / unit, MODEL_ERROR_RAMP)
        } else {
            F::from_f64(FRACTION_GROWTH) * F::from(gain.fraction)
        };
        // A comparison with NaN is false: no gain.
        if gained > F::from(0.0) { ramp(gained / unit, GAIN_RAMP).min(most) } else { F::from(0.0) }
    }
}

/// 0 up to the first end, 1 from the second one on, linear in between.
fn ramp<F: Real>(x: F, [low, high]: [f64; 2]) -> F {
    let (low, high) = (F::from_f64(low), F::from_f64(high));
    ((x - low) / (high - low)).clamp_to_unit()
}

/// The number format in which a backend sums energies: f64 on the CPU, f32 on a GPU.
pub trait Real:
    Copy
    + PartialOrd
    + From<f32>
    + std::ops::Add<Output = Self>
    + std::ops::Sub<Output = Self>
    + std::ops::Mul<Output = Self>
    + std::ops::Div<Output = Self>
{
    /// The nearest number.
    fn from_f64(x: f64) -> Self;
    fn abs(self) -> Self;
    /// The smaller of both operands; if one is NaN, the other.
    fn min(self, other: Self) -> Self;
    fn clamp_to_unit(self) -> Self;
}

macro_rules! real {
    ($($float:ident)*) => {$(
        impl Real for $float {
            fn from_f64(x: f64) -> Self {
                x as $float
            }
            fn abs(self) -> Self {
                $float::abs(self)
            }
            fn min(self, other: Self) -> Self {
                $float::min(self, other)
            }
            fn clamp_to_unit(self) -> Self {
                self.clamp(0.0, 1.0)
            }
        }
    )*};
}

real!(f32 f64);
