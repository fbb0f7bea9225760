//! An array that grows as that of the standard library does, but unwinds when memory is short.

use std::collections::{BinaryHeap, TryReserveError};
use std::fmt;
use std::hash::{Hash, Hasher};
use std::ops::{Deref, DerefMut, RangeBounds};
use std::vec::{self, Drain, IntoIter};

use super::current::Fallible;
use crate::unwind::{Stop, unwind};

/// `std::vec::Vec`, except that it unwinds (`unwind`) when memory for its elements is missing, where that of the
/// standard library aborts the process.
pub struct Vec<T>(vec::Vec<T>);

impl<T> Vec<T> {
    /// An empty array, without memory.
    pub const fn new() -> Vec<T> {
        Vec(vec::Vec::new())
    }

    /// An empty array with room for `count` elements.
    pub fn with_capacity(count: usize) -> Vec<T> {
        let mut array = Vec::new();
        array.reserve_exact(count);
        array
    }

    /// `count` copies of `value`: `vec![value; count]`.
    pub fn filled(value: T, count: usize) -> Vec<T>
    where
        T: Clone,
    {
        let mut array = Vec::with_capacity(count);
        array.0.resize(count, value);
        array
    }

    /// The given elements: `vec![a, b, c]`.
    pub fn of<const N: usize>(values: [T; N]) -> Vec<T> {
        values.into_iter().collect()
    }

    /// Makes room for `count` more elements, with spare capacity for later growth.
    #[inline]
    pub fn reserve(&mut self, count: usize) {
        if self.0.capacity() - self.0.len() < count {
            self.grow(count);
        }
    }

    /// A function of its own, to stay out of the loops that append.
    #[cold]
    #[inline(never)]
    fn grow(&mut self, count: usize) {
        make_room::<T>(self.0.len().saturating_add(count), || self.0.try_reserve(count));
    }

    /// Makes room for exactly `count` more elements.
    pub fn reserve_exact(&mut self, count: usize) {
        if self.0.capacity() - self.0.len() < count {
            make_room::<T>(self.0.len().saturating_add(count), || self.0.try_reserve_exact(count));
        }
    }

    #[inline]
    pub fn push(&mut self, value: T) {
        self.reserve(1);
        self.0.push(value);
    }

    pub fn extend_from_slice(&mut self, slice: &[T])
    where
        T: Clone,
    {
        self.reserve(slice.len());
        self.0.extend_from_slice(slice);
    }

    pub fn insert(&mut self, index: usize, value: T) {
        self.reserve(1);
        self.0.insert(index, value);
    }

    pub fn resize(&mut self, count: usize, value: T)
    where
        T: Clone,
    {
        self.reserve_exact(count.saturating_sub(self.0.len()));
        self.0.resize(count, value);
    }

    /// An array of memory that the allocator has handed out for `count` elements.
    ///
    /// # Safety
    /// All of them are valid, and nothing else owns or frees the memory.
    pub(super) unsafe fn from_raw_parts(memory: *mut T, count: usize) -> Vec<T> {
        // SAFETY: the caller's promise is passed on.
        Vec(unsafe { vec::Vec::from_raw_parts(memory, count, count) })
    }

    /// The elements, without spare capacity.
    pub(super) fn into_boxed_slice(self) -> Box<[T]> {
        self.0.into_boxed_slice()
    }

    /// Gives unused capacity back. What cannot shrink stays as it is.
    pub fn shrink_to_fit(&mut self) {
        self.0.shrink_to_fit();
    }

    pub fn capacity(&self) -> usize {
        self.0.capacity()
    }

    pub fn pop(&mut self) -> Option<T> {
        self.0.pop()
    }

    pub fn clear(&mut self) {
        self.0.clear();
    }

    pub fn truncate(&mut self, count: usize) {
        self.0.truncate(count);
    }

    pub fn remove(&mut self, index: usize) -> T {
        self.0.remove(index)
    }

    pub fn drain(&mut self, range: impl RangeBounds<usize>) -> Drain<'_, T> {
        self.0.drain(range)
    }

    pub fn retain(&mut self, keep: impl FnMut(&T) -> bool) {
        self.0.retain(keep);
    }

    pub fn dedup(&mut self)
    where
        T: PartialEq,
    {
        self.0.dedup();
    }

    pub fn dedup_by(&mut self, same: impl FnMut(&mut T, &mut T) -> bool) {
        self.0.dedup_by(same);
    }
}

