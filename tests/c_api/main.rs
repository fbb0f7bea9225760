//! The C API as hosts meet it: its header, its exports, programs that compile against it, and calls in random order.

mod abi;
mod elf;
mod ffi_random;
#[path = "../common/gpu.rs"]
mod gpu;
mod header;
mod host;
#[path = "../common/long.rs"]
mod long;
mod tools;
