//! vrtm keeps painted features rigid while the surface under them deforms.
//!
//! The data flows through the modules in this order: a host's arrays (`view`, `image`) become a validated mesh with tiles
//! and charts (`mesh`); each tile's maps become a grid with movable nodes and active blocks (`grid`); for each pose,
//! `method::schedule` calls the stages of a backend (`cpu`, `gpu`) level by level (`solver`); `map` makes images of the
//! results, and [`Asset`] keeps all of it. `strain` measures results in double precision; `lab` is what tests compare them
//! with. `docs/method.md` is the mathematics, `docs/architecture.md` the map of the source.
//!
//! # Memory
//!
//! A call that runs out of memory returns [`ErrorKind::OutOfMemory`] and leaves everything as it was: this holds for all
//! arrays sized by user input. Small allocations such as messages abort the process when memory is exhausted, as
//! everywhere in Rust.
//!
//! The cargo feature `allocator` installs a global allocator for the whole program. With it, the process survives that
//! too, and [`DeviceSettings::allocator`] is supported.
//!
//! # Example
//!
//! Two squares side by side, one stretched and one squashed. The feature painted into their middle is to keep its shape:
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
//!     positions: Strided::from_f32x3(&rest),
//!     face_counts: Some(&[4, 4]),
//!     indices: &corners,
//!     uvs: UvSource { u: Strided::from_f32x2(&uvs), v: None, indices: Some(&corners) },
//!     ..MeshSource::default()
//! })?;
//! let tile = asset.find_tile(1001).expect("the UVs lie in the first tile");
//! let painted: Vec<u8> =
//!     (0..32 * 32).map(|i| if (12..20).contains(&(i % 32)) && (12..20).contains(&(i / 32)) { 255 } else { 0 }).collect();
//! asset.set_rigidity(tile, Some(ImageView::from_texels("rigidity", &painted, [32, 32])?))?;
//!
//! // Every frame: positions in, map out.
//! let mut pose = rest;
//! (pose[1][0], pose[4][0]) = (1.3, 1.3);
//! let mut map = vec![[0.0f32; 2]; 32 * 32];
//! let image = ImageViewMut::from_texels("image", &mut map, [32, 32])?;
//! let fetch = Fetch { tile, kind: FetchKind::Redirection, image };
//! asset.redirect(Strided::from_f32x3(&pose), &SolveOptions::default(), &mut [fetch])?;
//!
//! let report = asset.tile_report(tile)?;
//! assert!(report.energy < report.energy_before);
//! assert!(report.min_jacobian > 0.0, "the warp is one-to-one");
//! let [u, v] = map[16 * 32 + 16];
//! assert!((u - 16.5 / 32.0).abs() > 0.01 && (v - 15.5 / 32.0).abs() < 0.01, "the feature moves to the side");
//! # Ok(())
//! # }
//! ```

// Allocations sized by user input must be fallible: clippy.toml lists the infallible ones.
#![cfg_attr(not(test), warn(clippy::disallowed_macros, clippy::disallowed_methods))]
// Some code serves the C functions alone: copies of a host's arrays, threads of jobs.
#![cfg_attr(not(feature = "capi"), allow(dead_code, unused_imports))]

// Ordered from the bottom up: a module imports only modules above it in this list. `tests/house/arrows.rs` checks this.
mod line;
mod local;
mod error;
mod unwind;
mod float_mode;
mod allocation;
mod panics;
mod control;
mod team;
mod view;
mod settings;
mod report;
mod mesh;
mod image;
mod grid;
mod method;
mod cpu;
#[cfg(feature = "gpu")]
mod gpu;
#[cfg(not(feature = "gpu"))]
#[path = "gpu_absent.rs"]
mod gpu;
mod device;
mod strain;
mod solver;
mod blend;
mod map;
mod asset;
mod refine;
#[cfg(feature = "lab")]
#[allow(clippy::disallowed_macros, clippy::disallowed_methods, reason = "absent from shipped libraries")]
mod lab;
#[cfg(all(feature = "capi", not(feature = "lab")))]
mod ffi;
/// The C API, for tests that call it from Rust.
#[cfg(all(feature = "capi", feature = "lab"))]
#[doc(hidden)]
pub mod ffi;

/// The global allocator of the whole program.
#[cfg(feature = "allocator")]
#[global_allocator]
static ALLOCATOR: allocation::Allocator = allocation::Allocator;

pub use allocation::HostAllocator;
pub use asset::Asset;
pub use asset::results::Results;
pub use asset::solve::{Fetch, SolveRequest};
pub use control::{Control, ProgressFn};
pub use device::{Device, adapters};
pub use error::{Error, ErrorKind, Result};
pub use half::f16;
pub use image::external::{ExternalHandle, ExternalImage};
pub use image::format::PixelFormat;
pub use image::texels::{InputTexel, OutputTexel};
pub use image::{ImageLayout, ImageView, ImageViewMut, Origin};
#[cfg(feature = "lab")]
pub use lab::asset::{CollarOfChart, CollarTriangleInSpace, ReferenceMinimum};
#[cfg(all(feature = "lab", feature = "gpu"))]
pub use lab::parity::StageDifference;
pub use map::FetchKind;
pub use map::certificate::desc::{MapDesc, MapReport};
pub use mesh::{MeshSource, UvSource, Weld, WeldBy};
pub use refine::pattern::RefinementPattern;
pub use refine::{Refinement, RefinementInfo, RefinementSettings};
pub use report::{
    AdapterInfo, AssetInfo, AssetReport, DeviceInfo, GpuKernel, GpuWork, StageTimes, Strain, StrainReport,
    TileEstimate, TileInfo, TileReport,
};
pub use settings::{
    AdapterId, Backend, DeviceSettings, LogFn, LogLevel, MAX_GRID, OpenBorders, Overlap, PbdSettings,
    Quality, Seams, SolveOptions, Solver, TileSettings,
};
pub use team::{Executor, Task};
pub use view::{Scalar, Strided};
