//! Model checks of the protocol between a team's threads, `crates/core/src/team/protocol.rs`. Loom runs each model in
//! all interleavings, and with all values that the memory model lets a load return. It reports a lost wakeup as a
//! deadlock, and an access to a job that is not ordered before the job's end as a race.
//!
//! Where all interleavings are too many, those are checked in which a thread is interrupted, where it could go on, at
//! most a few times. The environment variable LOOM_MAX_PREEMPTIONS sets another bound for all models.
#![cfg(test)]

use std::panic::{AssertUnwindSafe, catch_unwind, resume_unwind};
use std::sync::Arc;
use std::sync::atomic::{AtomicUsize, Ordering};
use std::time::Instant;

use Job::{Bad, Good};
use loom::cell::UnsafeCell;
use protocol::Protocol;

#[path = "../../crates/core/src/team/protocol.rs"]
#[allow(dead_code)]
mod protocol;

mod sync {
    pub use loom::hint::spin_loop;
    pub use loom::sync::atomic::{AtomicU64, AtomicUsize, Ordering};
    pub use loom::sync::{Condvar, Mutex, MutexGuard};
    pub use loom::thread::yield_now;

    /// A helper that finds no job goes to sleep at once.
    pub const SPINS: usize = 0;
}

/// A model: one caller and its helpers run jobs in a row, and the team ends.
#[derive(Clone, Copy)]
struct Model {
    name: &'static str,
    helpers: usize,
    jobs: &'static [Job],
    /// Most interruptions of a thread that could continue; none = all interleavings.
    preemptions: Option<usize>,
}

/// A job of so many items.
#[derive(Clone, Copy)]
enum Job {
    Good(usize),
    /// Every item panics.
    Bad(usize),
}
impl Job {
    fn items(self) -> usize {
        match self {
            Good(items) | Bad(items) => items,
        }
    }
}

#[test]
fn helpers_end_without_a_job() {
    check(Model { name: "2 threads, no job", helpers: 1, jobs: &[], preemptions: None });
    check(Model { name: "3 threads, no job", helpers: 2, jobs: &[], preemptions: None });
}

#[test]
fn one_job_of_two_threads() {
    check(Model { name: "2 threads, 2 items", helpers: 1, jobs: &[Good(2)], preemptions: None });
}

#[test]
fn two_jobs_of_two_threads() {
    check(Model {
        name: "2 threads, 1 + 2 items",
        helpers: 1,
        jobs: &[Good(1), Good(2)],
        preemptions: Some(4),
    });
}

#[test]
fn three_jobs_of_two_threads() {
    let jobs = &[Good(1), Good(1), Good(1)];
    check(Model { name: "2 threads, 1 + 1 + 1 items", helpers: 1, jobs, preemptions: Some(3) });
}

#[test]
fn a_panic_of_two_threads() {
    // The helper's alone, or both.
    check(Model { name: "2 threads, 1 panic", helpers: 1, jobs: &[Bad(1)], preemptions: None });
    check(Model { name: "2 threads, 2 panics", helpers: 1, jobs: &[Bad(2)], preemptions: None });
}

#[test]
fn a_job_after_a_panic() {
    check(Model {
        name: "2 threads, 2 panics + 1 item",
        helpers: 1,
        jobs: &[Bad(2), Good(1)],
        preemptions: Some(4),
    });
}

#[test]
fn one_job_of_three_threads() {
    check(Model { name: "3 threads, 3 items", helpers: 2, jobs: &[Good(3)], preemptions: Some(2) });
}

#[test]
fn two_jobs_of_three_threads() {
    check(Model {
        name: "3 threads, 2 + 2 items",
        helpers: 2,
        jobs: &[Good(2), Good(2)],
        preemptions: Some(1),
    });
}

#[test]
fn a_job_after_a_panic_of_three_threads() {
    check(Model {
        name: "3 threads, 3 panics + 1 item",
        helpers: 2,
        jobs: &[Bad(3), Good(1)],
        preemptions: Some(1),
    });
}

/// The memory that a job uses. It lives as long as the execution, so that a use after the job's end is an error that
/// loom reports, rather than undefined behaviour.
struct Data {
    panics: bool,
    alive: UnsafeCell<bool>,
    /// Number of runs of each item.
    runs: Vec<UnsafeCell<usize>>,
}

struct Jobs(Vec<Data>);
// SAFETY: loom checks all accesses to the cells.
unsafe impl Sync for Jobs {}
// SAFETY: as above.
unsafe impl Send for Jobs {}

