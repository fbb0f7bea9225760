//! Saves the timeline as a moving picture, frame by frame as they are solved.

use std::path::{Path, PathBuf};

use super::{apng, gif, mp4, sequence, webp};

/// Format of a clip.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Format {
    #[default]
    WebP,
    Gif,
    Apng,
    /// A PNG per frame.
    Sequence,
    Mp4,
}

impl Format {
    pub const ALL: [Format; 5] = [Format::WebP, Format::Gif, Format::Apng, Format::Sequence, Format::Mp4];

    pub fn name(self) -> &'static str {
        match self {
            Format::WebP => "WebP",
            Format::Gif => "GIF",
            Format::Apng => "animated PNG",
            Format::Sequence => "PNG sequence",
            Format::Mp4 => "MP4",
        }
    }

    pub fn about(self) -> &'static str {
        match self {
            Format::WebP => "Every pixel as it is; browsers and chats play it",
            Format::Gif => "256 colours a frame; whatever shows pictures plays it",
            Format::Apng => "Every pixel as it is; browsers play it",
            Format::Sequence => "A file per frame, with the frame's number, for a program that cuts films",
            Format::Mp4 => "For films, by the program ffmpeg",
        }
    }

    /// The reason that it cannot be written here.
    pub fn missing(self) -> Option<&'static str> {
        let missing = self == Format::Mp4 && mp4::program().is_none();
        missing.then_some("there is no program ffmpeg in the PATH, which writes MP4")
    }

    /// The files of a clip: one, or for each frame, which have these numbers.
    pub fn paths(self, folder: &Path, name: &str, numbers: impl Iterator<Item = i64>) -> Vec<PathBuf> {
        let one = |ending: &str| vec![folder.join(format!("{name}_clip.{ending}"))];
        match self {
            Format::WebP => one("webp"),
            Format::Gif => one("gif"),
            Format::Apng => one("png"),
            Format::Mp4 => one("mp4"),
            Format::Sequence => numbers.map(|n| folder.join(format!("{name}_clip.{n:04}.png"))).collect(),
        }
    }
}

/// A file, or files, that a clip's frames go to.
pub trait Film {
    /// Adds a frame of 4 bytes per pixel.
    ///
    /// # Errors
    /// What the system says, naming the file.
    fn add(&mut self, pixels: &[u8]) -> Result<(), String>;

    /// Gives the files their names.
    ///
    /// # Errors
    /// What the system says, naming the file.
    fn finish(self: Box<Self>) -> Result<(), String>;
}

/// A clip that is being written. Dropped before it is complete, it leaves nothing.
pub struct Clip {
    paths: Vec<PathBuf>,
    /// The frame that is written next, from 1, and the last one.
    pub next: usize,
    pub last: usize,
    /// Sizes of the pictures.
    pub size: [u32; 2],
    film: Box<dyn Film>,
}

impl Clip {
    /// `paths` are those of the format; of a timeline its last frame and its frames per second.
    ///
    /// # Errors
    /// A file that cannot be written, naming it, or a program that is missing.
    pub fn new(
        format: Format,
        paths: Vec<PathBuf>,
        size: [u32; 2],
        (last, rate): (usize, u16),
    ) -> Result<Clip, String> {
        let path = paths.first().ok_or("a clip without frames")?;
        let film: Box<dyn Film> = match format {
            Format::WebP => Box::new(webp::WebP::new(path, size, rate)?),
            Format::Gif => Box::new(gif::Gif::new(path, size, rate)?),
            Format::Apng => Box::new(apng::Apng::new(path, size, last, rate)?),
            Format::Sequence => Box::new(sequence::Sequence::new(paths.clone(), size)),
            Format::Mp4 => {
                let missing = || "there is no program ffmpeg in the PATH, which writes MP4".to_string();
                Box::new(mp4::Mp4::new(&mp4::program().ok_or_else(missing)?, path, size, rate)?)
            }
        };
        Ok(Clip { paths, next: 1, last, size, film })
    }

    /// Adds a frame of 4 bytes per pixel.
    ///
    /// # Errors
    /// What the system says, naming the file.
    pub fn add(&mut self, pixels: &[u8]) -> Result<(), String> {
        self.film.add(pixels)?;
        self.next += 1;
        Ok(())
    }

