//! A moving picture as a PNG with several frames.

use std::fs::File;
use std::io::BufWriter;
use std::path::Path;

use vrtm_examples::whole::Whole;

use super::clip::{Film, Result};
use super::encode::opaque;

pub struct Apng {
    writer: png::Writer<BufWriter<File>>,
    whole: Whole,
}

impl Apng {
    pub fn new(path: &Path, size: [u32; 2], last: usize, rate: u16) -> Result<Apng> {
        let (whole, file) = Whole::create(path)?;
        let mut encoder = png::Encoder::new(file, size[0], size[1]);
        encoder.set_color(png::ColorType::Rgb);
        encoder.set_depth(png::BitDepth::Eight);
        encoder.set_animated(last as u32, 0)?;
        encoder.set_frame_delay(1, rate)?;
        Ok(Apng { writer: encoder.write_header()?, whole })
    }
}

impl Film for Apng {
    fn add(&mut self, pixels: &[u8]) -> Result<()> {
        Ok(self.writer.write_image_data(&opaque(pixels))?)
    }

    fn finish(self: Box<Self>) -> Result<()> {
        self.writer.finish()?;
        Ok(self.whole.finish()?)
    }
}
