//! Arrays of a solver's memory. One function lays a structure out over an [`Allocate`]; whether that counts bytes or
//! allocates them, the arrays are the same.

/// Takes the arrays of a structure, one after the other.
pub trait Allocate {
    /// An array of `count` elements.
    fn array<T: Clone>(&mut self, element: T, count: usize) -> Vec<T>;
}

/// Allocates.
pub struct Heap;

impl Allocate for Heap {
    fn array<T: Clone>(&mut self, element: T, count: usize) -> Vec<T> {
        vec![element; count]
    }
}

/// Counts the bytes; the arrays that it gives are empty.
#[derive(Default)]
pub struct Count {
    pub bytes: u64,
}

impl Allocate for Count {
    fn array<T: Clone>(&mut self, _: T, count: usize) -> Vec<T> {
        self.bytes += count as u64 * size_of::<T>() as u64;
        Vec::new()
    }
}
