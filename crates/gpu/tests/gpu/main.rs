//! GPUs: finding and opening them, their results beside those of the CPU, and drawing through maps.

#![allow(
    clippy::duplicate_mod,
    reason = "`common` and the example `render` bring the built-in scenes along, each for itself"
)]

mod child;
mod counts;
mod cpu_gpu;
mod device;
mod invert;
mod layers;
mod limits;
mod shaders;
mod together;

// What needs a library with the GPU backend, or the crates that come with it.
mod draw;
#[cfg(target_os = "linux")]
mod external;
#[cfg(target_os = "linux")]
mod live;
mod lock_step;
#[cfg(target_os = "linux")]
mod vulkan;

/// The first adapter to draw with, if there is one.
fn open() -> Option<vrtm_render::gpu::Gpu> {
    vrtm_testkit::has_gpu().then(|| vrtm_render::gpu::Gpu::open(0).unwrap())
}
