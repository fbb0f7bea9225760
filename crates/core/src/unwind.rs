//! Deliberate unwinding from the middle of a solve, when a call is cancelled or runs out of memory. It is not a panic:
//! no hook is called, and nothing is printed. This keeps the hundreds of places that build arrays, and the stages, free
//! of error handling; unwinding frees what they had built.

use std::any::Any;
use std::fmt;
use std::panic::{AssertUnwindSafe, catch_unwind, resume_unwind};

use crate::error::{Error, ErrorKind, Result};

/// Reason for which a call unwinds.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Stop {
    Cancelled,
    /// This many bytes could not be allocated.
    OutOfMemory(u64),
}

impl fmt::Display for Stop {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Stop::Cancelled => f.write_str("the call was cancelled"),
            Stop::OutOfMemory(bytes) => write!(f, "out of memory: {bytes} bytes could not be had"),
        }
    }
}

impl Stop {
    pub fn error(self) -> Error {
        let kind = match self {
            Stop::Cancelled => ErrorKind::Cancelled,
            Stop::OutOfMemory(_) => ErrorKind::OutOfMemory,
        };
        Error::new(kind, self.to_string())
    }
}

/// Unwinds to [`caught`].
#[cold]
#[expect(clippy::disallowed_methods, reason = "of constant size: a reserve provides it")]
pub fn unwind(stop: Stop) -> ! {
    resume_unwind(Box::new(stop))
}

/// Reason for which a body unwound; `None` for a panic.
pub fn why(payload: &(dyn Any + Send)) -> Option<Stop> {
    payload.downcast_ref().copied()
}

/// Calls `body`. Deliberate unwinding becomes an error; panics continue.
pub fn caught<R>(body: impl FnOnce() -> Result<R>) -> Result<R> {
    // Values that `body` leaves incomplete are dropped with their owners; `Asset` handles its own state.
    catch_unwind(AssertUnwindSafe(body)).unwrap_or_else(|payload| match why(&*payload) {
        Some(stop) => Err(stop.error()),
        None => resume_unwind(payload),
    })
}

/// Catches an unwind of `body`, so that borrowed state can be put back first; [`go_on`] resumes it. Memory that solves
/// keep must be intact after a cancelled one.
pub fn hold_back<R>(body: impl FnOnce() -> R) -> std::thread::Result<R> {
    catch_unwind(AssertUnwindSafe(body))
}

/// Resumes an unwind that [`hold_back`] caught.
pub fn go_on<R>(held_back: std::thread::Result<R>) -> R {
    held_back.unwrap_or_else(|payload| resume_unwind(payload))
}
