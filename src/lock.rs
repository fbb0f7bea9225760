//! Locking where a thread may have panicked with the lock: what all locks of the library guard is written in one step, so
//! that it is whole nevertheless.

use std::sync::{Mutex, MutexGuard, PoisonError};

/// Locks, whatever became of those that had the lock before.
pub(crate) fn lock<T>(mutex: &Mutex<T>) -> MutexGuard<'_, T> {
    mutex.lock().unwrap_or_else(PoisonError::into_inner)
}
