//! The library's global allocator: large blocks come from the host's allocator if the calling thread works for a device
//! that has one, all other blocks from the system's.
//!
//! A header in front of each large block records its allocator, so that the block can be freed on any thread at any
//! time. Whether a block is large follows from its size, which is known when it is freed.
//!
//! A fallible allocation, made by the functions in `allocation`, returns null if that fails. Any other allocation, by
//! the standard library or a GPU's, would abort the process: it falls back to the system's allocator if the host's
//! fails, then to `emergency`.

use std::alloc::{GlobalAlloc, Layout, System};
use std::ptr;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};

use super::host::Record;
use super::{current, emergency};

/// Blocks of at least this many bytes are large.
pub const LARGE: usize = 4096;

/// The header in front of a large block.
#[repr(C, align(16))]
struct Header {
    /// The host's allocator of the block; null = the system's.
    record: *const Record,
    /// Size of the whole allocation. It may exceed the block's, if the block has shrunk in place.
    whole: usize,
}

/// A global allocator, which a program may have for itself: `#[global_allocator] static ALLOCATOR: vrtm::Allocator =
/// vrtm::Allocator;`. Large blocks come from a host's allocator if the calling thread works for a device that has
/// one, all others from the system; small blocks that the system refuses come from a reserve. The shared library
/// brings it along.
#[derive(Debug)]
pub struct Allocator;

impl Record {
    /// Allocates from the host; null on failure.
    ///
    /// # Safety
    /// `size` is not 0, and `alignment` is a power of two.
    unsafe fn alloc(&self, size: usize, alignment: usize) -> *mut u8 {
        // SAFETY: as `HostAllocator::new` demands.
        let memory = current::in_host(|| unsafe { (self.alloc)(self.user, size, alignment) }).cast::<u8>();
        if memory.addr() & (alignment - 1) == 0 {
            return memory;
        }
        // A misaligned block is as good as none.
        // SAFETY: the block was just returned.
        unsafe { self.free(memory, size, alignment) };
        ptr::null_mut()
    }

    /// Frees memory of the host.
    ///
    /// # Safety
    /// `memory` was returned by `alloc` for this size and alignment.
    unsafe fn free(&self, memory: *mut u8, size: usize, alignment: usize) {
        // SAFETY: as `HostAllocator::new` demands.
        current::in_host(|| unsafe { (self.free)(self.user, memory.cast(), size, alignment) });
    }
}

/// The layout of a large block with its header, and the offset of the block in it.
fn with_header(block: Layout) -> Option<(Layout, usize)> {
    let alignment = block.align().max(align_of::<Header>());
    let offset = alignment.max(size_of::<Header>());
    let whole = Layout::from_size_align(block.size().checked_add(offset)?, alignment).ok()?;
    Some((whole, offset))
}

/// The header of a large block.
///
/// # Safety
/// `block` is large and alive.
unsafe fn header(block: *mut u8) -> *mut Header {
    // SAFETY: the header is directly in front; the block's alignment suffices for it.
    unsafe { block.cast::<Header>().sub(1) }
}

/// Memory of the system, or of the reserve if the system has none and the allocation is infallible.
///
/// # Safety
/// That of `GlobalAlloc`.
#[inline]
unsafe fn system(layout: Layout, zeroed: bool) -> *mut u8 {
    // SAFETY: the caller's promise is passed on.
    let block = unsafe { if zeroed { System.alloc_zeroed(layout) } else { System.alloc(layout) } };
    if block.is_null() { in_need(layout, zeroed) } else { block }
}

/// The fallback when the system has no memory.
#[cold]
fn in_need(layout: Layout, zeroed: bool) -> *mut u8 {
    if current::may_fail() {
        return ptr::null_mut();
    }
    let block = emergency::alloc(layout);
    if zeroed && !block.is_null() {
        // SAFETY: the block has this size.
        unsafe { block.write_bytes(0, layout.size()) };
    }
    block
}

/// Frees what `system` returned.
///
/// # Safety
/// That of `GlobalAlloc`.
#[inline]
unsafe fn give_back(block: *mut u8, layout: Layout) {
    if emergency::holds(block) {
        // SAFETY: the block comes from the reserve.
        unsafe { emergency::free(block, layout.size()) };
    } else {
        // SAFETY: the caller's promise is passed on.
        unsafe { System.dealloc(block, layout) };
    }
}

/// A large block has been allocated here.
static IS_INSTALLED: AtomicBool = AtomicBool::new(false);

/// True if this is the program's global allocator.
pub fn is_installed() -> bool {
    #[expect(clippy::disallowed_types, reason = "a host without memory for it has none for a device")]
    drop(std::hint::black_box(Vec::<u8>::with_capacity(LARGE)));
    IS_INSTALLED.load(Ordering::Relaxed)
}

