//! Teams under load; `tests/loom` checks the protocol in all interleavings.

use std::panic::{AssertUnwindSafe, catch_unwind, resume_unwind};
use std::sync::atomic::{AtomicUsize, Ordering};
use std::time::Duration;

use vrtm_core::allocation::vec;
use vrtm_core::clock::Instant;
use vrtm_core::team::*;

#[test]
fn results_are_in_the_order_of_the_items() {
    for threads in [1, 3] {
        Team::with(threads, |team| {
            let squares = team.map(1000, |k| k * k);
            assert!(squares.iter().enumerate().all(|(k, &square)| square == k * k));
            let mut texts = vec![String::new(); 300];
            team.fill(&mut texts, |k, text| *text = k.to_string());
            assert!(texts.iter().enumerate().all(|(k, text)| *text == k.to_string()));
        });
    }
}

/// Calls `f` on `threads` threads of a team at the same time.
fn meet(team: &Team, threads: usize, f: impl Fn(&Worker) + Sync) {
    let (arrived, start) = (AtomicUsize::new(0), Instant::now());
    team.run_on(3.max(threads), |worker, i| {
        if i < threads {
            arrived.fetch_add(1, Ordering::Relaxed);
            while arrived.load(Ordering::Relaxed) < threads {
                assert!(start.elapsed() < Duration::from_secs(60), "a helper does not come");
                std::thread::yield_now();
            }
            f(worker);
        }
    });
}

/// Ends an item like a panic, but prints nothing.
fn throw(i: usize) {
    resume_unwind(Box::new(i));
}

#[test]
fn a_panic_of_two_threads_ends_with_its_job() {
    Team::with(2, |team| {
        for _ in 0..20 {
            let arrived = AtomicUsize::new(0);
            let result = catch_unwind(AssertUnwindSafe(|| {
                team.run(3, |i| {
                    arrived.fetch_add(1, Ordering::Relaxed);
                    while arrived.load(Ordering::Relaxed) < 2 {
                        std::thread::yield_now();
                    }
                    throw(i);
                });
            }));
            assert!(result.is_err());
            meet(team, 2, |_| ());
        }
    });
}

#[test]
fn a_job_within_a_job_is_refused() {
    for threads in [1, 3] {
        Team::with(threads, |team| {
            let result = catch_unwind(AssertUnwindSafe(|| team.run(10, |_| team.run(10, |_| ()))));
            assert!(result.is_err());
            meet(team, threads, |_| ());
        });
    }
}

#[test]
fn a_worker_of_another_team_gets_no_memory() {
    Team::with(2, |team| {
        let memory = PerThread::new(team, || Box::new(0));
        let result = catch_unwind(AssertUnwindSafe(|| {
            Team::with(2, |other| other.run_on(3, |worker, _| memory.with(worker, |m| *m += 1)));
        }));
        assert!(result.is_err());
    });
}

/// A linear congruential generator, whose high bits are random enough.
struct Random(u64);

impl Random {
    fn below(&mut self, n: usize) -> usize {
        self.0 = self.0.wrapping_mul(6364136223846793005).wrapping_add(1442695040888963407);
        (self.0 >> 33) as usize % n
    }
}

/// Several teams at once, more threads than there are cores, many short jobs of random length; some of the jobs panic,
/// and between some of them the helpers fall asleep.
#[test]
fn many_short_jobs_of_several_teams() {
    std::thread::scope(|scope| {
        for seed in 0..4 {
            scope.spawn(move || {
                let random = &mut Random(seed);
                for _ in 0..if cfg!(miri) { 2 } else { 40 } {
                    Team::with(1 + random.below(6), |team| jobs(team, random));
                }
            });
        }
    });
}

fn jobs(team: &Team, random: &mut Random) {
    let sums = PerThread::new(team, || Box::new(0));
    let mut expected = 0;
    for _ in 0..60 {
        let at_most = [3, 20, 300][random.below(3)];
        let count = random.below(at_most + 1);
        let thrower = if random.below(8) == 0 { random.below(count + 1) } else { count };
        // Borrowed by the items, and dropped when the job has ended.
        let mut hits = vec![0; count];
        let shared = SharedSlice::new(&mut hits);
        let result = catch_unwind(AssertUnwindSafe(|| {
            team.run_on(count, |worker, i| {
                // SAFETY: each item has its own element, of a slice that outlives the job.
                unsafe { *shared.get_mut(i) += 1 };
                sums.with(worker, |sum| *sum += 1);
                if i == thrower {
                    throw(i);
                }
            });
        }));
        assert_eq!(
            result.err().map(|panic| *panic.downcast::<usize>().unwrap()),
            (thrower < count).then_some(thrower)
        );
        assert!(
            hits.iter().all(|&hits| hits == 1 || hits == 0 && thrower < count),
            "items ran {hits:?} times"
        );
        expected += hits.iter().sum::<usize>();
        if random.below(20) == 0 {
            std::thread::sleep(Duration::from_micros(500));
        }
    }
    let total = AtomicUsize::new(0);
    meet(team, team.threads(), |worker| {
        total.fetch_add(sums.with(worker, |sum| *sum), Ordering::Relaxed);
    });
    assert_eq!(total.load(Ordering::Relaxed), expected);
}

#[test]
fn threads_start_when_a_job_needs_them() {
    let started = AtomicUsize::new(0);
    let help = |_| _ = started.fetch_add(1, Ordering::Relaxed);
    // Both return when the helpers, if any, have ended.
    vrtm_core::team::threads::with(1..4, help, |_| ());
    assert_eq!(started.load(Ordering::Relaxed), 0);
    vrtm_core::team::threads::with(1..4, help, |start| start());
    assert_eq!(started.load(Ordering::Relaxed), 3);
}
