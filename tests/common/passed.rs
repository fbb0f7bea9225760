//! Tests that judge how good results are say nothing new while the results keep their bits, which `tests/bits.txt`
//! holds. Such a test runs in a long run, and when the bits, or what judges them, differ from those with which it last
//! passed: `tests/passed.txt` has a line of each. A run with a GPU and with the assets writes the lines of the tests
//! that pass.

use std::any::type_name;
use std::fs::{File, OpenOptions};
use std::io::{Read, Seek, Write};
use std::panic::Location;
use std::path::{Path, PathBuf};

use super::{files, gpu, long};

/// Files that all such tests judge with, beside their own file and its folder.
const JUDGES: [&str; 5] = [
    "benches/speed_error/scenes.rs",
    "crates/lab/src/reference",
    "crates/lab/src/reference.rs",
    "examples/scenes",
    "tests/common",
];

/// 64-bit FNV-1a.
pub struct Hash(pub u64);

impl Hash {
    pub fn new() -> Hash {
        Hash(0xcbf2_9ce4_8422_2325)
    }

    pub fn byte(&mut self, byte: u8) {
        self.0 = (self.0 ^ u64::from(byte)).wrapping_mul(0x0000_0100_0000_01b3);
    }

    pub fn add(&mut self, x: u64) {
        x.to_le_bytes().into_iter().for_each(|byte| self.byte(byte));
    }

    /// A text's lines, but for comments and the space around them.
    fn text(&mut self, path: &Path) {
        let text = std::fs::read_to_string(path).unwrap_or_default();
        let lines = text.lines().map(str::trim).filter(|line| !line.starts_with("//"));
        lines.flat_map(str::bytes).for_each(|byte| self.byte(byte));
    }

    /// A file, or all files below a folder.
    fn source(&mut self, path: &Path) {
        if !path.is_dir() {
            return self.text(path);
        }
        let mut paths: Vec<PathBuf> = std::fs::read_dir(path).unwrap().map(|e| e.unwrap().path()).collect();
        paths.sort();
        paths.iter().for_each(|path| self.source(path));
    }
}

fn root() -> &'static Path {
    Path::new(env!("CARGO_MANIFEST_DIR"))
}

/// A test that runs; its line is written at the end, unless it panics.
pub struct Run {
    name: &'static str,
    hash: u64,
}

/// `None`, and a line that says so, if the test has passed with these bits. The first argument is the test itself.
#[track_caller]
#[must_use]
pub fn unless_passed<F: Fn()>(_test: F) -> Option<Run> {
    let own = root().join(Location::caller().file());
    let mut hash = Hash::new();
    hash.source(&root().join("tests/bits.txt"));
    hash.source(&own);
    hash.source(&own.with_extension(""));
    JUDGES.iter().for_each(|source| hash.source(&root().join(source)));
    let run = Run { name: type_name::<F>(), hash: hash.0 };
    let passed = std::fs::read_to_string(file()).unwrap_or_default();
    // What an unknown driver computes is compared with no bits.
    let known = gpu::counted().is_none_or(|backend| has_bits_of(&backend));
    if !long::long() && known && passed.lines().any(|line| line == run.line()) {
        println!("skipped: passed with these bits; VRTM_LONG_TESTS=1 runs it");
        return None;
    }
    Some(run)
}

/// True if `tests/bits.txt` has bits of a backend.
fn has_bits_of(backend: &str) -> bool {
    let text = std::fs::read_to_string(root().join("tests/bits.txt")).unwrap_or_default();
    text.lines().any(|line| line.split(" | ").next() == Some(backend))
}

fn file() -> PathBuf {
    root().join("tests/passed.txt")
}

impl Run {
    fn line(&self) -> String {
        format!("{} {:016x}", self.name, self.hash)
    }

    /// Replaces the test's line, among other tests, threads and processes that do the same.
    fn write(&self) -> std::io::Result<()> {
        let mut file: File =
            OpenOptions::new().read(true).write(true).create(true).truncate(false).open(file())?;
        file.lock()?;
        let mut text = String::new();
        file.read_to_string(&mut text)?;
        let is_other = |line: &&str| !line.starts_with('#') && line.split(' ').next() != Some(self.name);
        let mut lines: Vec<String> = text.lines().filter(is_other).map(str::to_owned).collect();
        lines.push(self.line());
        lines.sort();
        file.set_len(0)?;
        file.rewind()?;
        writeln!(
            file,
            "# Written by tests/common/passed.rs: test, hash of the bits and sources that it passed with."
        )?;
        lines.iter().try_for_each(|line| writeln!(file, "{line}"))
    }
}

impl Drop for Run {
    fn drop(&mut self) {
        let complete = gpu::counted().is_some_and(|backend| has_bits_of(&backend)) && files::are_there();
        if complete && !std::thread::panicking() {
            // A source tree that cannot be written to keeps its lines.
            self.write().unwrap_or_else(|error| println!("{}: {error}", file().display()));
        }
    }
}
