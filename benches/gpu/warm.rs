//! A GPU that has been idle takes a second or two to raise its clock: until then small kernels take up to three times
//! as long.

use std::process::Command;
use std::time::{Duration, Instant};

/// Time that a GPU works before it is measured.
const LOAD: Duration = Duration::from_secs(2);

/// Repeats `solve` until the GPU is warm. Returns what the first call returned.
pub fn load<T>(mut solve: impl FnMut() -> Result<T, String>) -> Result<T, String> {
    let start = Instant::now();
    let first = solve()?;
    while start.elapsed() < LOAD {
        solve()?;
    }
    Ok(first)
}

/// The clock of the multiprocessors and its maximum in MHz, where the driver's tool tells them.
pub fn clock(gpu: &str) -> Option<String> {
    let query = ["--query-gpu=name,clocks.sm,clocks.max.sm", "--format=csv,noheader,nounits"];
    let output = Command::new("nvidia-smi").args(query).output().ok()?;
    let text = String::from_utf8(output.stdout).ok()?;
    let line = text.lines().find_map(|line| line.strip_prefix(gpu)?.strip_prefix(", "))?;
    let (now, most) = line.split_once(", ")?;
    Some(format!("{now} of {most}"))
}
