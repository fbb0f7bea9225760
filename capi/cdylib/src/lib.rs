//! The shared library for C, C++ and Python. All of its code is in the package `vrtm-capi`, which is a library for
//! Rust, as tests need it.

use vrtm_capi as _;

#[cfg(all(windows, target_env = "gnu", not(target_abi = "llvm")))]
mod thread_indices;
