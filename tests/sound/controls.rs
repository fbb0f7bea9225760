//! Programs with a defect that a tool must find, each run by its name. Without a tool they may do anything.

use std::cell::UnsafeCell;

struct Shared(UnsafeCell<u32>);

// SAFETY: none. That is the defect.
unsafe impl Sync for Shared {}

impl Shared {
    fn add(&self) {
        // SAFETY: none. That is the defect.
        (0..1000).for_each(|_| unsafe { *self.0.get() += 1 });
    }
}

/// Two threads write the same number at the same time.
#[test]
#[ignore = "a race, which a tool must find"]
fn race() {
    let shared = Shared(UnsafeCell::new(0));
    std::thread::scope(|scope| {
        scope.spawn(|| shared.add());
        scope.spawn(|| shared.add());
    });
}

/// Frees a value through a pointer that was made of a shared reference.
#[test]
#[ignore = "undefined behaviour, which a tool must find"]
fn freed_through_a_reference() {
    let value = Box::leak(Box::new(1));
    let pointer = std::ptr::from_ref(&*value).cast_mut();
    // SAFETY: none. That is the defect.
    drop(unsafe { Box::from_raw(pointer) });
}
