//! The shared library for C, C++ and Python. All of its code is in the package `vrtm`: the functions are in `src/ffi` and
//! come with the feature `capi`. A package of its own chooses the features that only this library has, a global allocator
//! and a panic hook among them, so that a Rust program that uses `vrtm` gets neither.

use vrtm_rust as _;
