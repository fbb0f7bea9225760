//! The CPU backend: computes a tile's warp in f32 from its grid, maps and pose (method §5 to §10). Results have the
//! same bits for any number of threads.

#![allow(missing_docs, reason = "for the crates of vrtm alone")]
#![allow(clippy::needless_range_loop, reason = "index loops over several planes at once are what vectorises")]
#![allow(clippy::neg_cmp_op_on_partial_ord, reason = "a NaN must fail a check, not pass it")]

mod surface;
mod pyramid;
mod prolong;
mod harm;
mod relax;
mod correct;
mod pbd;
pub mod certify;
pub mod invert;

mod energy;
mod terms;
mod patch;
mod slopes;
mod sampling;
mod decode;
mod allocate;
mod buffers;
mod memory;
mod run;
pub mod prefetch;
mod state;

mod row;
mod lanes;

#[cfg(feature = "lab")]
pub use lanes::{ProcessorLevel, forced, processor_level};
pub use memory::Memory;
pub use run::Run;
