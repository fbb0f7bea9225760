//! Errors that end the program: one line with the file (or argument) and the reason.

use std::fmt;
use std::io::{self, Write};
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

/// Writes a line to stderr. The bake continues if it cannot be written, as on a full disk.
pub fn say(line: &str) {
    let _ = writeln!(io::stderr(), "bake: {line}");
}

/// Reads a whole file.
pub fn read(path: &Path) -> Result<Vec<u8>> {
    std::fs::read(path).map_err(|e| Failure::file(path, e))
}
