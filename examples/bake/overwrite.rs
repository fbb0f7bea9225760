//! Decides which files a bake may replace: never a file that it reads, and other files only if they carry the mark of
//! vrtm or --overwrite is given.

use std::collections::HashMap;
use std::fs::{self, File};
use std::io::{self, Cursor, Read};
use std::path::{Component, Path, PathBuf};

use exr::prelude::{ReadChannels as _, ReadLayers as _};
use serde_json::Value;

use crate::failure::{Failure, Result};
use crate::source::Input;

/// The mark of a report: the name of its program.
pub const PROGRAM: &str = "vrtm bake";
/// The mark of an EXR file: the name of an attribute.
pub const EXR_MARK: &str = "vrtm:inputs";
/// The mark of a picture: the keyword of a text chunk.
pub const PNG_MARK: &str = "vrtm:kind";

/// The first bytes of every EXR and PNG file.
const EXR: &[u8] = &[0x76, 0x2f, 0x31, 0x01];
const PNG: &[u8] = b"\x89PNG\r\n\x1a\n";
/// The last chunk of every PNG file: a film's pictures after the first are no part of the picture that is read back.
const PNG_END: &[u8] = b"\0\0\0\0IEND\xaeB`\x82";
/// The maximum length of a header: the longest are those of the command `vrtm bake`, which hold figures.
const HEADER: u64 = 16 * 1024;

/// The properties by which two paths are recognised as the same file.
#[derive(Debug, PartialEq, Eq, Hash)]
enum Identity {
    /// A path without links, in capitals: a shared folder may be read on a system that ignores case.
    Name(PathBuf),
    /// Device and inode, which hard links share.
    #[cfg(unix)]
    Node(u64, u64),
}

/// Refuses outputs that would replace protected files. Nothing is written.
pub fn check(folder: &Path, outputs: &[String], inputs: &[Input], overwrite: bool) -> Result<()> {
    let mut read = HashMap::new();
    for (option, path) in inputs {
        read.extend(identities(path)?.into_iter().map(|identity| (identity, (option, path))));
    }
    for output in outputs.iter().map(|name| folder.join(name)) {
        let refused = |reason: String| Err(Failure::file(&output, reason));
        if let Some((option, input)) = identities(&output)?.iter().find_map(|identity| read.get(identity)) {
            return refused(format!("would replace an input, {option} {}", input.display()));
        }
        match fs::metadata(&output) {
            Ok(data) if data.is_file() => {
                if !overwrite && !is_marked(&output).map_err(|e| Failure::file(&output, e))? {
                    return refused("exists, and vrtm did not write it; --overwrite replaces it".into());
                }
            }
            Err(_) if fs::symlink_metadata(&output).is_err() => {}
            _ => return refused("exists, and is not a regular file".into()),
        }
    }
    Ok(())
}

fn identities(path: &Path) -> Result<Vec<Identity>> {
    let in_capitals = |path: PathBuf| Identity::Name(path.to_string_lossy().to_uppercase().into());
    let folder = real_folder(path.parent().unwrap_or(path))?;
    let mut all = vec![in_capitals(folder.join(path.file_name().unwrap_or_default()))];
    all.extend(path.canonicalize().map(in_capitals));
    #[cfg(unix)]
    if let Ok(data) = fs::metadata(path) {
        use std::os::unix::fs::MetadataExt;
        all.push(Identity::Node(data.dev(), data.ino()));
    }
    Ok(all)
}

/// A folder without links. It need not exist yet: `new/../maps` becomes `maps`.
fn real_folder(folder: &Path) -> Result<PathBuf> {
    // The empty path is the current folder, too.
    let path = std::path::absolute(Path::new(".").join(folder)).map_err(|e| Failure::file(folder, e))?;
    let mut real = PathBuf::new();
    for part in path.components() {
        match part {
            Component::Normal(_) => real.push(part),
            Component::ParentDir => _ = real.pop(),
            root => {
                real.push(root);
                continue;
            }
        }
        if !real.is_dir() && fs::symlink_metadata(&real).is_ok() {
            return Err(Failure::file(&real, "is not a folder"));
        }
        real = real.canonicalize().unwrap_or(real);
    }
    Ok(real)
}

/// True if vrtm wrote the file, complete or cut off after its header. Nobody wrote an empty file.
fn is_marked(path: &Path) -> io::Result<bool> {
    let mut header = Vec::new();
    File::open(path)?.take(HEADER).read_to_end(&mut header)?;
    let has = |mark: &str| header.windows(mark.len()).any(|bytes| bytes == mark.as_bytes());
    Ok(match header.first() {
        None => true,
        _ if header.starts_with(EXR) => has(EXR_MARK),
        _ if header.starts_with(PNG) => has(PNG_MARK),
        Some(b'{') => serde_json::from_slice(&fs::read(path)?)
            .is_ok_and(|report: Value| report["program"]["name"] == PROGRAM),
        _ => false,
    })
}

/// Removes a file written by vrtm that cannot be read back.
pub fn remove_if_damaged(path: &Path) {
    if !is_marked(path).unwrap_or(false) {
        return;
    }
    let Ok(bytes) = fs::read(path) else { return };
    let whole = if bytes.starts_with(EXR) {
        let reader = exr::prelude::read().no_deep_data().largest_resolution_level().all_channels();
        let read = reader.first_valid_layer().all_attributes().from_buffered(Cursor::new(&bytes));
        // Someone may have compressed it again with a method that is not supported here.
        !matches!(read, Err(exr::error::Error::Invalid(_) | exr::error::Error::Io(_)))
    } else {
        !bytes.starts_with(PNG) || bytes.ends_with(PNG_END) && image::load_from_memory(&bytes).is_ok()
    };
    if bytes.is_empty() || !whole {
        let _ = fs::remove_file(path);
    }
}
