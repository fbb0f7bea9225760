//! Saves the timeline as a moving picture (APNG), frame by frame as they are solved.

use std::fs::File;
use std::io::BufWriter;
use std::path::{Path, PathBuf};

use super::encode::opaque;
use super::file::Whole;
use crate::timeline::RATE;

/// A clip that is being written.
pub struct Clip {
    pub path: PathBuf,
    /// The frame that is written next, from 1, and the last one.
    pub next: usize,
    pub last: usize,
    /// Sizes of the pictures.
    pub size: [u32; 2],
    writer: png::Writer<BufWriter<File>>,
    whole: Whole,
}

impl Clip {
    /// # Errors
    /// A file that cannot be written, naming it.
    pub fn new(path: &Path, size: [u32; 2], last: usize) -> Result<Clip, String> {
        let (whole, file) = Whole::create(path)?;
        let failed = |error: png::EncodingError| format!("{}: {error}", path.display());
        let mut encoder = png::Encoder::new(file, size[0], size[1]);
        encoder.set_color(png::ColorType::Rgb);
        encoder.set_depth(png::BitDepth::Eight);
        encoder.set_animated(last as u32, 0).map_err(failed)?;
        encoder.set_frame_delay(1, RATE as u16).map_err(failed)?;
        let writer = encoder.write_header().map_err(failed)?;
        Ok(Clip { path: path.into(), next: 1, last, size, writer, whole })
    }

    /// Adds a frame of 4 bytes per pixel.
    ///
    /// # Errors
    /// What the system says, naming the file.
    pub fn add(&mut self, pixels: &[u8]) -> Result<(), String> {
        let written = self.writer.write_image_data(&opaque(pixels));
        written.map_err(|error| format!("{}: {error}", self.path.display()))?;
        self.next += 1;
        Ok(())
    }

    pub fn is_complete(&self) -> bool {
        self.next > self.last
    }

    /// Gives the file its name.
    ///
    /// # Errors
    /// What the system says, naming the file.
    pub fn finish(self) -> Result<PathBuf, String> {
        self.writer.finish().map_err(|error| format!("{}: {error}", self.path.display()))?;
        self.whole.finish()?;
        Ok(self.path)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_clip_holds_all_frames_in_turn() {
        let path = std::env::temp_dir().join(format!("vrtm-view-clip-{}.png", std::process::id()));
        let mut clip = Clip::new(&path, [4, 2], 3).expect("created");
        for value in [10, 20, 30] {
            assert!(!clip.is_complete() && !path.exists());
            clip.add(&[value; 32]).expect("added");
        }
        assert!(clip.is_complete());
        clip.finish().expect("finished");
        let file = std::io::BufReader::new(File::open(&path).expect("there"));
        let mut reader = png::Decoder::new(file).read_info().expect("a PNG");
        assert_eq!(reader.info().animation_control().map(|control| control.num_frames), Some(3));
        for value in [10, 20, 30] {
            let mut pixels = vec![0; 24];
            reader.next_frame(&mut pixels).expect("a frame");
            assert_eq!(pixels, [value; 24]);
        }
        std::fs::remove_file(&path).expect("removed");
    }
}
