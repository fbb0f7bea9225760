//! The C API as hosts meet it: its header, its exports, programs that compile against it, and calls in random order.

mod abi;
mod documents;
mod elf;
mod ffi_random;
mod header;
mod tools;
