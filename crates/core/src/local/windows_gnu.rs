//! The record where the compiler has no thread locals of the loader's: std's then take one of the process's 1088
//! indices each, for good, even if the library is unloaded; and before Rust 1.93 their first use on a thread calls the
//! global allocator, which itself reads the record.
//!
//! This is one index of fiber-local storage. The system calls `free` for the record of each thread that ends, and for
//! all records when the index is given back, which happens when the library is unloaded.

use std::alloc::{GlobalAlloc, Layout, System};
use std::ffi::c_void;
use std::ptr;
use std::sync::atomic::{AtomicU32, Ordering};

use super::record::Local;

// Declared here, since a package of declarations would be one more dependency for eight lines.
#[link(name = "kernel32")]
unsafe extern "system" {
    fn FlsAlloc(callback: Option<unsafe extern "system" fn(*mut c_void)>) -> u32;
    fn FlsFree(index: u32) -> i32;
    fn FlsGetValue(index: u32) -> *mut c_void;
    fn FlsSetValue(index: u32, value: *mut c_void) -> i32;
}
#[link(name = "ntdll")]
unsafe extern "system" {
    fn RtlDllShutdownInProgress() -> u8;
}

/// FLS_OUT_OF_INDEXES.
const NONE: u32 = u32::MAX;
const DLL_PROCESS_DETACH: u32 = 0;

/// The index of all threads' records.
static INDEX: AtomicU32 = AtomicU32::new(NONE);

/// Calls `f` with this thread's record. A process without memory for it ends here, as with a thread local of std; entry
/// points of the C API ask `try_with` before that.
#[inline]
pub fn with<R>(f: impl FnOnce(&Local) -> R) -> R {
    match try_with(f) {
        Some(result) => result,
        None => std::process::abort(),
    }
}

/// The same, or `None` if there is no memory for the record.
#[inline]
pub fn try_with<R>(f: impl FnOnce(&Local) -> R) -> Option<R> {
    // SAFETY: any number may be asked for; without an index the answer is null.
    let mut local = unsafe { FlsGetValue(INDEX.load(Ordering::Acquire)) }.cast::<Local>();
    if local.is_null() {
        local = make()?;
    }
    // SAFETY: the record is this thread's alone, and lives as long as the thread.
    Some(f(unsafe { &*local }))
}

#[cold]
fn make() -> Option<*mut Local> {
    let index = index()?;
    // SAFETY: the layout is not empty; the memory has the record's layout; the index is this library's.
    unsafe {
        let local = System.alloc(Layout::new::<Local>()).cast::<Local>();
        if local.is_null() {
            return None;
        }
        local.write(Local::new());
        if FlsSetValue(index, local.cast()) == 0 {
            free(local.cast());
            return None;
        }
        Some(local)
    }
}

/// The index, which the first caller makes.
fn index() -> Option<u32> {
    let known = INDEX.load(Ordering::Acquire);
    if known != NONE {
        return Some(known);
    }
    // The linker would leave out what nothing reads.
    // SAFETY: a static of this file.
    unsafe { ptr::from_ref(&AT_UNLOAD).read_volatile() };
    // SAFETY: `free` is the callback that the function wants.
    let made = unsafe { FlsAlloc(Some(free)) };
    if made == NONE {
        return None;
    }
    match INDEX.compare_exchange(NONE, made, Ordering::AcqRel, Ordering::Acquire) {
        Ok(_) => Some(made),
        Err(other) => {
            // SAFETY: the index was just made, and nobody else knows it.
            unsafe { FlsFree(made) };
            Some(other)
        }
    }
}

/// Frees a thread's record.
unsafe extern "system" fn free(local: *mut c_void) {
    // SAFETY: `make` allocated it with this layout, and the system calls this once.
    unsafe { System.dealloc(local.cast(), Layout::new::<Local>()) };
}

/// The loader calls the functions in such sections in the order of their sections' names: this one after that of std,
/// whose destructors may still use the record.
#[unsafe(link_section = ".CRT$XLX")]
#[used]
static AT_UNLOAD: unsafe extern "system" fn(*mut c_void, u32, *mut c_void) = at_unload;

unsafe extern "system" fn at_unload(_module: *mut c_void, reason: u32, _reserved: *mut c_void) {
    // At the end of the process there is nothing to give back, and threads may have been ended within the heap.
    // SAFETY: it only asks.
    if reason != DLL_PROCESS_DETACH || unsafe { RtlDllShutdownInProgress() } != 0 {
        return;
    }
    let index = INDEX.swap(NONE, Ordering::AcqRel);
    if index != NONE {
        // SAFETY: no thread is inside a library that is being unloaded.
        unsafe { FlsFree(index) };
    }
}
