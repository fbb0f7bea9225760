//! Tools for vrtm's tests and benches: the f64 minimum that results are compared with (`reference`, which shares no
//! numerical code with the solver), and a comparison of both backends, stage by stage (`parity`).

// Ordered from the bottom up.
mod reference;
mod parity;
mod asset;

pub use asset::{CollarOfChart, CollarTriangleInSpace, Lab, ReferenceMinimum};
pub use parity::StageDifference;
