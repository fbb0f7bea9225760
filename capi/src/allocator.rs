//! A host's allocator.

use std::ffi::c_void;

use super::desc::{self, sized};
use super::status::{Failure, Outcome};
use vrtm_core::allocation::HostAllocator;

/// A host's function that allocates: `size` bytes (at least 4096) at a multiple of `alignment` (a power of two, at
/// least 16), or null if there is no memory. The bytes need not be zero.
pub type vrtm_alloc_fn =
    Option<unsafe extern "C" fn(user: *mut c_void, size: usize, alignment: usize) -> *mut c_void>;

/// A host's function that frees memory, given the size and alignment of its allocation. Never called with null.
pub type vrtm_free_fn =
    Option<unsafe extern "C" fn(user: *mut c_void, pointer: *mut c_void, size: usize, alignment: usize)>;

/// A host's allocator, for all memory of a device that is sized by user input. Blocks of at least 4 KiB come from it;
/// smaller ones come from the system, as does the memory of a GPU's driver. Start from vrtm_allocator_init().
///
/// Both functions are called on any thread that works in a call, also by several at once, and must not call vrtm. They
/// and `user` must stay valid until the device and all of its assets are destroyed; by then everything has been freed.
/// If `alloc` returns null, the call fails with VRTM_ERROR_OUT_OF_MEMORY.
#[repr(C)]
#[derive(Clone, Copy)]
pub struct vrtm_allocator {
    /// sizeof(vrtm_allocator); set by vrtm_allocator_init().
    pub struct_size: u32,
    /// Allocates.
    pub alloc: vrtm_alloc_fn,
    /// Frees.
    pub free: vrtm_free_fn,
    /// Passed unchanged to both functions.
    pub user: *mut c_void,
}

// SAFETY: repr(C), struct_size first, plain numbers, raw pointers and optional functions.
sized!(vrtm_allocator);

/// Reads a host's allocator; null gives `None`, the system's allocator.
///
/// # Safety
/// The contract of pointers at the head of the header.
pub(super) unsafe fn read(pointer: *const vrtm_allocator, name: &str) -> Outcome<Option<HostAllocator>> {
    if pointer.is_null() {
        return Ok(None);
    }
    // SAFETY: the host's pointer.
    let from = unsafe { desc::read(pointer, name) }?;
    let alloc = from.alloc.ok_or_else(|| Failure::argument(format!("{name}.alloc is null")))?;
    let free = from.free.ok_or_else(|| Failure::argument(format!("{name}.free is null")))?;
    // SAFETY: the host vouches for its functions.
    Ok(Some(unsafe { HostAllocator::new(alloc, free, from.user) }))
}
