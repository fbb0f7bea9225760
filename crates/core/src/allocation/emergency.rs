//! The last resort: memory that is part of the library, for small infallible allocations when the system has none left,
//! such as those of an error on its way to the host.

use std::alloc::Layout;
use std::cell::UnsafeCell;
use std::ptr;
use std::sync::atomic::{AtomicBool, Ordering};

/// Total size in bytes. Pages that are never written cost no memory.
const BYTES: usize = 256 << 10;
/// Block sizes are multiples of this.
const UNIT: usize = 64;
const UNITS: usize = BYTES / UNIT;
/// The largest alignment.
pub const MAX_ALIGNMENT: usize = 4096;

#[repr(C, align(4096))]
struct Pool {
    memory: UnsafeCell<[u8; BYTES]>,
    /// True while a thread uses `taken`.
    locked: AtomicBool,
    /// True for the units that are taken.
    taken: UnsafeCell<[bool; UNITS]>,
}

// SAFETY: only the thread that has locked it uses `taken`; each part of `memory` belongs to the block handed out there.
unsafe impl Sync for Pool {}

static POOL: Pool = Pool {
    memory: UnsafeCell::new([0; BYTES]),
    locked: AtomicBool::new(false),
    taken: UnsafeCell::new([false; UNITS]),
};

/// Calls `f` with the units while no other thread does. Neither blocks nor allocates: `f` is a loop over some units.
fn with_units<R>(f: impl FnOnce(&mut [bool; UNITS]) -> R) -> R {
    while POOL.locked.compare_exchange_weak(false, true, Ordering::Acquire, Ordering::Relaxed).is_err() {
        std::hint::spin_loop();
    }
    // SAFETY: the pool is locked.
    let result = f(unsafe { &mut *POOL.taken.get() });
    POOL.locked.store(false, Ordering::Release);
    result
}

fn first() -> *mut u8 {
    POOL.memory.get().cast()
}

/// True if a block belongs to the pool.
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
    // SAFETY: the block lies within the pool.
    place.map_or(ptr::null_mut(), |at| unsafe { first().add(at * UNIT) })
}

/// Frees a block.
///
/// # Safety
/// `block` was returned by `alloc` for a layout of this size.
pub unsafe fn free(block: *mut u8, size: usize) {
    let at = (block.addr() - first().addr()) / UNIT;
    with_units(|units| units[at..at + size.div_ceil(UNIT)].fill(false));
}

/// Number of units taken.
pub fn taken() -> usize {
    with_units(|units| units.iter().filter(|taken| **taken).count())
}
