//! Fallible allocation for memory sized by user input. When memory runs short, a call must fail instead of aborting the
//! host's process, as the standard library's collections do when they grow. All of them therefore grow through the
//! functions here, which unwind (`unwind`) when memory is missing.
//!
//! `clippy.toml` lists the standard library's ways to allocate, and the library's code is checked for them.

use std::sync::atomic::AtomicU8;

use crate::unwind::{Stop, unwind};

mod current;
mod emergency;
mod global;
mod host;

pub use current::Current;
pub use global::{Allocator, is_installed};
pub use host::HostAllocator;

/// Unwinds because there is no memory for `count` elements of type `T`.
#[cold]
fn missing<T>(count: usize) -> ! {
    unwind(Stop::OutOfMemory((count as u64).saturating_mul(size_of::<T>() as u64)))
}

/// An empty array with room for `count` elements.
pub fn with_capacity<T>(count: usize) -> Vec<T> {
    let mut array = Vec::new();
    array.make_exact_room(count);
    array
}

/// An array of `count` copies of `value`.
pub fn filled<T: Clone>(value: T, count: usize) -> Vec<T> {
    let mut array = with_capacity(count);
    #[expect(clippy::disallowed_methods, reason = "there is room")]
    array.resize(count, value);
    array
}

/// A copy of a slice.
pub fn copied<T: Clone>(slice: &[T]) -> Vec<T> {
    let mut array = with_capacity(slice.len());
    #[expect(clippy::disallowed_methods, reason = "there is room")]
    array.extend_from_slice(slice);
    array
}

/// A value on the heap.
pub fn boxed<T>(value: T) -> Box<T> {
    let mut array = with_capacity(1);
    #[expect(clippy::disallowed_methods, reason = "there is room")]
    array.push(value);
    debug_assert!(size_of::<T>() == 0 || array.capacity() == 1);
    #[expect(clippy::disallowed_methods, reason = "there is no spare capacity, so nothing is reallocated")]
    let one: Box<[T]> = array.into_boxed_slice();
    // SAFETY: a slice of one element has the layout of the element, which is owned by whoever has the pointer.
    unsafe { Box::from_raw(Box::into_raw(one).cast::<T>()) }
}

/// Numbers and booleans.
///
/// # Safety
/// All-zero bytes must be a valid value of the type.
pub unsafe trait Plain {}
macro_rules! plain {
    ($($number:ty),+) => {
        $(
            // SAFETY: all-zero bytes are the number 0, or false.
            unsafe impl Plain for $number {}
        )+
    };
}
plain!(u8, u16, u32, u64, usize, f32, f64, bool, AtomicU8);
// SAFETY: an array of such values is all zeros as well.
unsafe impl<T: Plain, const N: usize> Plain for [T; N] {}

/// `count` zeros. The system hands out the pages of a large array when they are first written, so pages that a solve
/// never touches cost no time. (A host's allocator has all of them written.)
pub fn zeroed<T: Plain>(count: usize) -> Vec<T> {
    use std::alloc::{Layout, alloc_zeroed};
    let Ok(layout) = Layout::array::<T>(count) else { missing::<T>(count) };
    if layout.size() == 0 {
        return Vec::new();
    }
    let fallible = current::Fallible::enter();
    // SAFETY: the layout is not empty.
    let memory = unsafe { alloc_zeroed(layout) };
    drop(fallible);
    if memory.is_null() {
        missing::<T>(count);
    }
    // SAFETY: `count` elements of zeros are valid, and the vector frees with the same layout.
    unsafe { Vec::from_raw_parts(memory.cast::<T>(), count, count) }
}

/// A zeroed value on the heap. Unlike with `boxed`, the value is never on the stack, which may be small.
pub fn zeroed_box<T: Plain>() -> Box<T> {
    #[expect(clippy::disallowed_methods, reason = "there is no spare capacity, so nothing is reallocated")]
    let one: Box<[T]> = zeroed(1).into_boxed_slice();
    // SAFETY: a slice of one element has the layout of the element, which is owned by whoever has the pointer.
    unsafe { Box::from_raw(Box::into_raw(one).cast::<T>()) }
}

