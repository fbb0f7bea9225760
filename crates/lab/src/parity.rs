//! Compares the two backends, to find the stage at which they diverge. A [`Pair`](pair::Pair) runs the schedule on both
//! in parallel and compares their states after each stage.

pub mod pair;
mod point;

use point::Point;

/// The difference of one quantity between the two backends, after one stage of one tile.
#[doc(hidden)]
#[derive(Clone, Debug, PartialEq)]
pub struct StageDifference {
    /// The stage and its level (0 is the finest), as in `correct@0.2`.
    pub stage: String,
    /// The quantity, with its unit.
    pub quantity: &'static str,
    /// The largest difference; infinite if exactly one of two values is NaN.
    pub max: f64,
    /// The root mean square of the differences; infinite where `max` is.
    pub rms: f64,
    /// The largest magnitude on the CPU.
    pub size: f64,
    /// Number of values that were compared.
    pub count: u64,
    /// Number of values that differ.
    pub different: u64,
}

impl StageDifference {
    /// Compares pairs (CPU, GPU).
    fn new(stage: Point, quantity: &'static str, pairs: impl Iterator<Item = (f64, f64)>) -> StageDifference {
        let (mut max, mut squares, mut size, mut count, mut different) = (0.0f64, 0.0, 0.0f64, 0u64, 0u64);
        for (cpu, gpu) in pairs {
            count += 1;
            if cpu.to_bits() == gpu.to_bits() {
                size = size.max(cpu.abs());
                continue;
            }
            let apart = (cpu - gpu).abs();
            // Two NaNs count as equal, as do 0 and -0.
            let apart = if cpu.is_nan() && gpu.is_nan() || cpu == gpu { 0.0 } else { apart };
            let apart = if apart.is_nan() { f64::INFINITY } else { apart };
            different += u64::from(apart > 0.0);
            max = max.max(apart);
            squares += apart * apart;
            size = size.max(cpu.abs());
        }
        let rms = (squares / count.max(1) as f64).sqrt();
        StageDifference { stage: stage.to_string(), quantity, max, rms, size, count, different }
    }
}
