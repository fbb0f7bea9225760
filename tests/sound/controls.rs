//! Programs with a defect that a tool must find, each run by its name. Without a tool they may do anything.

use std::cell::UnsafeCell;
use std::sync::atomic::{AtomicUsize, Ordering};

#[derive(Default)]
struct Shared {
    number: UnsafeCell<u32>,
    /// Threads that have begun.
    begun: AtomicUsize,
}

// SAFETY: none. That is the defect.
unsafe impl Sync for Shared {}

impl Shared {
    /// The threads wait for each other in a way that orders nothing. If the second one began after the end of the first
    /// one, something in std could order them.
    fn add(&self) {
        self.begun.fetch_add(1, Ordering::Relaxed);
        while self.begun.load(Ordering::Relaxed) < 2 {
            std::thread::yield_now();
        }
        // SAFETY: none. That is the defect.
        (0..1000).for_each(|_| unsafe { *self.number.get() += 1 });
    }
}

/// Two threads write the same number at the same time.
#[test]
#[ignore = "a race, which a tool must find"]
fn race() {
    let shared = Shared::default();
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
