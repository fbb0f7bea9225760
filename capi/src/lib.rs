//! The shared library for C, C++ and Python. All of its code is in the package `vrtm`: the functions in `src/ffi`,
//! enabled by the feature `capi`. This separate package enables features that only the shared library should have, such
//! as a global allocator and a panic hook, so that a Rust program that uses `vrtm` gets neither.

use vrtm_rust as _;

#[cfg(all(windows, target_env = "gnu", not(target_abi = "llvm")))]
mod thread_indices;
