//! The atomics, locks and spinning of `protocol`. `tests/loom` replaces them with loom's.

pub use std::hint::spin_loop;
pub use std::sync::atomic::{AtomicU64, AtomicUsize, Ordering};
pub use std::sync::{Condvar, Mutex, MutexGuard};
pub use std::thread::yield_now;

/// Rounds of polling for work before a helper goes to sleep: about 50 microseconds. Few for Miri, which is slow.
pub const SPINS: usize = if cfg!(miri) { 10 } else { 4000 };
