//! The library inside C and C++ hosts that are compiled with the system's compilers and linked to the built library.
//! Each host prints a line per case; a FAIL or a bad exit code fails the test. tests/c_api runs two of them in every
//! run.

// The hosts use POSIX threads, and the compiler's flags are those of gcc and clang: on Windows, MinGW-w64's.
#![cfg(any(unix, all(windows, target_env = "gnu")))]

#[path = "../c_api/tools.rs"]
mod tools;

mod host;
