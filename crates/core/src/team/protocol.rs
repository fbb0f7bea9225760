//! The protocol by which a team's caller and its helpers divide the items of a job, and know that it is over.
//!
//! A job is any value that can be copied, and `help` is told how to run its items. The caller publishes the job, works
//! on it like the helpers, closes it, and waits until every helper that joined has left: from then on no helper uses
//! the job, even if an item panicked. `Team` relies on this; nothing in this file is unsafe.
//!
//! `super::sync` provides the atomics and locks. In the library they are std's; `tests/loom` compiles this same file
//! with loom's and runs it in all interleavings. Loom does not model the total order of `SeqCst` accesses. None is
//! needed: all decisions between caller and helpers are in one word, `state`.

use std::any::Any;
use std::panic::{AssertUnwindSafe, catch_unwind, resume_unwind};
use std::sync::PoisonError;

use super::sync::{
    AtomicU64, AtomicUsize, Condvar, Mutex, MutexGuard, Ordering, SPINS, spin_loop, yield_now,
};

/// The shared state of one caller and its helpers; `J` is the type of a job.
pub struct Protocol<J> {
    threads: usize,
    /// Flag that the team ends (`QUIT`), the job's number (in units of `EPOCH`), whether a helper sleeps
    /// (`SLEEPING`), whether the job is open for helpers (`OPEN`), and how many helpers have joined it
    /// (`JOINED`).
    state: AtomicU64,
    /// The job and the number of its items.
    job: Mutex<Option<(J, usize)>>,
    /// Each part's first item that no thread has taken. A part is a run of neighbouring items, which one thread begins
    /// with in each job: what it wrote is still in its core's cache.
    next: [Part; PARTS],
    sleep_lock: Mutex<()>,
    wakeup: Condvar,
    /// The first panic of a helper in this job.
    panic: Mutex<Option<Box<dyn Any + Send>>>,
}

/// The most parts that the items of a job are divided into; further threads begin with parts of others.
const PARTS: usize = 16;

/// Aligned to cache lines of its own.
#[repr(align(128))]
struct Part(AtomicUsize);

const JOINED: u64 = OPEN - 1;
const OPEN: u64 = 1 << 16;
/// A helper sleeps or is about to, and has not been woken since.
const SLEEPING: u64 = 1 << 17;
const EPOCH: u64 = 1 << 18;
const QUIT: u64 = 1 << 63;

/// A helper's membership in a job, which ends when dropped, even by a panic.
struct Joined<'a>(&'a AtomicU64);

impl Drop for Joined<'_> {
    fn drop(&mut self) {
        self.0.fetch_sub(1, Ordering::Release);
    }
}

/// True if a helper whose last job was `seen` has something to do: quit, or join a job.
fn is_news(state: u64, seen: u64) -> bool {
    state & QUIT != 0 || state & OPEN != 0 && state / EPOCH != seen
}

/// Locks even if poisoned: the guarded value is written in one step.
fn lock<T>(mutex: &Mutex<T>) -> MutexGuard<'_, T> {
    mutex.lock().unwrap_or_else(PoisonError::into_inner)
}

impl<J: Copy> Protocol<J> {
    /// The most threads that `state` can count, including the caller.
    pub const MAX_THREADS: usize = JOINED as usize + 1;

    /// For one caller and its helpers, `threads` in all.
    pub fn new(threads: usize) -> Protocol<J> {
        Protocol {
            threads,
            state: AtomicU64::new(0),
            job: Mutex::new(None),
            next: std::array::from_fn(|_| Part(AtomicUsize::new(0))),
            sleep_lock: Mutex::new(()),
            wakeup: Condvar::new(),
            panic: Mutex::new(None),
        }
    }

