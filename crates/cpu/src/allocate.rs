//! Allocation of a solver's memory. Structures are constructed with an [`Allocator`], which either allocates their
//! arrays or only counts their bytes. Both use the same code, so the count is exact.

use vrtm_core::allocation::{Plain, Vec, zeroed};

/// Provides the arrays of a structure.
#[derive(Default)]
pub struct Allocator {
    /// True to count the bytes alone: all arrays are empty.
    pub only_counts: bool,
    pub bytes: u64,
}

impl Allocator {
    /// An array of `count` zeros.
    pub fn zeros<T: Plain>(&mut self, count: usize) -> Vec<T> {
        self.bytes += count as u64 * size_of::<T>() as u64;
        zeroed(if self.only_counts { 0 } else { count })
    }
}
