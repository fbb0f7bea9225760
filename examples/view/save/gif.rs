//! A moving picture as a GIF.

use std::fs::File;
use std::io::{BufWriter, Write};
use std::path::Path;
use std::sync::{Arc, Mutex, PoisonError};

use image::codecs::gif::{GifEncoder, Repeat};
use image::{Delay, Frame, RgbaImage};
use vrtm_examples::whole::Whole;

use super::clip::{Film, Result};

/// Speed of the choice of colours, 1 (best) to 30.
const SPEED: i32 = 10;

pub struct Gif {
    size: [u32; 2],
    rate: u16,
    encoder: GifEncoder<Shared>,
    file: Shared,
    whole: Whole,
}

/// The encoder writes its end only when it is dropped, and would not tell that this fails.
#[derive(Clone)]
struct Shared(Arc<Mutex<BufWriter<File>>>);

impl Write for Shared {
    fn write(&mut self, bytes: &[u8]) -> std::io::Result<usize> {
        self.0.lock().unwrap_or_else(PoisonError::into_inner).write(bytes)
    }

    fn flush(&mut self) -> std::io::Result<()> {
        self.0.lock().unwrap_or_else(PoisonError::into_inner).flush()
    }
}

impl Gif {
    pub fn new(path: &Path, size: [u32; 2], rate: u16) -> Result<Gif> {
        let (whole, file) = Whole::create(path)?;
        let file = Shared(Arc::new(Mutex::new(file)));
        let mut encoder = GifEncoder::new_with_speed(file.clone(), SPEED);
        encoder.set_repeat(Repeat::Infinite)?;
        Ok(Gif { size, rate, encoder, file, whole })
    }
}

impl Film for Gif {
    fn add(&mut self, pixels: &[u8]) -> Result<()> {
        let [width, height] = self.size;
        let opaque = pixels.chunks_exact(4).flat_map(|p| [p[0], p[1], p[2], 255]).collect();
        let image = RgbaImage::from_raw(width, height, opaque).ok_or("a frame of another size")?;
        let delay = Delay::from_numer_denom_ms(1000, self.rate.into());
        Ok(self.encoder.encode_frame(Frame::from_parts(image, 0, 0, delay))?)
    }

    fn finish(self: Box<Self>) -> Result<()> {
        let Gif { encoder, mut file, whole, .. } = *self;
        drop(encoder);
        file.flush()?;
        Ok(whole.finish()?)
    }
}
