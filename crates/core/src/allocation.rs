//! Fallible allocation for memory sized by user input. When memory runs short, a call must fail instead of aborting the
//! host's process, as the standard library's collections do when they grow. `Vec` and the functions here unwind
//! (`unwind`) instead.
//!
//! `clippy.toml` lists the standard library's own, and the library's code is checked for them.

use std::sync::atomic::AtomicU8;

pub mod current;
pub mod emergency;
pub mod global;
pub mod host;
#[expect(clippy::disallowed_types, reason = "made of it")]
pub mod vec;

pub use current::Current;
pub use global::{Allocator, is_installed};
pub use host::HostAllocator;
pub use vec::Vec;
use vec::missing;

/// `std::vec!`, of `Vec`.
#[doc(hidden)]
#[macro_export]
macro_rules! __vec {
    () => { $crate::allocation::Vec::new() };
    ($value:expr; $count:expr) => { $crate::allocation::Vec::filled($value, $count) };
    ($($value:expr),+ $(,)?) => { $crate::allocation::Vec::of([$($value),+]) };
}

pub use __vec as vec;

/// A value on the heap.
pub fn boxed<T>(value: T) -> Box<T> {
    only(vec![value])
}

/// The one element of an array.
fn only<T>(one: Vec<T>) -> Box<T> {
    // Without spare capacity, so nothing is reallocated.
    let one = one.into_boxed_slice();
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
    unsafe { Vec::from_raw_parts(memory.cast::<T>(), count) }
}

/// A zeroed value on the heap. Unlike with `boxed`, the value is never on the stack, which may be small.
pub fn zeroed_box<T: Plain>() -> Box<T> {
    only(zeroed(1))
}

/// Makes room for `count` more entries of a hash table.
pub fn make_room_in<K: Eq + std::hash::Hash, V, S: std::hash::BuildHasher>(
    table: &mut std::collections::HashMap<K, V, S>,
    count: usize,
) {
    vec::make_room::<(K, V)>(table.len().saturating_add(count), || table.try_reserve(count));
}
