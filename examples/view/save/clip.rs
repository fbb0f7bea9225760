//! Saves the timeline as an animated PNG, frame by frame as they are solved.

use std::fs::File;
use std::io::BufWriter;
use std::path::{Path, PathBuf};

use png::EncodingError;
use vrtm_examples::whole::Whole;

use super::encode::opaque;

/// A clip that is being written. Dropped before it is complete, it leaves nothing.
pub struct Clip {
    path: PathBuf,
    /// The frame that is written next, from 1, and the last one.
    pub next: usize,
    pub last: usize,
    /// Size of the pictures.
    pub size: [u32; 2],
    writer: png::Writer<BufWriter<File>>,
    whole: Whole,
}

impl Clip {
    /// Of a timeline its last frame and its frames per second.
    ///
    /// # Errors
    /// A file that cannot be written, naming it.
    pub fn new(path: PathBuf, size: [u32; 2], (last, rate): (usize, u16)) -> Result<Clip, String> {
        let begin = || {
            let (whole, file) = Whole::create(&path)?;
            let mut encoder = png::Encoder::new(file, size[0], size[1]);
            encoder.set_color(png::ColorType::Rgb);
            encoder.set_depth(png::BitDepth::Eight);
            encoder.set_animated(last as u32, 0)?;
            encoder.set_frame_delay(1, rate)?;
            Ok((whole, encoder.write_header()?))
        };
        let (whole, writer) = begin().map_err(|error| named(&path, &error))?;
        Ok(Clip { path, next: 1, last, size, writer, whole })
    }

    /// Adds a frame of 4 bytes per pixel.
    ///
    /// # Errors
    /// What the system says, naming the file.
    pub fn add(&mut self, pixels: &[u8]) -> Result<(), String> {
        self.writer.write_image_data(&opaque(pixels)).map_err(|error| named(&self.path, &error))?;
        self.next += 1;
        Ok(())
    }

    pub fn is_complete(&self) -> bool {
        self.next > self.last
    }

    /// Gives the file its name, and returns that.
    ///
    /// # Errors
    /// What the system says, naming the file.
    pub fn finish(self) -> Result<PathBuf, String> {
        let written = self.writer.finish().and_then(|()| Ok(self.whole.finish()?));
        written.map(|()| self.path.clone()).map_err(|error| named(&self.path, &error))
    }
}

fn named(path: &Path, error: &EncodingError) -> String {
    format!("{}: {error}", path.display())
}

#[cfg(test)]
mod tests {
    use std::fs;
    use std::io::BufReader;

    use image::AnimationDecoder;
    use image::codecs::png::PngDecoder;

    use super::*;

    #[test]
    fn an_animated_png_holds_all_frames_in_turn() {
        let folder = std::env::temp_dir().join(format!("vrtm-view-clip-{}", std::process::id()));
        fs::create_dir_all(&folder).expect("a folder");
        // Three frames of one grey each.
        let path = folder.join("a.png");
        let mut clip = Clip::new(path.clone(), [5, 3], (3, 24)).expect("created");
        for value in [10, 20, 30] {
            assert!(!clip.is_complete() && !path.exists());
            clip.add(&[value; 60]).expect("added");
        }
        assert!(clip.is_complete());
        assert_eq!(clip.finish().expect("finished"), path);
        let file = BufReader::new(File::open(&path).expect("there"));
        let decoder = PngDecoder::new(file).and_then(|decoder| decoder.apng()).expect("an animated PNG");
        let frames = decoder.into_frames().collect_frames().expect("frames");
        assert!(frames.iter().all(|frame| frame.buffer().dimensions() == (5, 3)));
        let greys: Vec<u8> = frames.iter().map(|frame| frame.buffer().get_pixel(4, 2).0[1]).collect();
        assert_eq!(greys, [10, 20, 30]);
        // One that is given up leaves nothing.
        let mut clip = Clip::new(folder.join("b.png"), [5, 3], (3, 24)).expect("created");
        clip.add(&[1; 60]).expect("added");
        drop(clip);
        assert_eq!(fs::read_dir(&folder).expect("read").count(), 1);
        fs::remove_dir_all(&folder).expect("removed");
    }
}
