//! Files that are written under another name and then renamed.

use std::fs::{self, File};
use std::io::{BufWriter, Write};
use std::path::{Path, PathBuf};

/// A file that takes its name when it is complete. Dropped before that, it leaves nothing.
pub struct Whole {
    path: PathBuf,
    part: PathBuf,
    done: bool,
}

impl Whole {
    /// # Errors
    /// A folder that is missing or cannot be written, naming the file.
    pub fn create(path: &Path) -> Result<(Whole, BufWriter<File>), String> {
        let name = path.file_name().ok_or_else(|| format!("{}: not a file's name", path.display()))?;
        let part = path.with_file_name(format!(".{}.{}.part", name.to_string_lossy(), std::process::id()));
        let file = File::create(&part).map_err(|error| format!("{}: {error}", path.display()))?;
        Ok((Whole { path: path.into(), part, done: false }, BufWriter::new(file)))
    }

    /// Its path until then.
    pub fn part(&self) -> &Path {
        &self.part
    }

    /// Gives the file its name.
    ///
    /// # Errors
    /// What the system says, naming the file.
    pub fn finish(mut self) -> Result<(), String> {
        fs::rename(&self.part, &self.path).map_err(|error| format!("{}: {error}", self.path.display()))?;
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
///
/// # Errors
/// What the system says, naming the file.
pub fn write(path: &Path, bytes: &[u8]) -> Result<(), String> {
    let (whole, mut file) = Whole::create(path)?;
    let written = file.write_all(bytes).and_then(|()| file.flush());
    written.map_err(|error| format!("{}: {error}", path.display()))?;
    whole.finish()
}

/// A path that ends as its format does.
pub fn with_ending(path: &Path, ending: &str) -> PathBuf {
    let ends = path.extension().is_some_and(|e| e.eq_ignore_ascii_case(ending));
    if ends { path.into() } else { format!("{}.{ending}", path.display()).into() }
}

/// A file that would be replaced.
pub struct Existing {
    pub path: PathBuf,
    /// True if it was opened as an input.
    pub read: bool,
}

impl std::fmt::Display for Existing {
    fn fmt(&self, out: &mut std::fmt::Formatter) -> std::fmt::Result {
        write!(out, "{}{}", self.path.display(), if self.read { " (this was opened)" } else { "" })
    }
}

/// Of some files, those that exist.
pub fn existing(paths: &[PathBuf], inputs: &[PathBuf]) -> Vec<Existing> {
    let real = |path: &Path| path.canonicalize().ok();
    let inputs: Vec<_> = inputs.iter().filter_map(|input| real(input)).collect();
    let there = paths.iter().filter(|path| path.symlink_metadata().is_ok());
    let one = |path: &PathBuf| Existing {
        path: path.clone(),
        read: real(path).is_some_and(|path| inputs.contains(&path)),
    };
    there.map(one).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_file_is_there_as_a_whole_or_not_at_all() {
        let folder = std::env::temp_dir().join(format!("vrtm-view-file-{}", std::process::id()));
        fs::create_dir_all(&folder).expect("a folder");
        let path = folder.join("a.txt");
        fs::write(&path, "old").expect("written");
        let (whole, mut file) = Whole::create(&path).expect("created");
        file.write_all(b"half").and_then(|()| file.flush()).expect("written");
        drop(whole);
        assert_eq!(fs::read(&path).expect("read"), b"old");
        write(&path, b"new").expect("written");
        assert_eq!(fs::read(&path).expect("read"), b"new");
        assert_eq!(fs::read_dir(&folder).expect("read").count(), 1);
        let error = write(&folder.join("none/a.txt"), b"").expect_err("no folder");
        assert!(error.contains("none"), "{error}");
        let said = existing(&[path.clone(), folder.join("b.txt")], &[folder.join(".").join("a.txt")]);
        let said: Vec<String> = said.iter().map(ToString::to_string).collect();
        assert!(said.len() == 1 && said[0].ends_with("a.txt (this was opened)"), "{said:?}");
        fs::remove_dir_all(&folder).expect("removed");
    }
}
