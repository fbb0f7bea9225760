//! Errors that end the program: one line with the file (or argument) and the reason.

use std::fmt;
use std::io::{self, Read};
use std::path::Path;

#[derive(Debug)]
pub struct Failure(pub String);

pub type Result<T> = std::result::Result<T, Failure>;

impl Failure {
    pub fn file(path: &Path, reason: impl fmt::Display) -> Failure {
        Failure::named(&path.display().to_string(), reason)
    }

    pub fn named(subject: &str, reason: impl fmt::Display) -> Failure {
        // Libraries' messages are joined to one line.
        let reason = reason.to_string().split_whitespace().collect::<Vec<_>>().join(" ");
        Failure(format!("{subject}: {reason}"))
    }
}

/// Reads a whole file. Pipes and devices are refused: some never say anything, others never end.
pub fn read(path: &Path) -> Result<Vec<u8>> {
    let failure = |e: io::Error| Failure::file(path, e);
    // Before it is opened, as that waits for a pipe's other end.
    let data = std::fs::metadata(path).map_err(failure)?;
    if !data.is_file() {
        return Err(Failure::file(path, if data.is_dir() { "is a folder" } else { "is not a regular file" }));
    }
    // No more than there is now, of a file that grows.
    let mut file = std::fs::File::open(path).map_err(failure)?.take(data.len());
    let mut bytes = Vec::new();
    bytes.try_reserve_exact(data.len() as usize).map_err(|e| Failure::file(path, e))?;
    file.read_to_end(&mut bytes).map_err(failure)?;
    Ok(bytes)
}
