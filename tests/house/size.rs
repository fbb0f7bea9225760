//! The sum of code, which does not grow: what is added pays with something that it removes. Where it has shrunk, lower
//! the numbers here.

use std::fs;
use std::path::Path;

/// Lines of all code, and of the product: the library's crates and shaders.
const MOST: [usize; 2] = [164_280, 49_422];
const ENDINGS: [&str; 13] =
    ["c", "cmake", "cpp", "cs", "h", "hpp", "js", "mjs", "py", "rs", "sh", "ts", "wgsl"];
const PRODUCT: [&str; 9] = [
    "capi",
    "crates/beyond",
    "crates/carry",
    "crates/core",
    "crates/cpu",
    "crates/gpu/src",
    "crates/refine",
    "shaders",
    "src",
];
/// Folders that builds and tests write.
const BUILT: [&str; 8] = ["target", "dist", "node_modules", "out", "wasm", "__pycache__", "build", ".git"];

fn lines(folder: &Path) -> usize {
    let count = |entry: std::io::Result<fs::DirEntry>| {
        let path = entry.unwrap().path();
        let name = path.file_name().unwrap().to_string_lossy().into_owned();
        let ending = name.rsplit_once('.').map_or("", |(_, ending)| ending);
        // Python's declarations of the C API are written from the header.
        let generated = name == "_abi.py" || name == "_records.py" || name == "Vrtm.cs";
        if path.is_dir() {
            return if BUILT.contains(&&*name) { 0 } else { lines(&path) };
        }
        let is_code = ENDINGS.contains(&ending) || folder.file_name().is_some_and(|name| name == ".ci");
        if is_code && !generated { fs::read_to_string(&path).unwrap().lines().count() } else { 0 }
    };
    fs::read_dir(folder).unwrap().map(count).sum()
}

#[test]
fn code_does_not_grow() {
    let root = Path::new(concat!(env!("CARGO_MANIFEST_DIR"), "/.."));
    let found = [lines(root), PRODUCT.iter().map(|folder| lines(&root.join(folder))).sum()];
    println!("lines of code: {} in all, {} of the product", found[0], found[1]);
    assert!(found[0] <= MOST[0] && found[1] <= MOST[1], "{found:?} lines of code, at most {MOST:?}");
}
