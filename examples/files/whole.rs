//! Files that are written under another name and then renamed.

use std::fs::{self, File};
use std::io::{self, BufWriter, Write};
use std::path::{Path, PathBuf};

/// A file that takes its name when it is complete. Dropped before that, it leaves nothing.
pub struct Whole {
    path: PathBuf,
    part: PathBuf,
    done: bool,
}

impl Whole {
    pub fn create(path: &Path) -> io::Result<(Whole, BufWriter<File>)> {
        let name = path.file_name().ok_or_else(|| io::Error::other("not a file's name"))?;
        let part = path.with_file_name(format!(".{}.{}.part", name.to_string_lossy(), std::process::id()));
        let file = File::create(&part)?;
        Ok((Whole { path: path.into(), part, done: false }, BufWriter::new(file)))
    }

    /// Gives the file its name.
    pub fn finish(mut self) -> io::Result<()> {
        fs::rename(&self.part, &self.path)?;
        self.done = true;
        Ok(())
    }
}

impl Drop for Whole {
    fn drop(&mut self) {
        if !self.done {
            let _ = fs::remove_file(&self.part);
        }
    }
}

/// Writes a whole file.
pub fn write(path: &Path, bytes: &[u8]) -> Result<(), String> {
    let written = Whole::create(path).and_then(|(whole, mut file)| {
        file.write_all(bytes)?;
        file.flush()?;
        whole.finish()
    });
    written.map_err(|error| format!("{}: {error}", path.display()))
}