/// Growth of a `Vec` that unwinds when memory runs short.
pub trait Grow<T> {
    /// Makes room for `count` more elements, with spare capacity for later growth.
    fn make_room(&mut self, count: usize);
    /// Makes room for exactly `count` more elements.
    fn make_exact_room(&mut self, count: usize);
    /// Appends an element.
    fn put(&mut self, value: T);
    /// Inserts an element.
    fn put_at(&mut self, index: usize, value: T);
    /// Appends every element that an iterator yields.
    fn put_all(&mut self, values: impl IntoIterator<Item = T>);
    /// Gives unused capacity back.
    fn give_room_back(&mut self);
    /// Changes the length; new elements are copies of `value`.
    fn fill_to(&mut self, count: usize, value: T)
    where
        T: Clone;
}

impl<T> Grow<T> for Vec<T> {
    #[inline]
    fn make_room(&mut self, count: usize) {
        if self.capacity() - self.len() < count {
            grow(self, count);
        }
    }

    fn make_exact_room(&mut self, count: usize) {
        if self.capacity() - self.len() >= count {
            return;
        }
        let fallible = current::Fallible::enter();
        #[expect(clippy::disallowed_methods, reason = "may fail")]
        let room = self.try_reserve_exact(count);
        drop(fallible);
        if room.is_err() {
            missing::<T>(self.len().saturating_add(count));
        }
    }

    #[inline]
    #[expect(clippy::disallowed_methods, reason = "there is room")]
    fn put(&mut self, value: T) {
        self.make_room(1);
        self.push(value);
    }

    #[expect(clippy::disallowed_methods, reason = "there is room")]
    fn put_at(&mut self, index: usize, value: T) {
        self.make_room(1);
        self.insert(index, value);
    }

    #[inline]
    fn put_all(&mut self, values: impl IntoIterator<Item = T>) {
        let values = values.into_iter();
        match values.size_hint() {
            (least, Some(most)) if least == most => {
                self.make_room(least);
                #[expect(clippy::disallowed_methods, reason = "there is room")]
                self.extend(values);
            }
            (least, _) => {
                self.make_room(least);
                values.for_each(|value| self.put(value));
            }
        }
    }

    #[expect(clippy::disallowed_methods, reason = "shrinking may leave the block as it is")]
    fn give_room_back(&mut self) {
        self.shrink_to_fit();
    }

    fn fill_to(&mut self, count: usize, value: T)
    where
        T: Clone,
    {
        self.make_exact_room(count.saturating_sub(self.len()));
        #[expect(clippy::disallowed_methods, reason = "there is room")]
        self.resize(count, value);
    }
}

/// Makes room for more elements. A function of its own, to stay out of the loops that append.
#[cold]
#[inline(never)]
fn grow<T>(array: &mut Vec<T>, count: usize) {
    let fallible = current::Fallible::enter();
    #[expect(clippy::disallowed_methods, reason = "may fail")]
    let room = array.try_reserve(count);
    drop(fallible);
    if room.is_err() {
        missing::<T>(array.len().saturating_add(count));
    }
}

/// `Iterator::collect` that unwinds when memory runs short.
pub trait Collect: Iterator + Sized {
    /// Collects every element.
    #[inline]
    fn collected(self) -> Vec<Self::Item> {
        let mut array = Vec::new();
        let (least, most) = self.size_hint();
        if most == Some(least) {
            array.make_exact_room(least);
        }
        array.put_all(self);
        array
    }

    /// Collects every element, or returns the first error.
    #[inline]
    fn try_collected<T, E>(self) -> std::result::Result<Vec<T>, E>
    where
        Self: Iterator<Item = std::result::Result<T, E>>,
    {
        let mut array = Vec::new();
        for value in self {
            array.put(value?);
        }
        Ok(array)
    }
}

impl<I: Iterator> Collect for I {}

/// Makes room for `count` more entries of a hash table.
pub fn make_room_in<K: Eq + std::hash::Hash, V, S: std::hash::BuildHasher>(
    table: &mut std::collections::HashMap<K, V, S>,
    count: usize,
) {
    let fallible = current::Fallible::enter();
    let room = table.try_reserve(count);
    drop(fallible);
    if room.is_err() {
        missing::<(K, V)>(table.len().saturating_add(count));
    }
}

#[cfg(test)]
mod tests;
