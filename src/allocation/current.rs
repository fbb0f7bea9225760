//! Per-thread allocation state: whose allocator allocations come from, and whether the present one may fail.

use std::cell::Cell;
use std::ptr;

use super::host::{HostAllocator, Record};

// Plain values, initialised at compile time: no destructor is registered with the thread, which would keep the library
// from being unloaded, and reading them allocates nothing.
thread_local! {
    /// The host's allocator that this thread uses; null = the system's.
    static RECORD: Cell<*const Record> = const { Cell::new(ptr::null()) };
    /// True while an allocation whose caller checks for failure is in progress.
    static FALLIBLE: Cell<bool> = const { Cell::new(false) };
}

/// The allocator that a thread uses, to be entered on another thread.
#[derive(Clone, Debug, Default)]
pub(crate) struct Current(Option<HostAllocator>);

impl Current {
    /// The allocator of a device: the host's, if it supplied one.
    pub fn new(allocator: Option<&HostAllocator>) -> Current {
        Current(allocator.cloned())
    }

    /// The allocator that this thread uses.
    pub fn of_this_thread() -> Current {
        let record = RECORD.with(Cell::get);
        // SAFETY: a scope of this thread has entered the record, and keeps it alive.
        Current(unsafe { record.as_ref() }.map(HostAllocator::of_record))
    }

    /// Uses this allocator on this thread until the scope is dropped.
    #[must_use]
    pub fn enter(&self) -> Scope {
        let record = self.0.as_ref().map_or(ptr::null(), HostAllocator::record);
        Scope { before: RECORD.with(|current| current.replace(record)), _kept: self.clone() }
    }
}

/// While it lives, this thread uses the given allocator.
pub(crate) struct Scope {
    before: *const Record,
    _kept: Current,
}

impl Drop for Scope {
    fn drop(&mut self) {
        RECORD.with(|current| current.set(self.before));
    }
}

/// While it lives, an allocation of this thread may fail.
pub(super) struct Fallible(bool);

impl Fallible {
    #[inline]
    pub fn enter() -> Fallible {
        Fallible(FALLIBLE.with(|fallible| fallible.replace(true)))
    }
}

impl Drop for Fallible {
    #[inline]
    fn drop(&mut self) {
        FALLIBLE.with(|fallible| fallible.set(self.0));
    }
}

/// True if the allocation in progress may fail.
#[cfg(feature = "allocator")]
pub(super) fn may_fail() -> bool {
    FALLIBLE.with(Cell::get)
}

/// The host's allocator that this thread uses, or null.
#[cfg(feature = "allocator")]
pub(super) fn record() -> *const Record {
    RECORD.with(Cell::get)
}

/// Calls `f`, a function of the host. Allocations that it makes through this library do not use the host's allocator.
#[cfg(feature = "allocator")]
pub(super) fn in_host<R>(f: impl FnOnce() -> R) -> R {
    let record = RECORD.with(|current| current.replace(ptr::null()));
    let fallible = FALLIBLE.with(|fallible| fallible.replace(false));
    let result = f();
    RECORD.with(|current| current.set(record));
    FALLIBLE.with(|current| current.set(fallible));
    result
}
