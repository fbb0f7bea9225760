//! The C API: it guards against panics, checks arguments and delegates to the core. It computes nothing itself.
//!
//! Every exported function runs in `guard::guard`, which catches panics and turns a failure into a status and a message
//! for the calling thread. `handle` looks up handles; `desc` reads and writes structs that may grow. The types and doc
//! comments of these files are the C header (`include/vrtm.h`), so they address a C programmer. Functions must not come
//! from macros, which cbindgen does not expand.

// Allocations sized by user input must be fallible: clippy.toml lists the infallible ones.
#![cfg_attr(not(test), warn(clippy::disallowed_macros, clippy::disallowed_methods, clippy::disallowed_types))]
#![allow(non_camel_case_types)] // The names are those of the C header.
#![allow(clippy::missing_safety_doc)] // The contract of all pointers stands once, at the head of the header.
#![allow(rustdoc::broken_intra_doc_links)] // The comments are C: `indices[k]` there is an array's element.

/// Returns an error of a wrong argument, with this message, unless the condition holds.
macro_rules! ensure {
    ($condition:expr, $($message:tt)+) => {
        if !$condition {
            return Err($crate::status::Failure::argument(format!($($message)+)));
        }
    };
}

// Ordered from the bottom up: a module imports only modules above it in this list. `tests/house/arrows.rs` checks this.
pub mod status;
mod desc;
mod hook;
mod guard;
pub mod allocator;
mod shared;
pub mod handle;
mod strips;
pub mod mirror;
pub mod types;
pub mod adapter;
pub mod mesh;
pub mod asset;
pub mod executor;
pub mod device;
pub mod dilation;
pub mod fetch;
pub mod external;
pub mod solve;
pub mod job;
pub mod map;
pub mod prepare;
pub mod refine;
pub mod carrier;
pub mod report;
pub mod tile;
pub mod defaults;

/// The global allocator of the whole program, through which memory comes from a host's allocator, and which keeps a
/// process alive whose memory is short.
#[global_allocator]
static ALLOCATOR: vrtm_core::allocation::Allocator = vrtm_core::allocation::Allocator;

/// The structs that mirror those of the Rust API, for the header.
pub const MIRRORED: &[mirror::Struct] = &[
    adapter::vrtm_adapter_info::MIRROR,
    asset::vrtm_asset_info::MIRROR,
    carrier::vrtm_carrier_info::MIRROR,
    device::vrtm_device_info::MIRROR,
    solve::vrtm_pbd_settings::MIRROR,
    solve::vrtm_solve_options::MIRROR,
    map::vrtm_map_info::MIRROR,
    prepare::vrtm_tile_estimate::MIRROR,
    refine::vrtm_refinement_desc::MIRROR,
    refine::vrtm_refinement_info::MIRROR,
    report::vrtm_strain::MIRROR,
    report::vrtm_worst_feature::MIRROR,
    report::vrtm_tile_report::MIRROR,
    report::vrtm_asset_report::MIRROR,
    tile::vrtm_tile_info::MIRROR,
    tile::vrtm_tile_settings::MIRROR,
];

/// Their constants.
pub const CHOICES: &[mirror::Choice] = &[
    types::SCALARS,
    types::PIXEL_FORMATS,
    types::ORIGINS,
    device::BACKENDS,
    device::LOG_LEVELS,
    device::LOG_CODES,
    solve::QUALITIES,
    solve::SCALES,
    solve::SOLVERS,
    tile::OVERLAPS,
    tile::SEAMS,
    tile::OPEN_BORDERS,
    carrier::FITS,
    carrier::STATES,
];