/// The panic of an item, as opposed to one of loom.
struct Thrown;

impl Jobs {
    fn new(jobs: &[Job]) -> Jobs {
        let data = |job: &Job| Data {
            panics: matches!(job, Bad(_)),
            alive: UnsafeCell::new(true),
            runs: (0..job.items()).map(|_| UnsafeCell::new(0)).collect(),
        };
        Jobs(jobs.iter().map(data).collect())
    }

    fn item(&self, job: usize, k: usize) {
        let data = &self.0[job];
        // SAFETY: loom checks that no write is at the same time.
        data.alive.with(|alive| assert!(unsafe { *alive }, "a job is used after its end"));
        // SAFETY: loom checks that no other access is at the same time.
        data.runs[k].with_mut(|runs| unsafe { *runs += 1 });
        if data.panics {
            // Without the message of `panic!`.
            resume_unwind(Box::new(Thrown));
        }
    }

    /// Ends a job, as the caller may once `run` has returned. Returns how often each item ran.
    fn end(&self, job: usize) -> Vec<usize> {
        let data = &self.0[job];
        // SAFETY: loom checks that no other access is at the same time.
        data.alive.with_mut(|alive| unsafe { *alive = false });
        // SAFETY: as above.
        data.runs.iter().map(|runs| runs.with(|runs| unsafe { *runs })).collect()
    }
}

/// Sums over all executions of a model.
#[derive(Default)]
struct Sums {
    executions: AtomicUsize,
    /// Executions in which helpers ran items of every job.
    helped: AtomicUsize,
}

fn check(model: Model) {
    let start = Instant::now();
    let sums = Arc::new(Sums::default());
    let mut builder = loom::model::Builder::new();
    builder.preemption_bound = builder.preemption_bound.or(model.preemptions);
    builder.max_branches = 10_000;
    let bound = builder.preemption_bound;
    let shared = sums.clone();
    builder.check(move || {
        shared.executions.fetch_add(1, Ordering::Relaxed);
        execute(model, &shared);
    });
    println!(
        "{}: {} executions, {} in {:.1} s",
        model.name,
        sums.executions.load(Ordering::Relaxed),
        bound.map_or("all".to_string(), |bound| format!("of at most {bound} preemptions")),
        start.elapsed().as_secs_f64(),
    );
    // The caller is interrupted once per job that a helper joins.
    if bound.is_none_or(|bound| bound >= model.jobs.len()) {
        assert!(sums.helped.load(Ordering::Relaxed) > 0, "the helpers leave jobs to the caller");
    }
}

fn execute(model: Model, sums: &Sums) {
    let jobs = Arc::new(Jobs::new(model.jobs));
    let protocol = Arc::new(Protocol::new(1 + model.helpers));
    // By job: items that helpers ran. Not an atomic of loom, which would order the threads.
    let helped: Arc<Vec<_>> = Arc::new(model.jobs.iter().map(|_| AtomicUsize::new(0)).collect());
    let helpers: Vec<_> = (1..=model.helpers)
        .map(|number| {
            let (protocol, jobs, helped) = (protocol.clone(), jobs.clone(), helped.clone());
            loom::thread::spawn(move || {
                protocol.help(number, |job: usize, k| {
                    helped[job].fetch_add(1, Ordering::Relaxed);
                    jobs.item(job, k);
                });
            })
        })
        .collect();
    for (number, &job) in model.jobs.iter().enumerate() {
        let run = || protocol.run(number, job.items(), |k| jobs.item(number, k));
        let result = catch_unwind(AssertUnwindSafe(run));
        let runs = jobs.end(number);
        match result {
            Ok(()) => {
                assert!(matches!(job, Good(_)), "a panic is lost");
                assert!(runs.iter().all(|&runs| runs == 1), "items ran {runs:?} times");
            }
            Err(panic) if panic.is::<Thrown>() => {
                assert!(matches!(job, Bad(_)), "a panic of an earlier job");
                assert!(runs.iter().all(|&runs| runs <= 1), "items ran {runs:?} times");
            }
            Err(panic) => resume_unwind(panic),
        }
    }
    protocol.quit();
    for helper in helpers {
        helper.join().unwrap();
    }
    if helped.iter().all(|helped| helped.load(Ordering::Relaxed) > 0) {
        sums.helped.fetch_add(1, Ordering::Relaxed);
    }
}
