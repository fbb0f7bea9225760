//! Sweeps: all of their cases with VRTM_LONG_TESTS=1, and otherwise a share that changes from day to day.

/// True if sweeps run all of their cases.
pub fn long() -> bool {
    std::env::var_os("VRTM_LONG_TESTS").is_some_and(|value| value == "1")
}

/// True in a long run. Otherwise a line says what is left out.
pub fn only(what: &str) -> bool {
    if !long() {
        println!("without {what}; VRTM_LONG_TESTS=1 runs them");
    }
    long()
}

/// The number that decides which cases run: VRTM_SEED, or the number of the day.
pub fn seed() -> u64 {
    let day = || std::time::SystemTime::UNIX_EPOCH.elapsed().map_or(0, |time| time.as_secs() / 86_400);
    let given = std::env::var("VRTM_SEED").ok().and_then(|text| text.parse().ok());
    given.unwrap_or_else(day)
}

/// Number of cases that a sweep runs: `all` in a long run, otherwise `few`, and a line says so.
pub fn cases(all: u64, few: u64, what: &str) -> u64 {
    if long() {
        return all;
    }
    println!("{few} of {all} {what}; VRTM_LONG_TESTS=1 runs all");
    few
}

/// The cases of a sweep: all of them in a long run, otherwise one of each `step`, and a line says so.
pub fn share<T>(cases: Vec<T>, step: usize, what: &str) -> Vec<T> {
    if long() {
        return cases;
    }
    let (all, seed) = (cases.len(), seed());
    let first = (seed % step.min(all).max(1) as u64) as usize;
    let some: Vec<T> = cases.into_iter().skip(first).step_by(step).collect();
    println!("{} of {all} {what}: VRTM_SEED={seed}; VRTM_LONG_TESTS=1 runs all", some.len());
    some
}
