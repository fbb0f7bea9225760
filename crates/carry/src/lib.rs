//! Carriers: points that are bound to the rest surface of an asset, and ride on it in any pose, under the warp, those
//! of rigid features as one body each. [`Binding`] binds them, [`Course`] finds where they stand on the tiles of a
//! result, and [`Carriage`] carries them into a pose.

#![allow(missing_docs, reason = "for the crates of vrtm alone")]
// Allocations sized by user input must be fallible: clippy.toml lists the infallible ones.
#![cfg_attr(not(test), warn(clippy::disallowed_macros, clippy::disallowed_methods, clippy::disallowed_types))]

// Ordered from the bottom up: a module imports only modules above it in this list. `tests/house/arrows.rs` checks this.
mod frame;
mod nearest;
mod surface;
mod bind;
mod tile;
mod features;
mod course;
mod carried;

pub use bind::{Bind, Binding, Pieces, PointState};
pub use carried::{Carriage, Carried, Parts};
pub use course::{Course, Fit, host_frame};
pub use features::bytes_of_features;
pub use tile::Tile;
