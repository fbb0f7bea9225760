//! A moving picture as a PNG with several frames.

use std::fs::File;
use std::io::BufWriter;
use std::path::{Path, PathBuf};

use super::clip::Film;
use super::encode::opaque;
use super::file::Whole;

pub struct Apng {
    path: PathBuf,
    writer: png::Writer<BufWriter<File>>,
    whole: Whole,
}

impl Apng {
    /// # Errors
    /// A file that cannot be written, naming it.
    pub fn new(path: &Path, size: [u32; 2], last: usize, rate: u16) -> Result<Apng, String> {
        let (whole, file) = Whole::create(path)?;
        let failed = |error: png::EncodingError| format!("{}: {error}", path.display());
        let mut encoder = png::Encoder::new(file, size[0], size[1]);
        encoder.set_color(png::ColorType::Rgb);
        encoder.set_depth(png::BitDepth::Eight);
        encoder.set_animated(last as u32, 0).map_err(failed)?;
        encoder.set_frame_delay(1, rate).map_err(failed)?;
        let writer = encoder.write_header().map_err(failed)?;
        Ok(Apng { path: path.into(), writer, whole })
    }
}

impl Film for Apng {
    fn add(&mut self, pixels: &[u8]) -> Result<(), String> {
        let written = self.writer.write_image_data(&opaque(pixels));
        written.map_err(|error| format!("{}: {error}", self.path.display()))
    }

    fn finish(self: Box<Self>) -> Result<(), String> {
        self.writer.finish().map_err(|error| format!("{}: {error}", self.path.display()))?;
        self.whole.finish()
    }
}
