//! Allocation of a solver's memory. Structures are constructed with an [`Allocate`], which either allocates their
//! arrays or counts the bytes: both go through the same code, so that the count is exact.

use std::alloc::{Layout, alloc_zeroed, handle_alloc_error};

use super::sampling::TriangleRecord;

/// Numbers without bytes in between, for which zeros are a value.
///
/// # Safety
/// So it has to be.
pub unsafe trait Plain: Copy {}
// SAFETY: numbers.
unsafe impl Plain for f32 {}
// SAFETY: as above.
unsafe impl Plain for u16 {}
// SAFETY: as above.
unsafe impl Plain for u32 {}
// SAFETY: as above.
unsafe impl Plain for u64 {}
// SAFETY: of numbers.
unsafe impl<T: Plain, const N: usize> Plain for [T; N] {}
// SAFETY: sixteen f32.
unsafe impl Plain for TriangleRecord {}

/// `count` zeros. The system hands out the pages of a large array when they are written first: those that a solve does not
/// get to cost it no time.
pub fn zeroed<T: Plain>(count: usize) -> Vec<T> {
    let Ok(layout) = Layout::array::<T>(count) else { panic!("an array of {count} elements") };
    if layout.size() == 0 {
        return Vec::new();
    }
    // SAFETY: the layout is not empty; `count` elements of zeros are valid, and the vector frees with the same layout.
    unsafe {
        let memory = alloc_zeroed(layout);
        if memory.is_null() {
            handle_alloc_error(layout);
        }
        Vec::from_raw_parts(memory.cast::<T>(), count, count)
    }
}

/// Provides the arrays of a structure.
pub trait Allocate {
    /// An array of `count` elements.
    fn array<T: Plain>(&mut self, element: T, count: usize) -> Vec<T>;

    /// An array of `count` zeros.
    fn zeros<T: Plain>(&mut self, count: usize) -> Vec<T>;
}

/// Allocates the arrays on the heap.
pub struct Heap;

impl Allocate for Heap {
    fn array<T: Plain>(&mut self, element: T, count: usize) -> Vec<T> {
        vec![element; count]
    }

    fn zeros<T: Plain>(&mut self, count: usize) -> Vec<T> {
        zeroed(count)
    }
}

/// Counts the bytes of the arrays, and returns empty ones.
#[derive(Default)]
pub struct Count {
    pub bytes: u64,
}

impl Allocate for Count {
    fn array<T: Plain>(&mut self, _: T, count: usize) -> Vec<T> {
        self.zeros(count)
    }

    fn zeros<T: Plain>(&mut self, count: usize) -> Vec<T> {
        self.bytes += count as u64 * size_of::<T>() as u64;
        Vec::new()
    }
}
