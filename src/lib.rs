//! vrtm keeps painted features rigid while the surface under them deforms.
//!
//! The data flows through the modules in the order in which they stand here:
//! a host's arrays ([`view`], [`image`]) become a validated mesh with tiles and charts (`mesh`), each tile's maps
//! become a grid with movable nodes and active blocks (`tile`), `solve` runs the schedule over a backend's
//! stages (`cpu`), and [`Asset`] hands out the redirection map, the warp, corner UVs and reports. Beside that way stand
//! `exact`, `measure` and `reference`: the f64 side that results are measured with.

pub mod view;
pub mod image;
mod half;
mod mesh;
mod tile;
mod solve;
mod cpu;
mod exact;
mod measure;
mod reference;
mod asset;
mod device;
mod settings;
mod report;
mod error;
#[doc(hidden)]
pub mod ffi;

pub use asset::{Asset, Fetch, FetchKind, ReferenceMinimum};
pub use device::{Device, adapters};
pub use error::{Error, ErrorKind, Result};
pub use image::{ImageLayout, ImageView, ImageViewMut, Origin, PixelFormat};
pub use mesh::{MeshSource, UvSource};
pub use report::{
    AdapterInfo, AssetInfo, AssetReport, DeviceInfo, StageTimes, Strain, StrainReport, TileInfo, TileReport,
};
pub use settings::{
    Backend, DeviceSettings, LogFn, LogLevel, MAX_GRID, Overlap, Quality, SolveOptions, TileSettings,
};
pub use view::{Scalar, Strided};
