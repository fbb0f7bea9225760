//! A moving picture as a PNG per frame.

use std::io::Write;
use std::path::PathBuf;

use vrtm_examples::whole::Whole;

use super::clip::{Film, Result};
use super::encode;

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
    fn add(&mut self, pixels: &[u8]) -> Result<()> {
        let path = self.paths.pop().ok_or("more frames than files")?;
        let (whole, mut file) = Whole::create(&path)?;
        file.write_all(&encode::picture(self.size, pixels)?)?;
        file.flush()?;
        self.done.push(whole);
        Ok(())
    }

    fn finish(self: Box<Self>) -> Result<()> {
        Ok(self.done.into_iter().try_for_each(Whole::finish)?)
    }
}
