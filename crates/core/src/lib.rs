//! vrtm's numerical core, for the crates of vrtm alone: `vrtm` is the Rust API.
//!
//! The data flows through the modules in this order: a host's arrays (`view`, `image`) become a validated mesh with
//! tiles and charts (`mesh`); each tile's maps become a grid with movable nodes and active blocks (`grid`); for each
//! pose, `method::schedule` calls the stages of a backend level by level.

#![allow(missing_docs, reason = "documented for users where `vrtm` hands it on")]
// Allocations sized by user input must be fallible: clippy.toml lists the infallible ones.
#![warn(clippy::disallowed_macros, clippy::disallowed_methods, clippy::disallowed_types)]

// Ordered from the bottom up: a module imports only modules above it in this list. `tests/house/arrows.rs` checks this.
pub mod line;
pub mod clock;
pub mod local;
pub mod error;
pub mod declare;
pub mod unwind;
pub mod float_mode;
pub mod allocation;
pub mod panics;
pub mod control;
pub mod team;
pub mod view;
pub mod log;
pub mod settings;
pub mod report;
pub mod sets;
pub mod mesh;
pub mod image;
pub mod grid;
pub mod method;
pub mod backend;
pub mod strain;
#[doc(hidden)]
#[allow(clippy::disallowed_macros, clippy::disallowed_methods, reason = "no call of a host comes here")]
pub mod fixtures;
