//! Allocation of a solver's memory. Structures are constructed with an [`Allocate`], which either allocates their
//! arrays or counts their bytes. Both use the same code, so the count is exact.

use vrtm_core::allocation::{Plain, Vec, zeroed};

/// Provides the arrays of a structure.
pub trait Allocate {
    /// An array of `count` zeros.
    fn zeros<T: Plain>(&mut self, count: usize) -> Vec<T>;
}

/// Allocates the arrays on the heap.
pub struct Heap;

impl Allocate for Heap {
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
    fn zeros<T: Plain>(&mut self, count: usize) -> Vec<T> {
        self.bytes += count as u64 * size_of::<T>() as u64;
        Vec::new()
    }
}
