//! Gives the indices of thread-local storage that std takes back to the process when the library is unloaded.
//!
//! For targets of GNU's tools std takes an index for each of its thread locals, and for those of other packages, when
//! it is first used: a process has 1088 of them, and std ends it when there are none left. It gives none back. build.rs
//! has the linker send the calls of `TlsAlloc` and `TlsFree` here (`--wrap`), where the library's indices are
//! remembered. Calls of other libraries, and of the host, are not touched.

use std::arch::global_asm;
use std::ffi::c_void;
use std::sync::atomic::{AtomicU64, Ordering};

unsafe extern "system" {
    #[link_name = "__real_TlsAlloc"]
    fn system_alloc() -> u32;
    #[link_name = "__real_TlsFree"]
    fn system_free(index: u32) -> i32;
}
#[link(name = "ntdll")]
unsafe extern "system" {
    fn RtlDllShutdownInProgress() -> u8;
}

// In assembly, since each function of Rust that has a fixed name would be exported by the library.
global_asm!(
    ".globl __wrap_TlsAlloc",
    "__wrap_TlsAlloc: jmp {}",
    ".globl __wrap_TlsFree",
    "__wrap_TlsFree: jmp {}",
    sym alloc,
    sym free,
);

/// A bit for each index that this library has; a process has at most 1088.
static TAKEN: [AtomicU64; 1088 / 64] = [const { AtomicU64::new(0) }; 1088 / 64];

/// The word of an index, and its bit in there; `None` for `TLS_OUT_OF_INDEXES`.
fn place(index: u32) -> Option<(&'static AtomicU64, u64)> {
    Some((TAKEN.get(index as usize / 64)?, 1 << (index % 64)))
}

unsafe extern "system" fn alloc() -> u32 {
    // SAFETY: the system's own function.
    let index = unsafe { system_alloc() };
    if let Some((word, bit)) = place(index) {
        word.fetch_or(bit, Ordering::Relaxed);
    }
    index
}

unsafe extern "system" fn free(index: u32) -> i32 {
    // Before another part of the process may get it.
    if let Some((word, bit)) = place(index) {
        word.fetch_and(!bit, Ordering::Relaxed);
    }
    // SAFETY: the caller's promise is passed on.
    unsafe { system_free(index) }
}

/// The loader calls the functions in such sections in the order of their sections' names: this one after that of std,
/// whose destructors still use the indices.
#[unsafe(link_section = ".CRT$XLY")]
#[used]
static AT_UNLOAD: unsafe extern "system" fn(*mut c_void, u32, *mut c_void) = at_unload;

unsafe extern "system" fn at_unload(_module: *mut c_void, reason: u32, _reserved: *mut c_void) {
    const DLL_PROCESS_DETACH: u32 = 0;
    // SAFETY: it only asks. At the end of the process all indices go with it.
    if reason != DLL_PROCESS_DETACH || unsafe { RtlDllShutdownInProgress() } != 0 {
        return;
    }
    for (number, word) in TAKEN.iter().enumerate() {
        let mut bits = word.swap(0, Ordering::Relaxed);
        while bits != 0 {
            let index = 64 * number as u32 + bits.trailing_zeros();
            // SAFETY: the library took the index, and no thread is inside a library that is being unloaded.
            unsafe { system_free(index) };
            bits &= bits - 1;
        }
    }
}
