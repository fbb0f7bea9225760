//! Saves the timeline as a moving picture, frame by frame as they are solved.

use std::path::{Path, PathBuf};

use super::{apng, gif, mp4, sequence};

/// Format of a clip.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Format {
    #[default]
    Apng,
    Gif,
    /// A PNG per frame.
    Sequence,
    Mp4,
}

impl Format {
    pub const ALL: [Format; 4] = [Format::Apng, Format::Gif, Format::Sequence, Format::Mp4];

    pub fn name(self) -> &'static str {
        match self {
            Format::Gif => "GIF",
            Format::Apng => "animated PNG",
            Format::Sequence => "PNG sequence",
            Format::Mp4 => "MP4",
        }
    }

    pub fn about(self) -> &'static str {
        match self {
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
            Format::Gif => one("gif"),
            Format::Apng => one("png"),
            Format::Mp4 => one("mp4"),
            Format::Sequence => numbers.map(|n| folder.join(format!("{name}_clip.{n:04}.png"))).collect(),
        }
    }
}

/// A result whose error does not name the file.
pub type Result<T> = std::result::Result<T, Box<dyn std::error::Error>>;

/// A file, or files, that a clip's frames go to.
pub trait Film {
    /// Adds a frame of 4 bytes per pixel.
    fn add(&mut self, pixels: &[u8]) -> Result<()>;

    /// Gives the files their names.
    fn finish(self: Box<Self>) -> Result<()>;
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
    ) -> std::result::Result<Clip, String> {
        let path = paths.first().ok_or("a clip without frames")?;
        let film = Clip::film(format, &paths, size, (last, rate)).map_err(|error| named(path, &*error))?;
        Ok(Clip { paths, next: 1, last, size, film })
    }

    fn film(
        format: Format,
        paths: &[PathBuf],
        size: [u32; 2],
        (last, rate): (usize, u16),
    ) -> Result<Box<dyn Film>> {
        let path = &paths[0];
        let film: Box<dyn Film> = match format {
            Format::Gif => Box::new(gif::Gif::new(path, size, rate)?),
            Format::Apng => Box::new(apng::Apng::new(path, size, last, rate)?),
            Format::Sequence => Box::new(sequence::Sequence::new(paths.to_vec(), size)),
            Format::Mp4 => {
                let program =
                    mp4::program().ok_or("there is no program ffmpeg in the PATH, which writes MP4")?;
                Box::new(mp4::Mp4::new(&program, path, size, rate)?)
            }
        };
        Ok(film)
    }

    /// Adds a frame of 4 bytes per pixel.
    ///
    /// # Errors
    /// What the system says, naming the file.
    pub fn add(&mut self, pixels: &[u8]) -> std::result::Result<(), String> {
        let path = self.paths.get(self.next - 1).unwrap_or(&self.paths[0]);
        self.film.add(pixels).map_err(|error| named(path, &*error))?;
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
    pub fn finish(self) -> std::result::Result<Vec<PathBuf>, String> {
        self.film.finish().map_err(|error| named(&self.paths[0], &*error))?;
        Ok(self.paths)
    }
}

fn named(path: &Path, error: &dyn std::error::Error) -> String {
    format!("{}: {error}", path.display())
}

#[cfg(test)]
mod tests {
    use std::fs::{self, File};
    use std::io::BufReader;

    use image::AnimationDecoder;
    use image::codecs::gif::GifDecoder;
    use image::codecs::png::PngDecoder;

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
        let decoder = PngDecoder::new(file).and_then(|decoder| decoder.apng()).expect("an animated PNG");
        assert_eq!(greys(decoder).iter().map(|(grey, _)| *grey).collect::<Vec<_>>(), [10, 20, 30]);
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
