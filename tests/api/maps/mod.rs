//! What renderers read: forms of the redirection, further channels, derivatives, and what is said of maps that are
//! interpolated. Everything is checked by code that shares nothing with the library but the nodes of the warp.

mod dilation;
mod inspected;
mod kinds;

use vrtm::{Asset, Device, FetchKind, ImageLayout, Origin, PixelFormat, SolveOptions};
use vrtm_testkit::{Model, raw};

/// A solved asset with a grid of 256 x 256 cells.
fn solved(model: &Model, device: &Device) -> Asset {
    model.solved(device, 256, model.frames.len(), &SolveOptions::default())
}

/// Fetches a packed map of a tile of f32, first row at v = 0; what the library does not write is NaN.
fn map(asset: &Asset, tile: usize, kind: FetchKind, size: [u32; 2], channels: u32) -> Vec<f32> {
    let texels = (size[0] * size[1] * channels) as usize;
    let layout = ImageLayout::packed(size[0], size[1], PixelFormat::F32).with_channels(channels);
    let layout = ImageLayout { origin: Origin::Bottom, ..layout };
    let bytes = raw(asset, tile, kind, layout, 4 * texels, 0xff);
    bytes.chunks_exact(4).map(|b| f32::from_ne_bytes([b[0], b[1], b[2], b[3]])).collect()
}

/// Pairs of channels.
fn pairs(map: &[f32]) -> Vec<[f64; 2]> {
    map.chunks_exact(2).map(|uv| [f64::from(uv[0]), f64::from(uv[1])]).collect()
}

/// The number of quads of a map, within the tile, on which its bilinear interpolation turns over somewhere: it does if
/// it does so at a corner.
fn folds(map: &[[f64; 2]], [width, height]: [usize; 2]) -> usize {
    let mut count = 0;
    for y in 1..height {
        for x in 1..width {
            let at = |i: usize, j: usize| map[(y - 1 + j) * width + x - 1 + i];
            // Derivatives by both parameters of the quad at its four corners.
            let turned = [(0, 0), (1, 0), (0, 1), (1, 1)].into_iter().any(|(i, j)| {
                let along = |k: usize| at(1, j)[k] - at(0, j)[k];
                let up = |k: usize| at(i, 1)[k] - at(i, 0)[k];
                along(0) * up(1) <= along(1) * up(0)
            });
            count += usize::from(turned);
        }
    }
    count
}
