//! Draws a mesh through its redirection map with wgpu, into images: for this program, its bench and its test. The shaders beside this file are meant to be copied.

#![allow(missing_docs, reason = "for vrtm's own programs alone")]

pub mod camera;
pub mod difference;
pub mod draw;
pub mod gpu;
#[cfg(target_os = "linux")]
pub mod live;
pub mod maps;
pub mod mips;
pub mod model;
pub mod pipelines;
pub mod reference;
#[cfg(target_os = "linux")]
pub mod shared;
pub mod stage;
pub mod surface;
pub mod texture;
pub mod ways;

/// A result whose error states why something cannot be done, naming the argument.
pub type Result<T> = std::result::Result<T, String>;

/// Fills the rows of an image on all cores: `row` gets each row's index and texels.
pub fn fill_rows<T: Send>(texels: &mut [T], width: usize, row: impl Fn(usize, &mut [T]) + Sync) {
    let cores = std::thread::available_parallelism().map_or(1, |n| n.get());
    let rows = (texels.len() / width).div_ceil(cores).max(1);
    std::thread::scope(|scope| {
        for (band, texels) in texels.chunks_mut(rows * width).enumerate() {
            let row = &row;
            scope.spawn(move || {
                for (k, texels) in texels.chunks_mut(width).enumerate() {
                    row(band * rows + k, texels);
                }
            });
        }
    });
}
