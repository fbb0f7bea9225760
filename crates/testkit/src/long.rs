//! Long sweeps: all of their cases with VRTM_LONG_TESTS=1, which CI sets, and a fixed share of them otherwise.

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

/// Number of cases that a sweep runs: `all` in a long run, otherwise `few`, and a line says so.
pub fn cases(all: u64, few: u64, what: &str) -> u64 {
    if long() {
        return all;
    }
    println!("{few} of {all} {what}; VRTM_LONG_TESTS=1 runs all");
    few
}

/// The cases of a sweep: all of them in a long run, otherwise the first of each `step`, and a line says so.
pub fn share<T>(cases: Vec<T>, step: usize, what: &str) -> Vec<T> {
    if long() {
        return cases;
    }
    let all = cases.len();
    let some: Vec<T> = cases.into_iter().step_by(step).collect();
    println!("{} of {all} {what}; VRTM_LONG_TESTS=1 runs all", some.len());
    some
}