    /// The caller's side of a job: runs items 0 to `count - 1`, each once, here with `item` and on the helpers with the
    /// function given to `help`. Returns, or unwinds if an item panicked, only after every helper that joined has left
    /// the job. After a panic some items may not have run. Must not be called while it runs, not even by an item.
    pub fn run(&self, job: J, count: usize, item: impl Fn(usize)) {
        for part in 0..self.parts() {
            self.next[part].0.store(self.first(part, count), Ordering::Relaxed);
        }
        *lock(&self.job) = Some((job, count));
        let state = self.state.load(Ordering::Relaxed);
        assert!(state & (OPEN | JOINED) == 0, "another job is running");
        // Either a helper has already set `SLEEPING` and is woken, or its attempt to set it fails and it sees that the
        // job is open.
        if self.state.swap((state / EPOCH + 1) * EPOCH + OPEN, Ordering::Release) & SLEEPING != 0 {
            self.wake();
        }
        let own = catch_unwind(AssertUnwindSafe(|| self.work(0, count, item)));
        self.state.fetch_and(!OPEN, Ordering::Relaxed);
        // Late helpers can no longer join; the work of the others happens before the end of this loop.
        while self.state.load(Ordering::Acquire) & JOINED != 0 {
            spin_loop();
            yield_now();
        }
        // Taken even if the caller's own panic comes first: otherwise the next job would unwind with it.
        let of_helper = lock(&self.panic).take();
        if let Some(panic) = own.err().or(of_helper) {
            resume_unwind(panic);
        }
    }

    /// The side of a helper with this number: runs items, with `item`, of every open job until `quit`.
    pub fn help(&self, number: usize, item: impl Fn(J, usize)) {
        let mut seen = 0;
        let mut spins = 0;
        loop {
            let state = self.state.load(Ordering::Relaxed);
            if !is_news(state, seen) {
                spins += 1;
                spin_loop();
                if spins % 64 == 0 {
                    yield_now();
                }
                if spins > SPINS {
                    self.sleep(seen);
                    spins = 0;
                }
                continue;
            }
            if state & QUIT != 0 {
                return;
            }
            if self.state.compare_exchange(state, state + 1, Ordering::Acquire, Ordering::Relaxed).is_err() {
                continue;
            }
            let _joined = Joined(&self.state);
            seen = state / EPOCH;
            spins = 0;
            let job = *lock(&self.job);
            if let Some((job, count)) = job {
                let result = catch_unwind(AssertUnwindSafe(|| self.work(number, count, |k| item(job, k))));
                if let Err(panic) = result {
                    lock(&self.panic).get_or_insert(panic);
                }
            }
        }
    }

    /// Ends the helpers, after the last job.
    pub fn quit(&self) {
        if self.state.fetch_or(QUIT, Ordering::Relaxed) & SLEEPING != 0 {
            self.wake();
        }
    }

    /// Number of parts that items are divided into.
    fn parts(&self) -> usize {
        self.threads.min(PARTS)
    }

    /// The first of the items of a part, or the number of items after the last part.
    fn first(&self, part: usize, count: usize) -> usize {
        count / self.parts() * part + (count % self.parts() * part) / self.parts()
    }

    /// Takes items until none are left, several at a time if many are: first those of the thread's own part, then what
    /// is left of the others.
    fn work(&self, number: usize, count: usize, item: impl Fn(usize)) {
        let chunk = (count / (self.threads * 8)).clamp(1, 16);
        for turn in 0..self.parts() {
            let part = (number + turn) % self.parts();
            let end = self.first(part + 1, count);
            loop {
                let first = self.next[part].0.fetch_add(chunk, Ordering::Relaxed);
                if first >= end {
                    break;
                }
                (first..(first + chunk).min(end)).for_each(&item);
            }
        }
    }

    /// Returns when a helper whose last job was `seen` has something to do.
    fn sleep(&self, seen: u64) {
        let mut guard = lock(&self.sleep_lock);
        loop {
            let state = self.state.load(Ordering::Relaxed);
            if is_news(state, seen) {
                return;
            }
            let sleeping = state | SLEEPING;
            if self.state.compare_exchange(state, sleeping, Ordering::Relaxed, Ordering::Relaxed).is_ok() {
                guard = self.wakeup.wait(guard).unwrap_or_else(PoisonError::into_inner);
            }
        }
    }

    /// Wakes all helpers that have set `SLEEPING`: a helper that does not wait yet holds the lock.
    fn wake(&self) {
        drop(lock(&self.sleep_lock));
        self.wakeup.notify_all();
    }
}
