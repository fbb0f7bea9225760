//! The last resort: memory that is part of the library, for small blocks that must be had when the system has none left:
//! what an error on its way to the host is made of.

use std::alloc::Layout;
use std::cell::UnsafeCell;
use std::ptr;
use std::sync::atomic::{AtomicBool, Ordering};

/// Bytes of all blocks. Pages that are never written cost no memory.
const BYTES: usize = 256 << 10;
/// Blocks are multiples of this.
const UNIT: usize = 64;
const UNITS: usize = BYTES / UNIT;
/// The largest alignment.
pub const MAX_ALIGNMENT: usize = 4096;

#[repr(C, align(4096))]
struct Pool {
    memory: UnsafeCell<[u8; BYTES]>,
    /// Whether a thread uses `taken`.
    locked: AtomicBool,
    /// Which units are taken.
    taken: UnsafeCell<[bool; UNITS]>,
}

// SAFETY: `taken` is used by the thread that has locked it alone; of `memory` each has the blocks that it was given.
unsafe impl Sync for Pool {}

static POOL: Pool = Pool {
    memory: UnsafeCell::new([0; BYTES]),
    locked: AtomicBool::new(false),
    taken: UnsafeCell::new([false; UNITS]),
};

/// Calls `f` with the units, while no other thread does. Neither waits nor allocates: `f` is a loop over some units.
fn with_units<R>(f: impl FnOnce(&mut [bool; UNITS]) -> R) -> R {
    while POOL.locked.compare_exchange_weak(false, true, Ordering::Acquire, Ordering::Relaxed).is_err() {
        std::hint::spin_loop();
    }
    // SAFETY: locked.
    let result = f(unsafe { &mut *POOL.taken.get() });
    POOL.locked.store(false, Ordering::Release);
    result
}

fn first() -> *mut u8 {
    POOL.memory.get().cast()
}

/// Whether a block is from here.
#[inline]
pub fn holds(block: *mut u8) -> bool {
    block.addr().wrapping_sub(first().addr()) < BYTES
}

/// A block, or null.
pub fn alloc(layout: Layout) -> *mut u8 {
    if layout.align() > MAX_ALIGNMENT {
        return ptr::null_mut();
    }
    let count = layout.size().div_ceil(UNIT);
    let step = layout.align().div_ceil(UNIT);
    let place = with_units(|units| {
        let mut at = 0;
        while at + count <= UNITS {
            match units[at..at + count].iter().rposition(|&taken| taken) {
                None => {
                    units[at..at + count].fill(true);
                    return Some(at);
                }
                Some(last) => at = (at + last + 1).next_multiple_of(step),
            }
        }
        None
    });
    // SAFETY: within the pool.
    place.map_or(ptr::null_mut(), |at| unsafe { first().add(at * UNIT) })
}

/// Gives a block back.
///
/// # Safety
/// `alloc` returned it for a layout of this size.
pub unsafe fn free(block: *mut u8, size: usize) {
    let at = (block.addr() - first().addr()) / UNIT;
    with_units(|units| units[at..at + size.div_ceil(UNIT)].fill(false));
}

/// Units that are taken.
#[cfg(test)]
pub fn taken() -> usize {
    with_units(|units| units.iter().filter(|taken| **taken).count())
}
