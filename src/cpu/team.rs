//! Threads for one call: scoped, so that none outlives it, and kept awake between the short jobs of a solve.

use std::any::Any;
use std::cell::UnsafeCell;
use std::panic::{AssertUnwindSafe, catch_unwind, resume_unwind};
use std::sync::atomic::{AtomicBool, AtomicU64, AtomicUsize, Ordering};
use std::sync::{Condvar, Mutex, PoisonError};

/// A job's function with its lifetime erased; only read between `open` and the close that `run` waits for.
type Job = *const (dyn Fn(&Worker, usize) + Sync);

/// The threads of one call.
pub struct Team {
    threads: usize,
    /// Which job (high bits), whether it is open for helpers, and how many have joined (low 16 bits).
    state: AtomicU64,
    job: Mutex<Option<JobCell>>,
    count: AtomicUsize,
    next: AtomicUsize,
    quit: AtomicBool,
    sleepers: AtomicUsize,
    bed: Mutex<()>,
    alarm: Condvar,
    panic: Mutex<Option<Box<dyn Any + Send>>>,
}

/// One of a team's threads: a job's items are given the one that runs them.
pub struct Worker(usize);

#[derive(Clone, Copy)]
struct JobCell(Job);
// SAFETY: the pointee is Sync, and `run` keeps it alive until every helper that joined has left.
unsafe impl Send for JobCell {}

const OPEN: u64 = 1 << 16;
const JOINED: u64 = OPEN - 1;
const EPOCH: u64 = 1 << 17;
/// Rounds of looking for work before a helper goes to sleep: about 50 microseconds.
const SPINS: usize = 4000;

impl Team {
    /// Calls `f` with a team of `threads` threads, the calling one among them.
    pub fn with<R>(threads: usize, f: impl FnOnce(&Team) -> R) -> R {
        let team = Team {
            threads: threads.max(1),
            state: AtomicU64::new(0),
            job: Mutex::new(None),
            count: AtomicUsize::new(0),
            next: AtomicUsize::new(0),
            quit: AtomicBool::new(false),
            sleepers: AtomicUsize::new(0),
            bed: Mutex::new(()),
            alarm: Condvar::new(),
            panic: Mutex::new(None),
        };
        if team.threads == 1 {
            return f(&team);
        }
        std::thread::scope(|scope| {
            // A helper that cannot be started is no error: the others do its work.
            let helpers: Vec<_> = (1..team.threads)
                .filter_map(|n| {
                    let team = &team;
                    std::thread::Builder::new().spawn_scoped(scope, move || team.help(&Worker(n))).ok()
                })
                .collect();
            let result = catch_unwind(AssertUnwindSafe(|| f(&team)));
            team.quit.store(true, Ordering::SeqCst);
            team.wake();
            // A scope waits for what its threads run, not for their ends, which are this library's code as well: a
            // host may unload it right after the call.
            for helper in helpers {
                let _ = helper.join();
            }
            result.unwrap_or_else(|panic| resume_unwind(panic))
        })
    }

    /// Calls `f(0)` to `f(count - 1)`, in any order and on any of the threads; returns when all are done.
    pub fn run(&self, count: usize, f: impl Fn(usize) + Sync) {
        self.run_on(count, |_, k| f(k));
    }

    /// The same of a function that is told the thread, too.
    pub fn run_on(&self, count: usize, f: impl Fn(&Worker, usize) + Sync) {
        let caller = Worker(0);
        if self.threads == 1 || count <= 2 {
            (0..count).for_each(|k| f(&caller, k));
            return;
        }
        let job: &(dyn Fn(&Worker, usize) + Sync) = &f;
        // SAFETY: only the lifetime changes; this function does not return before all helpers have left the job.
        let job: Job = unsafe { std::mem::transmute::<&(dyn Fn(&Worker, usize) + Sync), Job>(job) };
        *self.job.lock().unwrap_or_else(PoisonError::into_inner) = Some(JobCell(job));
        self.count.store(count, Ordering::Relaxed);
        self.next.store(0, Ordering::Relaxed);
        let epoch = self.state.load(Ordering::Relaxed) / EPOCH + 1;
        self.state.store(epoch * EPOCH + OPEN, Ordering::SeqCst);
        if self.sleepers.load(Ordering::SeqCst) > 0 {
            self.wake();
        }
        let own = catch_unwind(AssertUnwindSafe(|| self.work(&caller, &f)));
        self.state.fetch_and(!OPEN, Ordering::SeqCst);
        while self.state.load(Ordering::Acquire) & JOINED != 0 {
            std::hint::spin_loop();
            std::thread::yield_now();
        }
        if let Err(panic) = own {
            resume_unwind(panic);
        }
        let theirs = self.panic.lock().unwrap_or_else(PoisonError::into_inner).take();
        if let Some(panic) = theirs {
            resume_unwind(panic);
        }
    }

    /// Takes items until there are none; several at a time where there are many.
    fn work(&self, worker: &Worker, f: &(dyn Fn(&Worker, usize) + Sync)) {
        let count = self.count.load(Ordering::Relaxed);
        let chunk = (count / (self.threads * 8)).clamp(1, 16);
        loop {
            let first = self.next.fetch_add(chunk, Ordering::Relaxed);
            if first >= count {
                return;
            }
            (first..(first + chunk).min(count)).for_each(|k| f(worker, k));
        }
    }

