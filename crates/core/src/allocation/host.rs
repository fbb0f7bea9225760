//! A host's allocator: its two functions, kept as long as something needs them.

use std::ffi::c_void;
use std::fmt;
use std::sync::Arc;

/// Returns `size` bytes (at least 1) at a multiple of `alignment` (a power of two, at least 16), or null.
pub type AllocFn = unsafe extern "C" fn(user: *mut c_void, size: usize, alignment: usize) -> *mut c_void;
/// Frees what the other function returned, with the same size and alignment.
pub type FreeFn =
    unsafe extern "C" fn(user: *mut c_void, pointer: *mut c_void, size: usize, alignment: usize);

/// A host's functions; handles and blocks that need them share the record.
pub(super) struct Record {
    pub alloc: AllocFn,
    pub free: FreeFn,
    pub user: *mut c_void,
}

// SAFETY: the functions may be called on any thread, as `HostAllocator::new` demands.
unsafe impl Send for Record {}
// SAFETY: as above.
unsafe impl Sync for Record {}

/// Memory from a host, for everything sized by user input: meshes, maps, grids, results, a solve's arrays. Blocks of at
/// least 4 KiB come from it; smaller ones, such as messages, from the system. Clones are handles to the same allocator.
///
/// It needs the program's global allocator to be `Allocator`; otherwise making a device with one fails.
#[derive(Clone)]
pub struct HostAllocator(Arc<Record>);

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
    pub unsafe fn new(alloc: AllocFn, free: FreeFn, user: *mut c_void) -> HostAllocator {
        HostAllocator(Arc::new(Record { alloc, free, user }))
    }

    pub(super) fn record(&self) -> *const Record {
        Arc::as_ptr(&self.0)
    }

    /// One more handle to the same allocator.
    ///
    /// # Safety
    /// Another handle, or a block, keeps the record alive.
    pub(super) unsafe fn of_record(record: *const Record) -> HostAllocator {
        // SAFETY: the record is alive, and all records are made by `new`.
        unsafe {
            Arc::increment_strong_count(record);
            HostAllocator(Arc::from_raw(record))
        }
    }
}

impl fmt::Debug for HostAllocator {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str("HostAllocator")
    }
}
