//! A moving picture as a PNG per frame.

use std::io::Write;
use std::path::PathBuf;

use super::clip::Film;
use super::encode;
use super::file::Whole;

pub struct Sequence {
    size: [u32; 2],
    /// Frames to come, the next one last.
    paths: Vec<PathBuf>,
    done: Vec<Whole>,
}

impl Sequence {
    pub fn new(mut paths: Vec<PathBuf>, size: [u32; 2]) -> Sequence {
        paths.reverse();
        Sequence { size, paths, done: Vec::new() }
    }
}

impl Film for Sequence {
    fn add(&mut self, pixels: &[u8]) -> Result<(), String> {
        let path = self.paths.pop().ok_or("more frames than files")?;
        let failed = |error: &dyn std::fmt::Display| format!("{}: {error}", path.display());
        let (whole, mut file) = Whole::create(&path)?;
        let bytes = encode::picture(self.size, pixels).map_err(|error| failed(&error))?;
        file.write_all(&bytes).and_then(|()| file.flush()).map_err(|error| failed(&error))?;
        self.done.push(whole);
        Ok(())
    }

    fn finish(self: Box<Self>) -> Result<(), String> {
        self.done.into_iter().try_for_each(Whole::finish)
    }
}