impl<T> Deref for Vec<T> {
    type Target = [T];

    #[inline]
    fn deref(&self) -> &[T] {
        &self.0
    }
}

impl<T> DerefMut for Vec<T> {
    #[inline]
    fn deref_mut(&mut self) -> &mut [T] {
        &mut self.0
    }
}

impl<T> Extend<T> for Vec<T> {
    #[inline]
    fn extend<I: IntoIterator<Item = T>>(&mut self, values: I) {
        let values = values.into_iter();
        let (least, most) = values.size_hint();
        self.reserve(least);
        if most == Some(least) {
            self.0.extend(values);
        } else {
            values.for_each(|value| self.push(value));
        }
    }
}

impl<'a, T: Copy> Extend<&'a T> for Vec<T> {
    #[inline]
    fn extend<I: IntoIterator<Item = &'a T>>(&mut self, values: I) {
        self.extend(values.into_iter().copied());
    }
}

impl<T> FromIterator<T> for Vec<T> {
    #[inline]
    fn from_iter<I: IntoIterator<Item = T>>(values: I) -> Vec<T> {
        let values = values.into_iter();
        let mut array = Vec::new();
        let (least, most) = values.size_hint();
        if most == Some(least) {
            array.reserve_exact(least);
        }
        array.extend(values);
        array
    }
}

impl<T: Clone> From<&[T]> for Vec<T> {
    fn from(slice: &[T]) -> Vec<T> {
        let mut array = Vec::with_capacity(slice.len());
        array.0.extend_from_slice(slice);
        array
    }
}

impl<T> From<vec::Vec<T>> for Vec<T> {
    fn from(array: vec::Vec<T>) -> Vec<T> {
        Vec(array)
    }
}

impl<T> From<Vec<T>> for vec::Vec<T> {
    fn from(array: Vec<T>) -> vec::Vec<T> {
        array.0
    }
}

impl<T: Ord> From<Vec<T>> for BinaryHeap<T> {
    fn from(array: Vec<T>) -> BinaryHeap<T> {
        array.0.into()
    }
}

impl<T> IntoIterator for Vec<T> {
    type Item = T;
    type IntoIter = IntoIter<T>;

    #[inline]
    fn into_iter(self) -> IntoIter<T> {
        self.0.into_iter()
    }
}

impl<'a, T> IntoIterator for &'a Vec<T> {
    type Item = &'a T;
    type IntoIter = std::slice::Iter<'a, T>;

    #[inline]
    fn into_iter(self) -> std::slice::Iter<'a, T> {
        self.iter()
    }
}

impl<'a, T> IntoIterator for &'a mut Vec<T> {
    type Item = &'a mut T;
    type IntoIter = std::slice::IterMut<'a, T>;

    #[inline]
    fn into_iter(self) -> std::slice::IterMut<'a, T> {
        self.iter_mut()
    }
}

impl<T: Clone> Clone for Vec<T> {
    fn clone(&self) -> Vec<T> {
        Vec::from(&**self)
    }
}

impl<T> Default for Vec<T> {
    fn default() -> Vec<T> {
        Vec::new()
    }
}

impl<T, S: AsRef<[T]> + ?Sized> PartialEq<S> for Vec<T>
where
    T: PartialEq,
{
    fn eq(&self, other: &S) -> bool {
        **self == *other.as_ref()
    }
}

impl<T: Eq> Eq for Vec<T> {}

impl<T: Hash> Hash for Vec<T> {
    fn hash<H: Hasher>(&self, state: &mut H) {
        self.0.hash(state);
    }
}

impl<T> AsRef<[T]> for Vec<T> {
    fn as_ref(&self) -> &[T] {
        self
    }
}

impl<T: fmt::Debug> fmt::Debug for Vec<T> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        self.0.fmt(f)
    }
}

/// Lets a collection of `T` try to have room for `count` elements in all; unwinds if it cannot.
pub(super) fn make_room<T>(count: usize, reserve: impl FnOnce() -> Result<(), TryReserveError>) {
    let fallible = Fallible::enter();
    let room = reserve();
    drop(fallible);
    if room.is_err() {
        missing::<T>(count);
    }
}

/// Unwinds because there is no memory for `count` elements of type `T`.
#[cold]
pub fn missing<T>(count: usize) -> ! {
    unwind(Stop::OutOfMemory((count as u64).saturating_mul(size_of::<T>() as u64)))
}