/// Allocates a large block.
///
/// # Safety
/// That of `GlobalAlloc`.
unsafe fn alloc_large(layout: Layout, zeroed: bool) -> *mut u8 {
    IS_INSTALLED.store(true, Ordering::Relaxed);
    let Some((whole, offset)) = with_header(layout) else { return ptr::null_mut() };
    let mut record = current::record();
    let mut memory = ptr::null_mut();
    // SAFETY: the scope that set the record keeps it alive.
    if let Some(host) = unsafe { record.as_ref() } {
        // SAFETY: the layout is not empty.
        memory = unsafe { host.alloc(whole.size(), whole.align()) };
        if !memory.is_null() {
            // SAFETY: as above. The block keeps the record alive.
            unsafe { Arc::increment_strong_count(record) };
            if zeroed {
                // SAFETY: the memory has this size.
                unsafe { memory.write_bytes(0, whole.size()) };
            }
        } else if current::may_fail() {
            return ptr::null_mut();
        }
    }
    if memory.is_null() {
        record = ptr::null();
        // SAFETY: the caller's promise is passed on.
        memory = unsafe { system(whole, zeroed) };
        if memory.is_null() {
            return memory;
        }
    }
    // SAFETY: both lie within the memory, which is aligned as required; the header fits in front of the block.
    unsafe {
        let block = memory.add(offset);
        header(block).write(Header { record, whole: whole.size() });
        block
    }
}

// SAFETY: blocks come from the host's or the system's allocator or the reserve, large ones behind a header; they return
// there with the layout of their allocation. Nothing here unwinds.
unsafe impl GlobalAlloc for Allocator {
    #[inline]
    unsafe fn alloc(&self, layout: Layout) -> *mut u8 {
        // SAFETY: the caller's promise is passed on.
        unsafe { if layout.size() < LARGE { system(layout, false) } else { alloc_large(layout, false) } }
    }

    #[inline]
    unsafe fn alloc_zeroed(&self, layout: Layout) -> *mut u8 {
        // SAFETY: the caller's promise is passed on.
        unsafe { if layout.size() < LARGE { system(layout, true) } else { alloc_large(layout, true) } }
    }

    #[inline]
    unsafe fn dealloc(&self, block: *mut u8, layout: Layout) {
        if layout.size() < LARGE {
            // SAFETY: the caller's promise is passed on.
            return unsafe { give_back(block, layout) };
        }
        // The block was allocated, so its layout is valid.
        let Some((whole, offset)) = with_header(layout) else { return };
        // SAFETY: `alloc_large` made the header and the whole memory; the block keeps its host's allocator alive.
        unsafe {
            let Header { record, whole: size } = header(block).read();
            let whole = Layout::from_size_align_unchecked(size, whole.align());
            let memory = block.sub(offset);
            match record.as_ref() {
                Some(host) => {
                    host.free(memory, whole.size(), whole.align());
                    Arc::decrement_strong_count(record);
                }
                None => give_back(memory, whole),
            }
        }
    }

    unsafe fn realloc(&self, block: *mut u8, layout: Layout, size: usize) -> *mut u8 {
        let Ok(wanted) = Layout::from_size_align(size, layout.align()) else { return ptr::null_mut() };
        // The system's allocator moves pages without copying them.
        // SAFETY: the same allocator as before gets the layout of the allocation.
        unsafe {
            if layout.size() < LARGE && size < LARGE {
                if !emergency::holds(block) {
                    let moved = System.realloc(block, layout, size);
                    if !moved.is_null() || current::may_fail() {
                        return moved;
                    }
                }
            } else if layout.size() >= LARGE
                && size >= LARGE
                && (*header(block)).record.is_null()
                && current::record().is_null()
                && let (Some((whole, offset)), Some((next, _))) = (with_header(layout), with_header(wanted))
                && !emergency::holds(block)
            {
                let whole = Layout::from_size_align_unchecked((*header(block)).whole, whole.align());
                let moved = System.realloc(block.sub(offset), whole, next.size());
                if !moved.is_null() {
                    let moved = moved.add(offset);
                    header(moved).write(Header { record: ptr::null(), whole: next.size() });
                    return moved;
                }
                if current::may_fail() && size > layout.size() {
                    return moved;
                }
            }
            let moved = self.alloc(wanted);
            if !moved.is_null() {
                ptr::copy_nonoverlapping(block, moved, size.min(layout.size()));
                self.dealloc(block, layout);
            } else if LARGE <= size && size <= layout.size() {
                // The block can stay in place.
                return block;
            }
            moved
        }
    }
}
