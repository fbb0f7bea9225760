//! The house itself: who imports whom, whether the links of documents lead anywhere, what is packed, and how comments begin.
//! Nothing of the library is run.

mod arrows;
mod bindings;
mod languages;
mod links;
mod packages;
mod size;
mod words;

use std::collections::{BTreeMap, BTreeSet};
use std::fs;
use std::path::{Path, PathBuf};

/// Folders that builds, bakes and tests write.
const BUILT: [&str; 7] = ["target", "dist", "node_modules", "out", "wasm", "__pycache__", "build"];

/// The repository.
fn root() -> &'static Path {
    Path::new(concat!(env!("CARGO_MANIFEST_DIR"), "/.."))
}

/// All files with one of these endings in a folder, but for hidden folders and those that builds write; or the file
/// itself.
fn files(path: &Path, endings: &[&str]) -> Vec<PathBuf> {
    let name = path.file_name().unwrap_or_default().to_string_lossy();
    if !path.is_dir() {
        let ending = name.rsplit_once('.').map_or("", |(_, ending)| ending);
        return endings.contains(&ending).then(|| path.to_owned()).into_iter().collect();
    }
    if BUILT.contains(&&*name) || name.starts_with('.') {
        return Vec::new();
    }
    fs::read_dir(path).unwrap().flat_map(|entry| files(&entry.unwrap().path(), endings)).collect()
}

/// Names that lead back to themselves, each with the names that lead to it.
fn circles(arrows: &BTreeMap<String, BTreeSet<String>>) -> Vec<String> {
    let mut circles = Vec::new();
    for own in arrows.keys() {
        let (mut reached, mut open) = (BTreeMap::new(), vec![own]);
        while let Some(from) = open.pop() {
            open.extend(arrows[from].iter().filter(|to| reached.insert(*to, from).is_none()));
        }
        circles.extend(reached.get(own).map(|from| format!("{from} -> {own}")));
    }
    circles
}
