//! A moving picture as a lossless WebP: frames that `image` encodes, in the container of the format's specification.

use std::fs::File;
use std::io::{BufWriter, Seek, SeekFrom, Write};
use std::path::{Path, PathBuf};

use image::ExtendedColorType;
use image::codecs::webp::WebPEncoder;

use super::clip::Film;
use super::encode::opaque;
use super::file::Whole;

/// Most pixels on a side.
const MOST: u32 = 16383;
/// Bytes of a file before its first chunk: RIFF, the size of what follows, WEBP.
const HEADER: usize = 12;

pub struct WebP {
    path: PathBuf,
    size: [u32; 2],
    frames: u64,
    rate: u16,
    file: BufWriter<File>,
    whole: Whole,
}

impl WebP {
    /// # Errors
    /// A file that cannot be written, naming it.
    pub fn new(path: &Path, size: [u32; 2], rate: u16) -> Result<WebP, String> {
        if size.iter().any(|&side| side > MOST) {
            return Err(format!("{}: WebP has at most {MOST} pixels on a side", path.display()));
        }
        let (whole, file) = Whole::create(path)?;
        let mut webp = WebP { path: path.into(), size, frames: 0, rate, file, whole };
        let mut extended = vec![2, 0, 0, 0]; // Animated.
        extended.extend(size.map(|side| three(side - 1)).as_flattened());
        // A background that nobody sees, and endless repetition.
        let start = [b"RIFF\0\0\0\0WEBP".to_vec(), chunk(b"VP8X", &extended), chunk(b"ANIM", &[0; 6])];
        webp.write(&start.concat())?;
        Ok(webp)
    }

    fn write(&mut self, bytes: &[u8]) -> Result<(), String> {
        self.file.write_all(bytes).map_err(|error| format!("{}: {error}", self.path.display()))
    }
}

impl Film for WebP {
    fn add(&mut self, pixels: &[u8]) -> Result<(), String> {
        let [width, height] = self.size;
        let mut picture = Vec::new();
        WebPEncoder::new_lossless(&mut picture)
            .encode(&opaque(pixels), width, height, ExtendedColorType::Rgb8)
            .map_err(|error| format!("{}: {error}", self.path.display()))?;
        // Whole milliseconds that do not drift away.
        let time = |frame: u64| (frame as f64 * 1000.0 / f64::from(self.rate)).round() as u32;
        let lasts = time(self.frames + 1) - time(self.frames);
        // The whole picture, in the place of the one before it.
        let mut frame = vec![0; 6];
        frame.extend([width - 1, height - 1, lasts].map(three).as_flattened());
        frame.push(2);
        frame.extend(&picture[HEADER..]);
        self.frames += 1;
        self.write(&chunk(b"ANMF", &frame))
    }

    fn finish(mut self: Box<Self>) -> Result<(), String> {
        let sized = self.file.stream_position().and_then(|end| {
            self.file.seek(SeekFrom::Start(4))?;
            self.file.write_all(&((end - 8) as u32).to_le_bytes())?;
            self.file.flush()
        });
        sized.map_err(|error| format!("{}: {error}", self.path.display()))?;
        self.whole.finish()
    }
}

fn three(value: u32) -> [u8; 3] {
    let [a, b, c, _] = value.to_le_bytes();
    [a, b, c]
}

/// A chunk; those of odd length are followed by a byte.
fn chunk(name: &[u8; 4], content: &[u8]) -> Vec<u8> {
    let mut bytes = name.to_vec();
    bytes.extend((content.len() as u32).to_le_bytes());
    bytes.extend(content);
    bytes.resize(bytes.len().next_multiple_of(2), 0);
    bytes
}
