//! What vrtm's tests, benches and examples share: built-in scenes and assets, measures of results that share no code
//! with the library, the f64 minimum that they are compared with (`reference`, which shares no numerical code with the
//! solver), and both backends side by side, stage by stage (`parity`).

#![allow(missing_docs, reason = "for vrtm's own programs alone")]

// Ordered from the bottom up.
pub mod long;
pub mod processor;
pub mod log;
pub mod bench;
pub mod random;
pub mod scenes;
pub mod save;
pub mod reference;
#[cfg(feature = "gpu")]
pub mod parity;
pub mod asset;
pub mod model;
pub mod files;
pub mod gpu;
pub mod warp;
pub mod refined;
pub mod roughness;
pub mod sixteen;
pub mod features;
pub mod table;
pub mod cases;

pub use asset::{CollarOfChart, CollarTriangleInSpace, Lab, ReferenceMinimum};
pub use files::{assets, obj};
pub use gpu::{backend, devices, gpu, gpus, has_gpu};
pub use model::{
    Model, analytic, bits, change, change_all, corner_uvs, cpu, dilation, doubles, faces, fetch, floats,
    on_all_cores, options, paint, quads, raw, set_grid, texels, view,
};
#[cfg(feature = "gpu")]
pub use parity::StageDifference;
pub use scenes::TileMaps as Maps;
pub use warp::{Warp, barycentric, cross};
