//! parity: runs the schedule on both backends, to find where they part. A [`Pair`](pair::Pair) runs it on both side by
//! side and compares after each stage; a [`Switched`](switched::Switched) runs it on one backend up to a point and on
//! the other from there.

pub(crate) mod pair;

use crate::method::point::Point;

/// How far one quantity is apart on the two backends, after one stage of one tile.
#[doc(hidden)]
#[derive(Clone, Debug, PartialEq)]
pub struct StageDifference {
    /// The stage and its level (0 is the finest), as `VRTM_SWITCH` names it: `correct@0.2`.
    pub stage: String,
    /// What was compared, and in which units.
    pub quantity: &'static str,
    /// The largest and the root mean square difference; infinite where one is not a number and the other is.
    pub max: f64,
    pub rms: f64,
    /// The largest magnitude on the CPU.
    pub size: f64,
    /// Numbers that were compared, and those of them whose bits differ.
    pub count: u64,
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
            // What is no number on both is the same; a 0 may have either sign.
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
