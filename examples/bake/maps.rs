//! Single-channel maps: read from image files, passed to vrtm unchanged, sampled by the sheet.

use exr::prelude::f16;
use vrtm::{ImageLayout, ImageView, PixelFormat};

use crate::failure::{Failure, Result};

#[derive(Clone, Debug)]
pub struct Map {
    pub width: u32,
    pub height: u32,
    pub format: PixelFormat,
    /// Packed texels, first row at the top of the tile.
    pub bytes: Vec<u8>,
    /// The file's name, for messages.
    pub origin: String,
}

impl Map {
    pub fn from_bytes(width: u32, height: u32, bytes: Vec<u8>, origin: &str) -> Map {
        Map { width, height, format: PixelFormat::U8, bytes, origin: origin.into() }
    }

    /// A view of the map for vrtm.
    pub fn view(&self) -> Result<ImageView<'_>> {
        let layout = ImageLayout::packed(self.width, self.height, self.format);
        ImageView::new("map", &self.bytes, layout).map_err(|e| Failure::named(&self.origin, e))
    }

    /// Values between 0 and 1, first row at the top.
    pub fn values(&self) -> Vec<f32> {
        let pairs = || self.bytes.chunks_exact(2).map(|b| [b[0], b[1]]);
        let values: Vec<f32> = match self.format {
            PixelFormat::U8 => self.bytes.iter().map(|&b| f32::from(b) / 255.0).collect(),
            PixelFormat::U16 => pairs().map(|b| f32::from(u16::from_ne_bytes(b)) / 65535.0).collect(),
            PixelFormat::F16 => pairs().map(|b| f16::from_ne_bytes(b).to_f32()).collect(),
            _ => self.bytes.chunks_exact(4).map(|b| f32::from_ne_bytes([b[0], b[1], b[2], b[3]])).collect(),
        };
        values.into_iter().map(|value| value.clamp(0.0, 1.0)).collect()
    }
}

/// N channels per texel, first row at the top of the tile.
#[derive(Clone, Debug)]
pub struct Field<const N: usize> {
    pub width: usize,
    pub height: usize,
    pub data: Vec<[f32; N]>,
}

impl<const N: usize> Field<N> {
    pub fn at(&self, x: usize, y: usize) -> [f32; N] {
        self.data[y * self.width + x]
    }

    /// Bilinear between texel centres, clamped at the edges.
    pub fn sample(&self, uv: [f32; 2]) -> [f32; N] {
        let (x0, x1, fx) = taps(uv[0] * self.width as f32 - 0.5, self.width);
        let (y0, y1, fy) = taps((1.0 - uv[1]) * self.height as f32 - 0.5, self.height);
        let (a, b, c, d) = (self.at(x0, y0), self.at(x1, y0), self.at(x0, y1), self.at(x1, y1));
        std::array::from_fn(|k| {
            let top = a[k] + (b[k] - a[k]) * fx;
            let bottom = c[k] + (d[k] - c[k]) * fx;
            top + (bottom - top) * fy
        })
    }
}

/// The two neighbours of a coordinate in texels, and the weight of the second.
fn taps(x: f32, size: usize) -> (usize, usize, f32) {
    let x = x.clamp(0.0, (size - 1) as f32);
    let low = x as usize;
    (low, (low + 1).min(size - 1), x - low as f32)
}
