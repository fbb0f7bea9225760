//! A team on a host's threads: those of a thread pool, a task scheduler, or anything else that runs a loop in parallel.

use std::sync::Mutex;
use std::sync::atomic::{AtomicUsize, Ordering};

use crate::control::lent;
use crate::float_mode::FloatMode;
use crate::panics::lock;

/// A host's threads, which replace the library's own.
pub trait Executor: Send + Sync {
    /// Calls `task(0)` to `task(count - 1)`, each once, on any threads and in any order, concurrently or sequentially,
    /// and returns when all of these calls have returned.
    fn parallel_for(&self, count: usize, task: &(dyn Fn(usize) + Sync));

    /// Calls a task once, on any thread, at any later time; or returns it, if the host accepts no tasks.
    ///
    /// # Errors
    /// The task itself.
    fn spawn(&self, task: Task) -> Result<(), Task> {
        Err(task)
    }
}

/// Work that is given to a host.
pub type Task = Box<dyn FnOnce() + Send>;

/// Runs `body` on one of a host's threads, and `help(number)` with different numbers over 0 on up to `threads - 1`
/// others. `body` does not unwind, and makes the helpers return. It works without helpers as well, since a host may run
/// its tasks one after the other.
pub(super) fn with<R: Send>(
    executor: &dyn Executor,
    threads: usize,
    help: impl Fn(usize) + Sync,
    body: impl FnOnce() -> R + Send,
) -> R {
    let (body, result) = (Mutex::new(Some(body)), Mutex::new(None));
    let helpers = AtomicUsize::new(0);
    let task = |_| {
        // A host's thread has the host's floating-point mode.
        let _mode = FloatMode::set_default();
        // The first task to begin runs the body, without which the others have nothing to do.
        let first = lock(&body).take();
        if let Some(body) = first {
            let done = lent(body);
            *lock(&result) = Some(done);
            return;
        }
        let number = 1 + helpers.fetch_add(1, Ordering::Relaxed);
        // A host that calls more tasks than requested gets no more helpers.
        if number < threads {
            help(number);
        }
    };
    executor.parallel_for(threads, &task);
    // If the host has called no task, this thread does the work.
    let left = lock(&body).take();
    if let Some(body) = left {
        return lent(body);
    }
    let done = lock(&result).take();
    // The body was called, and its task has returned, as all must: otherwise the host has broken its contract.
    done.unwrap_or_else(|| unreachable!("a task of the host's parallel_for is still running"))
}
