//! The GPU backend: the stages of `cpu`, under the same names, as compute shaders on wgpu.

// Allocations sized by user input must be fallible: clippy.toml lists the infallible ones.
#![cfg_attr(not(test), warn(clippy::disallowed_macros, clippy::disallowed_methods, clippy::disallowed_types))]
#![allow(missing_docs, reason = "for the crates of vrtm alone")]

// Ordered from the bottom up: a module imports only modules above it in this list. `tests/house/arrows.rs` checks this.
mod identity;
mod wgsl;
pub mod layout;
mod kernels;
mod pipelines;
pub mod context;
pub mod adapters;
mod records;
mod correct;
mod lists;
mod timestamps;
mod transfer;
mod recorder;
mod results;
mod upload;
mod memory;
mod follow;
mod run;
mod dispatch;
mod redirect;
mod invert;
mod external;
pub mod state;
mod pbd;
mod stages;
mod backend;

pub use memory::Memory;
pub use run::Run;
