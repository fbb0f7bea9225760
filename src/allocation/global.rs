//! The library's global allocator: large blocks come from the host's allocator, if the call that takes them works for a
//! device that has one, and all others from the system's.
//!
//! In front of a large block stands whose it is, so that it can be freed on any thread and at any time. Whether a block is
//! large follows from its size, which the one who frees it knows.
//!
//! An allocation that may fail, of the functions in `memory`, then returns null. Any other one, of the standard library or
//! of a GPU's, would abort the process: it turns to the system's allocator if the host's fails, and to `emergency` then.

use std::alloc::{GlobalAlloc, Layout, System};
use std::ptr;

use super::host::Record;
use super::{current, emergency};

/// Blocks of at least so many bytes are large.
pub const LARGE: usize = 4096;

/// What stands in front of a large block.
#[repr(C, align(16))]
struct Header {
    /// The host's allocator that it came from; null = the system's.
    record: *const Record,
    /// Bytes of the whole memory. A block that has shrunk where it was is smaller.
    whole: usize,
}

/// See the module's documentation.
pub(crate) struct Allocator;

impl Record {
    /// Memory from the host, or null.
    ///
    /// # Safety
    /// `size` is not 0, and `alignment` is a power of two.
    unsafe fn alloc(&self, size: usize, alignment: usize) -> *mut u8 {
        // SAFETY: as `HostAllocator::new` demands.
        let memory = current::in_host(|| unsafe { (self.alloc)(self.user, size, alignment) }).cast::<u8>();
        if memory.addr() & (alignment - 1) == 0 {
            return memory;
        }
        // Not what was asked for: as good as none.
        // SAFETY: just returned.
        unsafe { self.free(memory, size, alignment) };
        ptr::null_mut()
    }

    /// Gives memory back.
    ///
    /// # Safety
    /// `alloc` returned it for this size and alignment.
    unsafe fn free(&self, memory: *mut u8, size: usize, alignment: usize) {
        // SAFETY: as `HostAllocator::new` demands.
        current::in_host(|| unsafe { (self.free)(self.user, memory.cast(), size, alignment) });
    }
}

/// The layout of a large block with its header, and where the block begins in it.
fn with_header(block: Layout) -> Option<(Layout, usize)> {
    let alignment = block.align().max(align_of::<Header>());
    let offset = alignment.max(size_of::<Header>());
    let whole = Layout::from_size_align(block.size().checked_add(offset)?, alignment).ok()?;
    Some((whole, offset))
}

/// The header of a large block.
///
/// # Safety
/// `block` is large, and alive.
unsafe fn header(block: *mut u8) -> *mut Header {
    // SAFETY: it stands right in front; the block is aligned for it.
    unsafe { block.cast::<Header>().sub(1) }
}

/// Memory of the system, and if it has none and the allocation must not fail, of the reserve.
///
/// # Safety
/// That of `GlobalAlloc`.
#[inline]
unsafe fn system(layout: Layout, zeroed: bool) -> *mut u8 {
    // SAFETY: passed on.
    let block = unsafe { if zeroed { System.alloc_zeroed(layout) } else { System.alloc(layout) } };
    if block.is_null() { in_need(layout, zeroed) } else { block }
}

/// What the system did not give.
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

/// Gives back what `system` returned.
///
/// # Safety
/// That of `GlobalAlloc`.
#[inline]
unsafe fn give_back(block: *mut u8, layout: Layout) {
    if emergency::holds(block) {
        // SAFETY: from there.
        unsafe { emergency::free(block, layout.size()) };
    } else {
        // SAFETY: passed on.
        unsafe { System.dealloc(block, layout) };
    }
}

/// A large block.
///
/// # Safety
/// That of `GlobalAlloc`.
unsafe fn alloc_large(layout: Layout, zeroed: bool) -> *mut u8 {
    let Some((whole, offset)) = with_header(layout) else { return ptr::null_mut() };
    let mut record = current::record();
    let mut memory = ptr::null_mut();
    // SAFETY: the scope that has set it keeps it.
    if let Some(host) = unsafe { record.as_ref() } {
        // SAFETY: a layout that is not empty.
        memory = unsafe { host.alloc(whole.size(), whole.align()) };
        if !memory.is_null() {
            host.retain();
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
        // SAFETY: passed on.
        memory = unsafe { system(whole, zeroed) };
        if memory.is_null() {
            return memory;
        }
    }
    // SAFETY: within the memory, which begins at a multiple of the alignment; the header fits in front of the block.
    unsafe {
        let block = memory.add(offset);
        header(block).write(Header { record, whole: whole.size() });
        block
    }
}

// SAFETY: blocks are those of the host's or the system's allocator or of the reserve, behind a header of their own if they
// are large; they are given back to where they came from with the layout that they were taken with. Nothing here unwinds.
unsafe impl GlobalAlloc for Allocator {
    #[inline]
    unsafe fn alloc(&self, layout: Layout) -> *mut u8 {
        // SAFETY: passed on.
        unsafe { if layout.size() < LARGE { system(layout, false) } else { alloc_large(layout, false) } }
    }

    #[inline]
    unsafe fn alloc_zeroed(&self, layout: Layout) -> *mut u8 {
        // SAFETY: passed on.
        unsafe { if layout.size() < LARGE { system(layout, true) } else { alloc_large(layout, true) } }
    }

    #[inline]
    unsafe fn dealloc(&self, block: *mut u8, layout: Layout) {
        if layout.size() < LARGE {
            // SAFETY: passed on.
            return unsafe { give_back(block, layout) };
        }
        // It was made when the block was.
        let Some((whole, offset)) = with_header(layout) else { return };
        // SAFETY: the header and the whole memory are those of `alloc_large`; the block keeps its host's allocator.
        unsafe {
            let Header { record, whole: size } = header(block).read();
            let whole = Layout::from_size_align_unchecked(size, whole.align());
            let memory = block.sub(offset);
            match record.as_ref() {
                Some(host) => {
                    host.free(memory, whole.size(), whole.align());
                    Record::release(record);
                }
                None => give_back(memory, whole),
            }
        }
    }

    unsafe fn realloc(&self, block: *mut u8, layout: Layout, size: usize) -> *mut u8 {
        let Ok(wanted) = Layout::from_size_align(size, layout.align()) else { return ptr::null_mut() };
        // The system's allocator moves pages without copying them.
        // SAFETY: the same allocator as before, which gets the layout that it gave the memory for.
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
                // There is no need to move.
                return block;
            }
            moved
        }
    }
}
