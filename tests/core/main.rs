//! What no result shows of vrtm's numerical core: teams of threads, memory, and the parts of grids, maps and meshes one
//! by one. The folders are those of `crates/core/src`.

mod allocation;
mod control;
#[cfg(all(target_arch = "x86_64", not(miri)))]
mod float_mode;
mod grid;
mod image;
mod local;
mod mesh;
mod method;
mod strain;
mod team;

/// The library's own allocator, as in the C library.
#[global_allocator]
static ALLOCATOR: vrtm_core::allocation::Allocator = vrtm_core::allocation::Allocator;
