//! Version, status values and the message of a thread's last failure.

use std::ffi::{CStr, c_char};
use std::fmt::{self, Write};

use vrtm_core::error::{Error, ErrorKind};
use vrtm_core::line::Line;
use vrtm_core::local::{self, MESSAGE_BYTES};
use vrtm_core::panics::Panicked;

/// Major version of this header: functions and structs of another major version do not fit.
pub const VRTM_VERSION_MAJOR: u32 = 0;
/// Minor version of this header: a higher one adds functions and fields.
pub const VRTM_VERSION_MINOR: u32 = 1;
/// Patch version of this header.
pub const VRTM_VERSION_PATCH: u32 = 0;
/// Version of this header as one number, to compare with vrtm_version().
pub const VRTM_VERSION: u32 = VRTM_VERSION_MAJOR * 1000000 + VRTM_VERSION_MINOR * 1000 + VRTM_VERSION_PATCH;

/// Result of a call: VRTM_OK or one of the VRTM_ERROR_ values. The values are never renumbered; later versions
/// may add some, so treat any value but VRTM_OK as a failure.
pub type vrtm_status = i32;

/// The call succeeded.
pub const VRTM_OK: vrtm_status = 0;
/// An argument is null but not optional, out of its range, no value of its type, of a wrong size, count or stride, or
/// holds a NaN or an infinity.
pub const VRTM_ERROR_INVALID_ARGUMENT: vrtm_status = 1;
/// A handle is zero, destroyed, of another kind, or was never given out.
pub const VRTM_ERROR_INVALID_HANDLE: vrtm_status = 2;
/// The backend, format or combination is not available in this build or on this machine.
pub const VRTM_ERROR_UNSUPPORTED: vrtm_status = 3;
/// Out of memory, or over the device's memory budget.
pub const VRTM_ERROR_OUT_OF_MEMORY: vrtm_status = 4;
/// The asset, or the tile, has no result yet: solve first.
pub const VRTM_ERROR_NOT_SOLVED: vrtm_status = 5;
/// Another call is using the asset; try again when it has returned.
pub const VRTM_ERROR_BUSY: vrtm_status = 6;
/// The GPU was lost: a driver reset, a crash, a removed adapter. From then on every call that uses the device or its
/// assets gives this status, except calls that describe or destroy them. Destroy them, and make a new device and new
/// assets.
pub const VRTM_ERROR_DEVICE_LOST: vrtm_status = 7;
/// A defect of the library; please report the message. The asset keeps its last good result.
pub const VRTM_ERROR_INTERNAL: vrtm_status = 8;
/// The call or the job was cancelled; the asset keeps its last good result.
pub const VRTM_ERROR_CANCELLED: vrtm_status = 9;
/// The job was not done in time; wait again.
pub const VRTM_ERROR_TIMEOUT: vrtm_status = 10;

/// The version of the library that is loaded, as one number: major * 1000000 + minor * 1000 + patch. Compare it with
/// VRTM_VERSION, the version of the header. Never fails.
#[unsafe(no_mangle)]
pub extern "C" fn vrtm_version() -> u32 {
    VRTM_VERSION
}

/// The name of a status, such as "VRTM_ERROR_BUSY"; "unknown status" for any other value. The string is static: do not
/// free it. It is valid until the library is unloaded. Never fails.
#[unsafe(no_mangle)]
pub extern "C" fn vrtm_status_string(status: vrtm_status) -> *const c_char {
    let name: &'static CStr = match status {
        VRTM_OK => c"VRTM_OK",
        VRTM_ERROR_INVALID_ARGUMENT => c"VRTM_ERROR_INVALID_ARGUMENT",
        VRTM_ERROR_INVALID_HANDLE => c"VRTM_ERROR_INVALID_HANDLE",
        VRTM_ERROR_UNSUPPORTED => c"VRTM_ERROR_UNSUPPORTED",
        VRTM_ERROR_OUT_OF_MEMORY => c"VRTM_ERROR_OUT_OF_MEMORY",
        VRTM_ERROR_NOT_SOLVED => c"VRTM_ERROR_NOT_SOLVED",
        VRTM_ERROR_BUSY => c"VRTM_ERROR_BUSY",
        VRTM_ERROR_DEVICE_LOST => c"VRTM_ERROR_DEVICE_LOST",
        VRTM_ERROR_INTERNAL => c"VRTM_ERROR_INTERNAL",
        VRTM_ERROR_CANCELLED => c"VRTM_ERROR_CANCELLED",
        VRTM_ERROR_TIMEOUT => c"VRTM_ERROR_TIMEOUT",
        _ => c"unknown status",
    };
    name.as_ptr()
}

