//! Errors: a kind (the C API's status) and a message that names the argument.

use std::fmt;

/// The kinds of failure, the same as the C API's `vrtm_status`. Any function that returns errors may return
/// `InvalidArgument` and `OutOfMemory`, and with a GPU `DeviceLost`; which else, and when, stands at the function.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub enum ErrorKind {
    /// An argument is out of its documented range, of a wrong length, or not finite; the message names it.
    InvalidArgument,
    /// The requested backend, format or combination is not available in this build or on this machine.
    Unsupported,
    /// Memory is exhausted, or the device's memory budget.
    OutOfMemory,
    /// Nothing has been solved yet, so there is no result to read.
    NotSolved,
    /// The GPU was lost: a driver reset, a crash, a removed adapter. Make a new device and new assets.
    DeviceLost,
    /// The call was cancelled; the asset keeps its last good result.
    Cancelled,
    /// A defect of the library; the asset keeps its last good result.
    Internal,
}

/// A failure: nothing was written, and the last good result is still readable.
#[derive(Clone, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub struct Error {
    /// The kind of failure.
    pub kind: ErrorKind,
    /// One line that names the argument and, if it applies, the index.
    pub message: String,
}

impl Error {
    #[doc(hidden)]
    pub fn new(kind: ErrorKind, message: impl Into<String>) -> Error {
        Error { kind, message: message.into() }
    }

    #[doc(hidden)]
    pub fn argument(message: impl Into<String>) -> Error {
        Error::new(ErrorKind::InvalidArgument, message)
    }
}

impl fmt::Display for Error {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(&self.message)
    }
}

impl std::error::Error for Error {}

/// Shorthand for results of this crate.
pub type Result<T> = std::result::Result<T, Error>;

/// Returns an error of a wrong argument, with this message, unless the condition holds.
#[doc(hidden)]
#[macro_export]
macro_rules! ensure {
    ($condition:expr, $($message:tt)+) => {
        if !$condition {
            return Err($crate::error::Error::argument(format!($($message)+)));
        }
    };
}
pub use ensure;
