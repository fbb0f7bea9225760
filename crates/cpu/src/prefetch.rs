//! Prefetching. Blocks are large and are visited once per pass, so that a kernel may wait for each of its cache lines:
//! a `normal` solve takes up to 3 % longer without.

/// Asks for all cache lines of a value that is used soon, in order: of this block, where a kernel that reads many short
/// runs of it in parallel would not reach the memory's full bandwidth by itself, or of the next one.
#[inline(always)]
pub fn prefetch<T>(value: *const T) {
    #[cfg(target_arch = "x86_64")]
    for at in (0..size_of::<T>()).step_by(64) {
        use std::arch::x86_64::{_MM_HINT_T0, _mm_prefetch};
        // SAFETY: a prefetch reads nothing that the program could see.
        unsafe { _mm_prefetch::<_MM_HINT_T0>(value.cast::<i8>().wrapping_add(at)) };
    }
    #[cfg(not(target_arch = "x86_64"))]
    let _ = value;
}

/// For passes that prefetch nothing of the next block.
pub fn nothing(_: usize) {}
