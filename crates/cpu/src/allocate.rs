//! Allocation of a solver's memory. Structures are constructed with an [`Allocate`], which either allocates their
//! arrays or counts their bytes. Both use the same code, so the count is exact.

use vrtm_core::allocation::{Plain, Vec, vec, zeroed};

/// Provides the arrays of a structure.
pub trait Allocate {
    /// An array of `count` elements.
    fn array<T: Plain + Copy>(&mut self, element: T, count: usize) -> Vec<T>;

    /// An array of `count` zeros.
    fn zeros<T: Plain>(&mut self, count: usize) -> Vec<T>;
}

/// Allocates the arrays on the heap.
pub struct Heap;

impl Allocate for Heap {
    fn array<T: Plain + Copy>(&mut self, element: T, count: usize) -> Vec<T> {
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
    fn array<T: Plain + Copy>(&mut self, _: T, count: usize) -> Vec<T> {
        self.zeros(count)
    }

    fn zeros<T: Plain>(&mut self, count: usize) -> Vec<T> {
        self.bytes += count as u64 * size_of::<T>() as u64;
        Vec::new()
    }
}
