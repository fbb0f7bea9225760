//! A team on a host's threads: of a thread pool, of a task scheduler, or of whatever else runs a loop in parallel.

use std::sync::Mutex;
use std::sync::atomic::{AtomicUsize, Ordering};

use crate::control::lent;
use crate::float_mode::FloatMode;
use crate::panics::lock;

/// A host's threads, which take the place of the library's own.
pub trait Executor: Send + Sync {
    /// Calls `task(0)` to `task(count - 1)`, each once, on any threads and in any order, side by side or one after the
    /// other, and returns when all of these calls have returned.
    fn parallel_for(&self, count: usize, task: &(dyn Fn(usize) + Sync));

    /// Calls a task once, on any thread, at any later time; or hands it back, if tasks cannot be left with the host.
    ///
    /// # Errors
    /// The task itself.
    fn spawn(&self, task: Task) -> Result<(), Task> {
        Err(task)
    }
}

/// Work that is left with a host.
pub type Task = Box<dyn FnOnce() + Send>;

/// Runs `body` on one of a host's threads, and `help(number)` with different numbers over 0 on up to `threads - 1` others.
/// `body` does not unwind, and makes the helpers return. It needs none of them: a host may run its tasks one after the
/// other.
pub(super) fn with<R: Send>(
    executor: &dyn Executor,
    threads: usize,
    help: impl Fn(usize) + Sync,
    body: impl FnOnce() -> R + Send,
) -> R {
    let (body, result) = (Mutex::new(Some(body)), Mutex::new(None));
    let helpers = AtomicUsize::new(0);
    let task = |_| {
        // A host's thread has a host's floating-point mode.
        let _mode = FloatMode::set_default();
        // The first task to begin is the body: the others have nothing to do without it.
        let first = lock(&body).take();
        if let Some(body) = first {
            let done = lent(body);
            *lock(&result) = Some(done);
            return;
        }
        let number = 1 + helpers.fetch_add(1, Ordering::Relaxed);
        // A host that calls more tasks than it was asked for gets no more helpers.
        if number < threads {
            help(number);
        }
    };
    executor.parallel_for(threads, &task);
    // A host that has called no task leaves the work to this thread.
    let left = lock(&body).take();
    if let Some(body) = left {
        return lent(body);
    }
    let done = lock(&result).take();
    // It was called, and its task has returned, as all have: otherwise the host has broken its word.
    done.unwrap_or_else(|| unreachable!("a task of the host's parallel_for is still running"))
}
