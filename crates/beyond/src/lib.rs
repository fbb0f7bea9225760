//! Charts that go on beyond their borders (method §16): a tile's charts get collars, copies of the surface beyond
//! their seams or mirror images beyond open borders, and are solved with them; then results are blended where they
//! have the surface in common (`blend`). Texels between charts belong to the nearest chart (`owners`), and
//! redirections beyond a border end where its collar does (`gutter`).

#![allow(missing_docs, reason = "for the crates of vrtm alone")]
// Allocations sized by user input must be fallible: clippy.toml lists the infallible ones.
#![cfg_attr(not(test), warn(clippy::disallowed_macros, clippy::disallowed_methods, clippy::disallowed_types))]

// Ordered from the bottom up: a module imports only modules above it in this list. `tests/house/arrows.rs` checks this.
pub mod bands;
pub mod owners;
pub mod gutter;
mod collar;
mod extended;
mod blend;

pub use blend::{Copies, Depths, Limited, Places, Side, blend};
pub use collar::{CollarTriangle, Surface, collar};
pub use extended::extended;
