//! What ends by unwinding on purpose, from the middle of a solve: a call that was cancelled, or that lacks memory. Neither is a
//! panic: no hook is told, and nothing is printed. That keeps the hundreds of places that build arrays, and the stages, free
//! of error handling; what they had built until then is freed on the way.

use std::any::Any;
use std::fmt;
use std::panic::{AssertUnwindSafe, catch_unwind, resume_unwind};

use crate::error::{Error, ErrorKind, Result};

/// Why a call unwinds.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Stop {
    Cancelled,
    /// These bytes could not be had.
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
#[expect(clippy::disallowed_methods, reason = "of constant size: there is a reserve for it")]
pub(crate) fn unwind(stop: Stop) -> ! {
    resume_unwind(Box::new(stop))
}

/// Why a body unwound, unless it was a panic.
pub(crate) fn why(payload: &(dyn Any + Send)) -> Option<Stop> {
    payload.downcast_ref().copied()
}

/// Calls `body`. If it unwinds, that is an error; panics go on.
///
/// # Errors
/// `Cancelled`, `OutOfMemory`, and those of `body`.
pub(crate) fn caught<R>(body: impl FnOnce() -> Result<R>) -> Result<R> {
    // What `body` leaves half changed is dropped with its owner; `Asset` says what becomes of its state.
    catch_unwind(AssertUnwindSafe(body)).unwrap_or_else(|payload| match why(&*payload) {
        Some(stop) => Err(stop.error()),
        None => resume_unwind(payload),
    })
}

/// Holds back what `body` unwinds with, so that what it was lent can be put back first; [`go_on`] lets it go on. Memory that
/// solves keep has to be whole after a cancelled one.
pub(crate) fn hold_back<R>(body: impl FnOnce() -> R) -> std::thread::Result<R> {
    catch_unwind(AssertUnwindSafe(body))
}

/// See [`hold_back`].
pub(crate) fn go_on<R>(held_back: std::thread::Result<R>) -> R {
    held_back.unwrap_or_else(|payload| resume_unwind(payload))
}
