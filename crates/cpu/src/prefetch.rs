//! Prefetching. Blocks are large and are visited once per pass, so that a kernel that waits for each of its cache lines
//! may spend half of its time on that: a `normal` solve takes 5 to 9 % longer without.

#[cfg(target_arch = "x86_64")]
use std::arch::x86_64::{_MM_HINT_T0, _MM_HINT_T1, _mm_prefetch};

/// Asks for all cache lines of a value that is used now, in order. A kernel that reads many short runs of a value in
/// parallel does not reach the memory's full bandwidth by itself.
#[inline(always)]
pub fn prefetch<T>(value: *const T) {
    #[cfg(target_arch = "x86_64")]
    each_line::<_MM_HINT_T0, T>(value);
    #[cfg(not(target_arch = "x86_64"))]
    let _ = value;
}

/// Asks for all cache lines of a value of the next block, while this one is computed: they go to the second-level
/// cache, since the first one is full of this block.
#[inline(always)]
pub fn prefetch_next<T>(value: *const T) {
    #[cfg(target_arch = "x86_64")]
    each_line::<_MM_HINT_T1, T>(value);
    #[cfg(not(target_arch = "x86_64"))]
    let _ = value;
}

/// For passes that prefetch nothing of the next block.
pub fn nothing(_: usize) {}

/// Asks for each cache line of a value.
#[cfg(target_arch = "x86_64")]
#[inline(always)]
fn each_line<const HINT: i32, T>(value: *const T) {
    const LINE: usize = 64;
    for at in (0..size_of::<T>()).step_by(LINE) {
        // SAFETY: a prefetch reads nothing that the program could see.
        unsafe { _mm_prefetch::<HINT>(value.cast::<i8>().wrapping_add(at)) };
    }
}