    fn help(&self, worker: &Worker) {
        let mut seen = 0;
        let mut spins = 0;
        while !self.quit.load(Ordering::Relaxed) {
            let state = self.state.load(Ordering::Relaxed);
            if state & OPEN == 0 || state / EPOCH == seen {
                spins += 1;
                std::hint::spin_loop();
                if spins % 64 == 0 {
                    std::thread::yield_now();
                }
                if spins > SPINS {
                    self.sleep(seen);
                    spins = 0;
                }
                continue;
            }
            if self.state.compare_exchange(state, state + 1, Ordering::SeqCst, Ordering::Relaxed).is_err() {
                continue;
            }
            seen = state / EPOCH;
            spins = 0;
            let job = *self.job.lock().unwrap_or_else(PoisonError::into_inner);
            if let Some(JobCell(job)) = job {
                // SAFETY: having joined an open job, `run` waits for us before its function goes.
                let result = catch_unwind(AssertUnwindSafe(|| self.work(worker, unsafe { &*job })));
                if let Err(panic) = result {
                    *self.panic.lock().unwrap_or_else(PoisonError::into_inner) = Some(panic);
                }
            }
            self.state.fetch_sub(1, Ordering::Release);
        }
    }

    fn sleep(&self, seen: u64) {
        let mut bed = self.bed.lock().unwrap_or_else(PoisonError::into_inner);
        self.sleepers.fetch_add(1, Ordering::SeqCst);
        loop {
            let state = self.state.load(Ordering::SeqCst);
            if self.quit.load(Ordering::SeqCst) || (state & OPEN != 0 && state / EPOCH != seen) {
                break;
            }
            bed = self.alarm.wait(bed).unwrap_or_else(PoisonError::into_inner);
        }
        self.sleepers.fetch_sub(1, Ordering::SeqCst);
    }

    fn wake(&self) {
        drop(self.bed.lock().unwrap_or_else(PoisonError::into_inner));
        self.alarm.notify_all();
    }
}

/// Scratch memory, a piece for each of a team's threads, made when it is first asked for. It holds anything.
pub struct PerThread<T> {
    pieces: Vec<Piece<T>>,
    new: fn() -> Box<T>,
}

/// In cache lines of its own.
#[repr(align(128))]
struct Piece<T>(UnsafeCell<Option<Box<T>>>);

// SAFETY: only a piece's own worker touches it, of which there is one per thread.
unsafe impl<T: Send> Sync for PerThread<T> {}

impl<T> PerThread<T> {
    /// For a team's threads, each of which makes its piece with `new`.
    pub fn new(team: &Team, new: fn() -> Box<T>) -> PerThread<T> {
        PerThread { pieces: (0..team.threads).map(|_| Piece(UnsafeCell::new(None))).collect(), new }
    }

    /// Calls `f` with the worker's piece. Two jobs of one team do not run at once.
    pub fn with<R>(&self, worker: &Worker, f: impl FnOnce(&mut T) -> R) -> R {
        let piece = self.pieces[worker.0].0.get();
        // SAFETY: no other thread has this worker, and no reference outlives its statement.
        let mut own = unsafe { (*piece).take() }.unwrap_or_else(self.new);
        let result = f(&mut own);
        // SAFETY: as above.
        unsafe { *piece = Some(own) };
        result
    }
}

/// A slice whose elements different items of one job may read and write: the caller sees to it that no element is
/// written by one item while another one touches it.
#[derive(Debug)]
pub struct SharedSlice<T>(*mut T, usize);

impl<T> Clone for SharedSlice<T> {
    fn clone(&self) -> Self {
        *self
    }
}
impl<T> Copy for SharedSlice<T> {}
// SAFETY: access goes through the unsafe methods below, whose callers keep elements apart.
unsafe impl<T: Send + Sync> Sync for SharedSlice<T> {}
// SAFETY: as above.
unsafe impl<T: Send + Sync> Send for SharedSlice<T> {}

impl<T> SharedSlice<T> {
    pub fn new(slice: &mut [T]) -> SharedSlice<T> {
        SharedSlice(slice.as_mut_ptr(), slice.len())
    }

    /// # Safety
    /// The slice is alive, and no other item writes the element now.
    #[inline(always)]
    pub unsafe fn get<'a>(self, i: usize) -> &'a T {
        assert!(i < self.1);
        // SAFETY: in bounds; the rest is the caller's promise.
        unsafe { &*self.0.add(i) }
    }

    /// # Safety
    /// The slice is alive, and no other item touches the element now.
    #[inline(always)]
    #[allow(clippy::mut_from_ref)]
    pub unsafe fn get_mut<'a>(self, i: usize) -> &'a mut T {
        assert!(i < self.1);
        // SAFETY: in bounds; the rest is the caller's promise.
        unsafe { &mut *self.0.add(i) }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_item_runs_once() {
        for threads in [1, 2, 5] {
            Team::with(threads, |team| {
                for count in [0, 1, 2, 3, 100, 1000] {
                    let hits: Vec<AtomicUsize> = (0..count).map(|_| AtomicUsize::new(0)).collect();
                    for _ in 0..20 {
                        team.run(count, |i| {
                            hits[i].fetch_add(1, Ordering::Relaxed);
                        });
                    }
                    assert!(hits.iter().all(|h| h.load(Ordering::Relaxed) == 20));
                }
            });
        }
    }

    #[test]
    fn helpers_that_slept_are_woken() {
        Team::with(2, |team| {
            for _ in 0..3 {
                std::thread::sleep(std::time::Duration::from_millis(5));
                let sum = AtomicUsize::new(0);
                team.run(100, |i| {
                    sum.fetch_add(i, Ordering::Relaxed);
                });
                assert_eq!(sum.load(Ordering::Relaxed), 4950);
            }
        });
    }

    #[test]
    fn a_panic_reaches_the_caller() {
        let result = catch_unwind(|| {
            Team::with(3, |team| team.run(50, |i| assert!(i != 30, "item {i}")));
        });
        assert!(result.is_err());
    }
}
