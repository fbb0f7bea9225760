//! What this thread's allocations are for: whose allocator they come from, and whether one may fail.

use std::cell::Cell;
use std::ptr;

use super::host::{HostAllocator, Record};

// Plain values, initialised at compile time: no destructor is registered with the thread, which would keep the library
// from being unloaded, and reading them allocates nothing.
thread_local! {
    /// The host's allocator that this thread works with; null = the system's.
    static RECORD: Cell<*const Record> = const { Cell::new(ptr::null()) };
    /// Whether the allocation that is under way may fail: its caller looks at the result.
    static FALLIBLE: Cell<bool> = const { Cell::new(false) };
}

/// The allocator that a thread works with, to be entered on another one.
#[derive(Clone, Debug, Default)]
pub(crate) struct Current(Option<HostAllocator>);

impl Current {
    /// Of a device: the host's allocator, if there is one.
    pub fn new(allocator: Option<&HostAllocator>) -> Current {
        Current(allocator.cloned())
    }

    /// That of this thread.
    pub fn of_this_thread() -> Current {
        let record = RECORD.with(Cell::get);
        // SAFETY: a scope of this thread has entered it, and keeps it.
        Current(unsafe { record.as_ref() }.map(HostAllocator::of_record))
    }

    /// Works with it on this thread until the scope is dropped.
    #[must_use]
    pub fn enter(&self) -> Scope {
        let record = self.0.as_ref().map_or(ptr::null(), HostAllocator::record);
        Scope { before: RECORD.with(|current| current.replace(record)), _kept: self.clone() }
    }
}

/// While it lives, this thread works with an allocator.
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

/// Whether the allocation that is under way may fail.
#[cfg(feature = "allocator")]
pub(super) fn may_fail() -> bool {
    FALLIBLE.with(Cell::get)
}

/// The host's allocator that this thread works with, or null.
#[cfg(feature = "allocator")]
pub(super) fn record() -> *const Record {
    RECORD.with(Cell::get)
}

/// Calls `f`, a function of the host: what it allocates in this library is none of its own.
#[cfg(feature = "allocator")]
pub(super) fn in_host<R>(f: impl FnOnce() -> R) -> R {
    let record = RECORD.with(|current| current.replace(ptr::null()));
    let fallible = FALLIBLE.with(|fallible| fallible.replace(false));
    let result = f();
    RECORD.with(|current| current.set(record));
    FALLIBLE.with(|current| current.set(fallible));
    result
}
