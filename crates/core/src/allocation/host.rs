//! A host's allocator: its two functions, and a count of what still needs them.

use std::ffi::c_void;
use std::fmt;
use std::ptr::NonNull;
use std::sync::atomic::{AtomicUsize, Ordering};

/// Returns `size` bytes (at least 1) at a multiple of `alignment` (a power of two, at least 16), or null.
pub type AllocFn = unsafe extern "C" fn(user: *mut c_void, size: usize, alignment: usize) -> *mut c_void;
/// Frees what the other function returned, with the same size and alignment.
pub type FreeFn =
    unsafe extern "C" fn(user: *mut c_void, pointer: *mut c_void, size: usize, alignment: usize);

/// A host's functions, and the number of handles and blocks that need them.
pub(super) struct Record {
    pub alloc: AllocFn,
    pub free: FreeFn,
    pub user: *mut c_void,
    needed_by: AtomicUsize,
}

/// Memory from a host, for everything sized by user input: meshes, maps, grids, results, a solve's arrays. Blocks of at
/// least 4 KiB come from it; smaller ones, such as messages, from the system. Clones are handles to the same allocator.
///
/// It needs the program's global allocator to be `Allocator`; otherwise making a device with one fails.
#[derive(PartialEq, Eq)]
pub struct HostAllocator(NonNull<Record>);

// SAFETY: the functions may be called on any thread, as `new` demands; the count is atomic.
unsafe impl Send for HostAllocator {}
// SAFETY: as above.
unsafe impl Sync for HostAllocator {}

impl HostAllocator {
    /// Makes an allocator from a host's functions. If `alloc` returns null, a call that needed the memory fails with
    /// [`crate::ErrorKind::OutOfMemory`]; memory for a GPU's driver then comes from the system.
    ///
    /// # Safety
    /// Until the last device that was made with it and all of that device's assets are dropped, both functions may be
    /// called on any thread that works in a call, concurrently, with `user`. They must neither unwind nor use this
    /// library. `alloc` returns null, or `size` bytes at a multiple of `alignment` that nothing else uses until they
    /// are passed to `free`.
    #[must_use]
    #[expect(clippy::disallowed_methods, reason = "of constant size")]
    pub unsafe fn new(alloc: AllocFn, free: FreeFn, user: *mut c_void) -> HostAllocator {
        let record = Box::new(Record { alloc, free, user, needed_by: AtomicUsize::new(1) });
        HostAllocator(NonNull::from(Box::leak(record)))
    }

    pub(super) fn record(&self) -> *const Record {
        self.0.as_ptr()
    }

    /// One more handle to the same allocator. It takes a pointer, since the last handle frees the record, which a
    /// reference would not allow.
    ///
    /// # Safety
    /// Another handle, or a block, keeps the record alive.
    pub(super) unsafe fn of_record(record: NonNull<Record>) -> HostAllocator {
        // SAFETY: the record is alive.
        unsafe { record.as_ref() }.retain();
        HostAllocator(record)
    }
}

impl Clone for HostAllocator {
    fn clone(&self) -> HostAllocator {
        // SAFETY: this handle keeps the record alive.
        unsafe { HostAllocator::of_record(self.0) }
    }
}

impl Drop for HostAllocator {
    fn drop(&mut self) {
        // SAFETY: this handle kept the record alive.
        unsafe { Record::release(self.0.as_ptr()) };
    }
}

impl fmt::Debug for HostAllocator {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str("HostAllocator")
    }
}

impl Record {
    /// Counts one more handle or block.
    pub fn retain(&self) {
        self.needed_by.fetch_add(1, Ordering::Relaxed);
    }

    /// Counts one fewer; the last one frees the record.
    ///
    /// # Safety
    /// `retain` was called for this use of the record, which ends here.
    pub unsafe fn release(record: *const Record) {
        // SAFETY: the caller's use kept the record alive until now.
        if unsafe { (*record).needed_by.fetch_sub(1, Ordering::Release) } == 1 {
            // Orders what other threads did with the record before its end. A fence would do, but ThreadSanitizer
            // does not follow fences. SAFETY: only this thread still uses the record.
            unsafe { (*record).needed_by.load(Ordering::Acquire) };
            // SAFETY: the record was made by `Box::leak`, and nothing else needs it.
            drop(unsafe { Box::from_raw(record.cast_mut()) });
        }
    }
}