/// Message of this thread's last failed call: one UTF-8 line of at most 511 bytes with the function and the argument,
/// as in "vrtm_asset_create: desc.indices is null"; "" if no call has failed. A successful call does not change it. The
/// string belongs to the library and to the calling thread, and is valid until that thread's next failing call or its
/// end. Never fails.
#[unsafe(no_mangle)]
pub extern "C" fn vrtm_last_error() -> *const c_char {
    local::try_with(|local| local.message.get().cast_const().cast()).unwrap_or(NO_RECORD.as_ptr())
}

/// The status and message of a failed call.
#[derive(Clone, Debug)]
pub(super) struct Failure {
    pub status: vrtm_status,
    pub message: String,
}

impl Failure {
    pub fn new(status: vrtm_status, message: &str) -> Failure {
        Failure { status, message: message.to_owned() }
    }

    pub fn argument(message: impl Into<String>) -> Failure {
        Failure { status: VRTM_ERROR_INVALID_ARGUMENT, message: message.into() }
    }

    pub fn unsupported(message: impl Into<String>) -> Failure {
        Failure { status: VRTM_ERROR_UNSUPPORTED, message: message.into() }
    }
}

impl From<Error> for Failure {
    fn from(error: Error) -> Failure {
        let status = match error.kind {
            ErrorKind::InvalidArgument => VRTM_ERROR_INVALID_ARGUMENT,
            ErrorKind::Unsupported => VRTM_ERROR_UNSUPPORTED,
            ErrorKind::OutOfMemory => VRTM_ERROR_OUT_OF_MEMORY,
            ErrorKind::NotSolved => VRTM_ERROR_NOT_SOLVED,
            ErrorKind::DeviceLost => VRTM_ERROR_DEVICE_LOST,
            ErrorKind::Cancelled => VRTM_ERROR_CANCELLED,
            _ => VRTM_ERROR_INTERNAL,
        };
        Failure { status, message: error.message }
    }
}

/// The status of a call that a panic or a failed allocation ended.
pub(super) fn status_of(panic: &Panicked) -> vrtm_status {
    if panic.out_of_memory().is_some() { VRTM_ERROR_OUT_OF_MEMORY } else { VRTM_ERROR_INTERNAL }
}

/// Result of the functions inside the guard.
pub(super) type Outcome<T> = Result<T, Failure>;

/// The message for threads without memory for one.
const NO_RECORD: &CStr = c"out of memory for what the library keeps for each thread";

/// Keeps a message for [`vrtm_last_error`].
pub(super) fn set_last_error(function: &str, message: impl fmt::Display) {
    let mut line = Line::<MESSAGE_BYTES>::new();
    // Too long a message is cut, which is not a failure.
    let _ = write!(line, "{function}: {message}");
    // SAFETY: the storage belongs to this thread, and no reference into it is ever made.
    local::with(|local| unsafe { local.message.get().write(*line.bytes()) });
}

/// `text` as a zero-terminated C array, cut to fit, for a field of an output struct.
pub(super) fn chars<const N: usize>(text: &str) -> [c_char; N] {
    let mut line = Line::<N>::new();
    let _ = line.write_str(text);
    line.bytes().map(|byte| byte as c_char)
}

#[cfg(test)]
pub(super) mod tests {
    use super::*;

    pub fn last_error() -> String {
        // SAFETY: the function returns this thread's zero-terminated line.
        unsafe { CStr::from_ptr(vrtm_last_error()) }.to_str().unwrap().to_owned()
    }

    #[test]
    fn the_version_is_the_package_s() {
        let version = format!("{VRTM_VERSION_MAJOR}.{VRTM_VERSION_MINOR}.{VRTM_VERSION_PATCH}");
        assert_eq!(version, env!("CARGO_PKG_VERSION"));
    }

    #[test]
    fn a_message_is_kept_per_thread_and_cut_at_a_character() {
        assert_eq!(last_error(), "");
        set_last_error("f", "é".repeat(400));
        assert_eq!(last_error().len(), 3 + 508);
        std::thread::spawn(|| assert_eq!(last_error(), "")).join().unwrap();
        set_last_error("f", "one\nline");
        assert_eq!(last_error(), "f: one line");
    }

    #[test]
    fn every_status_has_a_name() {
        for status in VRTM_OK..=VRTM_ERROR_INTERNAL {
            // SAFETY: the function returns static strings.
            let name = unsafe { CStr::from_ptr(vrtm_status_string(status)) };
            assert!(name.to_str().unwrap().starts_with("VRTM_"), "{status}");
        }
    }
}
