//! The record itself.

use std::cell::{Cell, UnsafeCell};
use std::ffi::c_void;
use std::ptr;

use crate::line::Line;

/// Maximum length in bytes of a panic's place; a longer one is cut.
pub const PLACE_BYTES: usize = 128;

/// Size of the message of a failed call, with its terminating zero.
pub const MESSAGE_BYTES: usize = 512;

/// The record of one thread.
pub struct Local {
    /// True on a host's thread while it does a call's work (`control`).
    pub lent: Cell<bool>,
    /// Number of panic boundaries that this thread is inside: more than one if a host's callback calls the library
    /// (`panics`).
    pub depth: Cell<usize>,
    /// The place of this thread's last panic inside a boundary, set by the hook (`panics`).
    pub place: Cell<Line<PLACE_BYTES>>,
    /// The host's allocator that this thread uses; null = the system's (`allocation::current`, which knows the type).
    pub allocator: Cell<*const c_void>,
    /// True while an allocation whose caller checks for failure is in progress (`allocation::current`).
    pub fallible: Cell<bool>,
    /// The message of this thread's last failed call, ended by a zero (`ffi::status`).
    pub message: UnsafeCell<[u8; MESSAGE_BYTES]>,
}

impl Local {
    pub const fn new() -> Local {
        Local {
            lent: Cell::new(false),
            depth: Cell::new(0),
            place: Cell::new(Line::new()),
            allocator: Cell::new(ptr::null()),
            fallible: Cell::new(false),
            message: UnsafeCell::new([0; MESSAGE_BYTES]),
        }
    }
}
