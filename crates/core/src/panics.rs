//! Catches panics of this library and of the libraries that it calls, and turns them into an `Err` with the panic's
//! text. If the C functions have installed their hook (`hook`), the place of the panic is known and nothing is printed;
//! a Rust program keeps its own panic hook.

use std::any::Any;
use std::fmt;
use std::panic::resume_unwind;
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::sync::{Mutex, MutexGuard, PoisonError};

use crate::line::Line;
use crate::local::{self, PLACE_BYTES};
use crate::unwind::{Stop, why};

/// Reason for which a body did not return.
pub struct Panicked {
    payload: Box<dyn Any + Send>,
    /// Formatted as " (file:line:column)", or empty.
    place: Line<PLACE_BYTES>,
}

impl Panicked {
    /// The panic's message.
    pub fn text(&self) -> &str {
        let literal = self.payload.downcast_ref::<&'static str>().copied();
        let formatted = || self.payload.downcast_ref::<String>().map(String::as_str);
        literal.or_else(formatted).unwrap_or("a panic without a message")
    }

    /// The reason, if the body unwound for lack of memory instead of a panic.
    pub fn out_of_memory(&self) -> Option<Stop> {
        why(&*self.payload).filter(|stop| matches!(stop, Stop::OutOfMemory(_)))
    }

    /// File, line and column, to be appended to the text.
    pub fn place(&self) -> &str {
        self.place.as_str()
    }
}

impl fmt::Display for Panicked {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self.out_of_memory() {
            Some(short) => short.fmt(f),
            None => write!(f, "internal error: {}{}", self.text(), self.place()),
        }
    }
}

/// Runs third-party code that panics where it should fail (wgpu on a lost device). `Err` holds the panic's text and
/// place. An unwind for lack of memory passes through to the caller.
pub fn contain<R>(body: impl FnOnce() -> R) -> Result<R, String> {
    catch_here(body).map_err(|panic| {
        if panic.out_of_memory().is_some() {
            resume_unwind(panic.payload);
        }
        format!("{}{}", panic.text(), panic.place())
    })
}

/// Runs `body`, and returns its panic, if it panics, instead of unwinding.
#[allow(clippy::result_large_err, reason = "a box would need memory, which may be short")]
pub fn catch_here<R>(body: impl FnOnce() -> R) -> Result<R, Panicked> {
    struct Inside;
    impl Drop for Inside {
        fn drop(&mut self) {
            local::with(|local| local.depth.set(local.depth.get() - 1));
        }
    }
    local::with(|local| local.depth.set(local.depth.get() + 1));
    let _leave = Inside;
    // State that a panic leaves incomplete is dropped with its owner, or is behind a lock that discards it.
    catch_unwind(AssertUnwindSafe(body)).map_err(|payload| Panicked { payload, place: take_place() })
}

fn take_place() -> Line<PLACE_BYTES> {
    local::try_with(|local| local.place.replace(Line::new())).unwrap_or(Line::new())
}

/// Locks a mutex even if it is poisoned. Every value behind the library's locks is written in one step, so it is
/// consistent even if a thread panicked while holding the lock.
pub fn lock<T>(mutex: &Mutex<T>) -> MutexGuard<'_, T> {
    mutex.lock().unwrap_or_else(PoisonError::into_inner)
}