    pub fn is_complete(&self) -> bool {
        self.next > self.last
    }

    /// Gives the files their names, and returns these.
    ///
    /// # Errors
    /// What the system says, naming the file.
    pub fn finish(self) -> Result<Vec<PathBuf>, String> {
        self.film.finish()?;
        Ok(self.paths)
    }
}

#[cfg(test)]
mod tests {
    use std::fs::{self, File};
    use std::io::BufReader;

    use image::AnimationDecoder;
    use image::codecs::gif::GifDecoder;
    use image::codecs::webp::WebPDecoder;

    use super::*;

    /// Writes three frames of one grey each.
    fn written(format: Format, name: &str) -> (PathBuf, Vec<PathBuf>) {
        let folder = std::env::temp_dir().join(format!("vrtm-view-clip-{name}-{}", std::process::id()));
        fs::create_dir_all(&folder).expect("a folder");
        let paths = format.paths(&folder, "a", 99..102);
        let mut clip = Clip::new(format, paths.clone(), [5, 3], (3, 24)).expect("created");
        for value in [10, 20, 30] {
            assert!(!clip.is_complete() && paths.iter().all(|path| !path.exists()));
            clip.add(&[value; 60]).expect("added");
        }
        assert!(clip.is_complete());
        assert_eq!(clip.finish().expect("finished"), paths);
        // One that is given up leaves nothing.
        let other = format.paths(&folder, "b", 99..102);
        let mut clip = Clip::new(format, other.clone(), [5, 3], (3, 24)).expect("created");
        clip.add(&[1; 60]).expect("added");
        drop(clip);
        assert_eq!(fs::read_dir(&folder).expect("read").count(), paths.len());
        (folder, paths)
    }

    fn greys<'a>(decoder: impl AnimationDecoder<'a>) -> Vec<(u8, u32)> {
        let frames = decoder.into_frames().collect_frames().expect("frames");
        let one = |frame: image::Frame| {
            assert_eq!(frame.buffer().dimensions(), (5, 3));
            (frame.buffer().get_pixel(4, 2).0[1], frame.delay().numer_denom_ms().0)
        };
        frames.into_iter().map(one).collect()
    }

    #[test]
    fn an_animated_png_holds_all_frames_in_turn() {
        let (folder, paths) = written(Format::Apng, "apng");
        let file = BufReader::new(File::open(&paths[0]).expect("there"));
        let mut reader = png::Decoder::new(file).read_info().expect("a PNG");
        assert_eq!(reader.info().animation_control().map(|control| control.num_frames), Some(3));
        for value in [10, 20, 30] {
            let mut pixels = vec![0; 45];
            reader.next_frame(&mut pixels).expect("a frame");
            assert_eq!(pixels, [value; 45]);
        }
        fs::remove_dir_all(&folder).expect("removed");
    }

    #[test]
    fn a_webp_holds_all_frames_in_turn() {
        let (folder, paths) = written(Format::WebP, "webp");
        let file = BufReader::new(File::open(&paths[0]).expect("there"));
        let decoder = WebPDecoder::new(file).expect("a WebP");
        assert!(decoder.has_animation());
        assert_eq!(greys(decoder), [(10, 42), (20, 41), (30, 42)]);
        fs::remove_dir_all(&folder).expect("removed");
    }

    #[test]
    fn a_gif_holds_all_frames_in_turn() {
        let (folder, paths) = written(Format::Gif, "gif");
        let file = BufReader::new(File::open(&paths[0]).expect("there"));
        assert_eq!(greys(GifDecoder::new(file).expect("a GIF")), [(10, 40), (20, 40), (30, 40)]);
        fs::remove_dir_all(&folder).expect("removed");
    }

    #[test]
    fn a_sequence_has_the_numbers_of_its_frames() {
        let (folder, paths) = written(Format::Sequence, "sequence");
        let names: Vec<_> = paths.iter().filter_map(|p| p.file_name()?.to_str()).collect();
        assert_eq!(names, ["a_clip.0099.png", "a_clip.0100.png", "a_clip.0101.png"]);
        for (path, value) in paths.iter().zip([10, 20, 30]) {
            assert_eq!(image::open(path).expect("a PNG").into_rgb8().into_raw(), [value; 45]);
        }
        fs::remove_dir_all(&folder).expect("removed");
    }
}
