//! The C API: it guards against panics, checks arguments and delegates to the core. It computes nothing itself.
//!
//! Every exported function runs in `guard::guard`, which catches panics and turns a failure into a status and a message
//! for the calling thread. `handle` looks up handles; `desc` reads and writes structs that may grow. The types and doc
//! comments of these files are the C header (`include/vrtm.h`), so they address a C programmer. Functions must not come
//! from macros, which cbindgen does not expand.

#![allow(non_camel_case_types)] // The names are those of the C header.
#![allow(clippy::missing_safety_doc)] // The contract of all pointers stands once, at the head of the header.
#![allow(rustdoc::broken_intra_doc_links)] // The comments are C: `indices[k]` there is an array's element.

pub mod adapter;
pub mod allocator;
pub mod asset;
mod desc;
pub mod device;
pub mod dilation;
pub mod executor;
pub mod external;
pub mod fetch;
mod guard;
pub mod handle;
pub mod job;
pub mod map;
pub mod mesh;
pub mod prepare;
pub mod refine;
pub mod report;
mod shared;
pub mod solve;
pub mod status;
mod strips;
pub mod tile;
pub mod types;
