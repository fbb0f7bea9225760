//! Maps of one channel in memory.

use std::io::Cursor;
use std::path::Path;

use image::{DynamicImage, ImageDecoder as _, ImageReader};
use vrtm::{ImageLayout, ImageView, MAX_GRID, PixelFormat};

use crate::failure::{Failure, Result, read};

/// A map of one channel, in the form that vrtm reads.
#[derive(Clone, Debug)]
pub struct Map {
    pub size: [u32; 2],
    pub format: PixelFormat,
    /// Packed texels, first row at the top of the tile.
    pub bytes: Vec<u8>,
    /// The file's name, for messages.
    pub origin: String,
}

impl Map {
    /// Reads a map of 8 or 16 bits; colours are reduced to their luminance.
    pub fn load(path: &Path) -> Result<Map> {
        let failure = |e: image::ImageError| Failure::file(path, e);
        let bytes = read(path)?;
        let mut reader = ImageReader::new(Cursor::new(&bytes)).with_guessed_format().expect("memory");
        // Below, before memory is taken for the texels.
        reader.no_limits();
        let decoder = reader.into_decoder().map_err(failure)?;
        let size @ [width, height] = decoder.dimensions().into();
        if u64::from(width) * u64::from(height) > u64::from(MAX_GRID).pow(2) {
            let reason =
                format!("{width} x {height} texels are more than {MAX_GRID} x {MAX_GRID}, the largest grid");
            return Err(Failure::file(path, reason));
        }
        let image = DynamicImage::from_decoder(decoder).map_err(failure)?;
        let (format, bytes) = if image.color().bytes_per_pixel() > image.color().channel_count() {
            let texels = image.into_luma16().into_raw();
            (PixelFormat::U16, texels.into_iter().flat_map(u16::to_ne_bytes).collect())
        } else {
            (PixelFormat::U8, image.into_luma8().into_raw())
        };
        Ok(Map { size, format, bytes, origin: path.display().to_string() })
    }

    /// A view of the map for vrtm.
    pub fn view(&self) -> Result<ImageView<'_>> {
        let layout = ImageLayout::packed(self.size[0], self.size[1], self.format);
        ImageView::new("map", &self.bytes, layout).map_err(|e| Failure::named(&self.origin, e))
    }

    /// Values between 0 and 1.
    pub fn values(&self) -> Vec<f32> {
        match self.format {
            PixelFormat::U8 => self.bytes.iter().map(|&b| f32::from(b) / 255.0).collect(),
            _ => self
                .bytes
                .chunks_exact(2)
                .map(|b| f32::from(u16::from_ne_bytes([b[0], b[1]])) / 65535.0)
                .collect(),
        }
    }
}
