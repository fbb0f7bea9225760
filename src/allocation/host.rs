//! A host's allocator: its two functions, and who still needs them.

use std::ffi::c_void;
use std::fmt;
use std::ptr::NonNull;
use std::sync::atomic::{AtomicUsize, Ordering, fence};

/// Returns `size` bytes (at least 1) at a multiple of `alignment` (a power of two, at least 16), or null.
pub type AllocFn = unsafe extern "C" fn(user: *mut c_void, size: usize, alignment: usize) -> *mut c_void;
/// Takes back what the other function returned, with the same size and alignment.
pub type FreeFn =
    unsafe extern "C" fn(user: *mut c_void, pointer: *mut c_void, size: usize, alignment: usize);

/// A host's functions, and how many handles and blocks need them.
pub(super) struct Record {
    pub alloc: AllocFn,
    pub free: FreeFn,
    pub user: *mut c_void,
    needed_by: AtomicUsize,
}

/// Memory from a host, for all whose size follows from input: meshes, maps, grids, results, a solve's arrays. Blocks of at
/// least 4 KiB come from it; smaller ones, such as messages, from the system. Clones are handles to the same allocator.
///
/// It needs the cargo feature `allocator`; without it, a device cannot be made with one.
#[derive(PartialEq, Eq)]
pub struct HostAllocator(NonNull<Record>);

// SAFETY: the functions may be called on any thread, as `new` demands; the count is atomic.
unsafe impl Send for HostAllocator {}
// SAFETY: as above.
unsafe impl Sync for HostAllocator {}

impl HostAllocator {
    /// From a host's functions. If `alloc` returns null, a call that needed the memory fails with
    /// [`crate::ErrorKind::OutOfMemory`]; if a GPU's driver needed it, it comes from the system.
    ///
    /// # Safety
    /// Until the last device that was made with it and all of that device's assets are dropped, both functions may be
    /// called on any thread that works in a call, on several at once, with `user`. They must neither unwind nor use this
    /// library. What `alloc` returns is null, or is `size` bytes at a multiple of `alignment` that nothing else uses until
    /// `free` gets them back.
    #[must_use]
    #[expect(clippy::disallowed_methods, reason = "of constant size")]
    pub unsafe fn new(alloc: AllocFn, free: FreeFn, user: *mut c_void) -> HostAllocator {
        let record = Box::new(Record { alloc, free, user, needed_by: AtomicUsize::new(1) });
        HostAllocator(NonNull::from(Box::leak(record)))
    }

    pub(super) fn record(&self) -> *const Record {
        self.0.as_ptr()
    }

    /// One more handle to it.
    pub(super) fn of_record(record: &Record) -> HostAllocator {
        record.retain();
        HostAllocator(NonNull::from(record))
    }
}

impl Clone for HostAllocator {
    fn clone(&self) -> HostAllocator {
        // SAFETY: this handle keeps it.
        HostAllocator::of_record(unsafe { self.0.as_ref() })
    }
}

impl Drop for HostAllocator {
    fn drop(&mut self) {
        // SAFETY: this handle kept it.
        unsafe { Record::release(self.0.as_ptr()) };
    }
}

impl fmt::Debug for HostAllocator {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str("HostAllocator")
    }
}

impl Record {
    /// One more handle or block needs it.
    pub fn retain(&self) {
        self.needed_by.fetch_add(1, Ordering::Relaxed);
    }

    /// One less does; the last one frees it.
    ///
    /// # Safety
    /// `retain` was called for it, and nothing uses it for the same reason afterwards.
    pub unsafe fn release(record: *const Record) {
        // SAFETY: it was there until now.
        if unsafe { (*record).needed_by.fetch_sub(1, Ordering::Release) } == 1 {
            fence(Ordering::Acquire);
            // SAFETY: made by `Box::leak`, and nobody else needs it.
            drop(unsafe { Box::from_raw(record.cast_mut()) });
        }
    }
}
