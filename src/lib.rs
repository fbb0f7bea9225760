//! vrtm keeps painted features rigid while the surface under them deforms: studs, scales, buttons.
//!
//! A [`Device`] is a CPU or a GPU. An [`Asset`] is a mesh on it, made from arrays ([`MeshSource`], [`Strided`]);
//! its UVs lie in tiles. [`Asset::tile_mut`] sets a tile's rigidity map ([`ImageView`]), mask and [`TileSettings`].
//! [`Asset::solve`] takes a pose, with [`SolveOptions`]; [`Results::tile`] and [`Results`] then read maps
//! ([`FetchKind`], [`ImageViewMut`]), corner UVs and reports ([`TileReport`], [`AssetReport`]); [`Asset::redirect`]
//! does both at once. A [`Carrier`] moves points with the surface; a [`Refinement`] splits a mesh for hosts that
//! have UV sets only. A [`Control`] cancels a solve.
//!
//! # Memory
//!
//! A call that runs out of memory returns [`ErrorKind::OutOfMemory`] and leaves everything as it was: this holds for
//! all arrays sized by user input. Small allocations such as messages abort the process when memory is exhausted, as
//! everywhere in Rust.
//!
//! A program whose global allocator is [`Allocator`] survives that too, and [`DeviceSettings::allocator`] is supported
//! in it.
//!
//! # Example
//!
//! Two squares side by side, one stretched and one squashed. The feature painted into their middle is to keep its
//! shape:
//!
//! ```
//! use vrtm::{
//!     Asset, Device, DeviceSettings, Fetch, FetchKind, ImageView, ImageViewMut, MeshSource, SolveOptions, Strided,
//!     UvSource,
//! };
//!
//! # fn main() -> vrtm::Result<()> {
//! let rest = [[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [2.0, 0.0, 0.0], [0.0, 1.0, 0.0], [1.0, 1.0, 0.0], [2.0, 1.0, 0.0]];
//! let uvs = rest.map(|[x, y, _]: [f32; 3]| [x / 2.0, y]);
//! let corners = [0, 1, 4, 3, 1, 2, 5, 4];
//!
//! // Once per mesh: the device, the asset, its maps.
//! let device = Device::new(&DeviceSettings::default())?;
//! let mut asset = Asset::new(&device, &MeshSource {
//!     positions: Strided::from_slice(&rest),
//!     face_counts: Some(&[4, 4]),
//!     indices: &corners,
//!     uvs: UvSource { u: Strided::from_slice(&uvs), v: None, indices: Some(&corners) },
//!     ..MeshSource::default()
//! })?;
//! let tile = asset.find_tile(1001).expect("the UVs lie in the first tile");
//! let painted: Vec<u8> =
//!     (0..32 * 32).map(|i| if (12..20).contains(&(i % 32)) && (12..20).contains(&(i / 32)) { 255 } else { 0 }).collect();
//! asset.tile_mut(tile).set_rigidity(Some(ImageView::from_texels("rigidity", &painted, [32, 32])?))?;
//!
//! // Every frame: positions in, map out.
//! let mut pose = rest;
//! (pose[1][0], pose[4][0]) = (1.3, 1.3);
//! let mut map = vec![[0.0f32; 2]; 32 * 32];
//! let image = ImageViewMut::from_texels("image", &mut map, [32, 32])?;
//! let fetch = Fetch::Image { tile, kind: FetchKind::Redirection, image };
//! asset.redirect(Strided::from_slice(&pose), &SolveOptions::default(), &mut [fetch])?;
//!
//! let report = asset.tile(tile).report()?;
//! assert!(report.energy < report.energy_before);
//! assert!(report.min_jacobian > 0.0, "the warp is one-to-one");
//! let [u, v] = map[16 * 32 + 16];
//! assert!((u - 16.5 / 32.0).abs() > 0.01 && (v - 15.5 / 32.0).abs() < 0.01, "the feature moves to the side");
//! # Ok(())
//! # }
//! ```

// Allocations sized by user input must be fallible: clippy.toml lists the infallible ones.
#![cfg_attr(not(test), warn(clippy::disallowed_macros, clippy::disallowed_methods, clippy::disallowed_types))]

#[macro_use(ensure)]
extern crate vrtm_core;

// Ordered from the bottom up: a module imports only modules above it in this list. `tests/house/arrows.rs` checks this.
mod device;
mod solved;
mod map;
mod asset;
mod refine;

pub use asset::Asset;
pub use asset::carrier::{Carried, Carrier, CarrierInfo, CarrierSettings};
pub use asset::outputs::Fetch;
pub use asset::read::Tile;
pub use asset::request::SolveRequest;
pub use asset::results::Results;
pub use asset::tiles::TileMut;
pub use device::{Device, adapters};
pub use half::f16;
pub use map::FetchKind;
pub use map::certificate::desc::{MapDesc, MapReport};
pub use refine::pattern::RefinementPattern;
pub use refine::{Refinement, RefinementInfo, RefinementSettings};
pub use vrtm_carry::{Bind, Fit, PointState};
pub use vrtm_core::allocation::{Allocator, HostAllocator};
pub use vrtm_core::control::{Control, ProgressFn};
pub use vrtm_core::declare::Setting;
pub use vrtm_core::error::{Error, ErrorKind, Result};
pub use vrtm_core::image::external::{ExternalHandle, ExternalImage};
pub use vrtm_core::image::format::PixelFormat;
pub use vrtm_core::image::texels::{InputTexel, OutputTexel};
pub use vrtm_core::image::{ImageLayout, ImageView, ImageViewMut, Origin};
pub use vrtm_core::log::{LogCode, LogEntry, LogFn, LogLevel};
pub use vrtm_core::mesh::{MeshSource, UvSource, Weld, WeldBy};
pub use vrtm_core::report::{
    AdapterInfo, AssetInfo, AssetReport, DeviceInfo, GpuKernel, GpuWork, StageTimes, Strain, StrainReport,
    TileEstimate, TileInfo, TileReport, WorstFeature,
};
pub use vrtm_core::settings::{
    AdapterId, Backend, DeviceSettings, MAX_GRID, OpenBorders, Overlap, PbdSettings, Quality, Scale, Seams,
    SolveOptions, Solver, TileSettings,
};
#[cfg(all(target_family = "wasm", target_feature = "atomics"))]
#[doc(hidden)]
pub use vrtm_core::team::threads::serve;
pub use vrtm_core::team::{Executor, Task};
pub use vrtm_core::view::{Element, Scalar, Strided, StridedMut};
