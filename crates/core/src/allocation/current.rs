//! Per-thread allocation state: whose allocator allocations come from, and whether the present one may fail.

use std::ptr;

use super::host::{HostAllocator, Record};
use crate::local;

/// The allocator that a thread uses, to be entered on another thread.
#[derive(Clone, Debug, Default)]
pub struct Current(Option<HostAllocator>);

impl Current {
    /// The allocator of a device: the host's, if it supplied one.
    pub fn new(allocator: Option<&HostAllocator>) -> Current {
        Current(allocator.cloned())
    }

    /// The allocator that this thread uses.
    pub fn of_this_thread() -> Current {
        let record = record();
        // SAFETY: a scope of this thread has entered the record, and keeps it alive.
        Current((!record.is_null()).then(|| unsafe { HostAllocator::of_record(record) }))
    }

    /// Uses this allocator on this thread until the scope is dropped.
    #[must_use]
    pub fn enter(&self) -> Scope {
        let record = self.0.as_ref().map_or(ptr::null(), HostAllocator::record);
        Scope { before: replace(record), _kept: self.clone() }
    }
}

/// While it lives, this thread uses the given allocator.
pub struct Scope {
    before: *const Record,
    _kept: Current,
}

impl Drop for Scope {
    fn drop(&mut self) {
        replace(self.before);
    }
}

/// While it lives, an allocation of this thread may fail.
pub struct Fallible(bool);

impl Fallible {
    #[inline]
    pub fn enter() -> Fallible {
        Fallible(local::with(|local| local.fallible.replace(true)))
    }
}

impl Drop for Fallible {
    #[inline]
    fn drop(&mut self) {
        local::with(|local| local.fallible.set(self.0));
    }
}

/// True if the allocation in progress may fail.
pub(super) fn may_fail() -> bool {
    local::with(|local| local.fallible.get())
}

/// The host's allocator that this thread uses, or null.
pub(super) fn record() -> *const Record {
    local::with(|local| local.allocator.get()).cast()
}

/// Sets it, and returns the one before.
fn replace(record: *const Record) -> *const Record {
    local::with(|local| local.allocator.replace(record.cast())).cast()
}

/// Calls `f`, a function of the host. Allocations that it makes through this library do not use the host's allocator.
pub(super) fn in_host<R>(f: impl FnOnce() -> R) -> R {
    let record = replace(ptr::null());
    let fallible = local::with(|local| local.fallible.replace(false));
    let result = f();
    replace(record);
    local::with(|local| local.fallible.set(fallible));
    result
}
