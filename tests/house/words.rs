//! The words of comments, and the width of lines. A doc comment begins with its noun: "Bytes of a block.", never "What a block
//! takes." `tests/house/exceptions.txt` counts, file by file, what is otherwise: it may only shrink, and a file that is not in it
//! has none. `VRTM_UPDATE_EXCEPTIONS=1 cargo test --test house words::` writes it anew where it has shrunk.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

const WIDTH: usize = 120;
const OPENINGS: [&str; 7] = ["What", "Whether", "Where", "How", "Those", "Which", "Why"];
/// Folders of sources, and the endings of their files.
const FOLDERS: [&str; 8] = ["benches", "bindings", "capi", "crates", "examples", "include", "src", "tests"];
const ENDINGS: [&str; 11] = ["c", "cpp", "cs", "h", "hpp", "js", "mjs", "py", "rs", "ts", "wgsl"];
/// Folders that builds write.
const BUILT: [&str; 6] = ["target", "dist", "node_modules", "wasm", "__pycache__", "build"];

fn root() -> &'static Path {
    Path::new(concat!(env!("CARGO_MANIFEST_DIR"), "/.."))
}

fn sources(folder: &Path, found: &mut Vec<PathBuf>) {
    for entry in std::fs::read_dir(folder).unwrap() {
        let path = entry.unwrap().path();
        let name = path.file_name().unwrap().to_string_lossy().into_owned();
        // Written from the header, line by line.
        let generated = name == "_abi.py" || name == "_records.py";
        if path.is_dir() && !BUILT.contains(&name.as_str()) && !name.starts_with('.') {
            sources(&path, found);
        } else if name.rsplit_once('.').is_some_and(|(_, ending)| ENDINGS.contains(&ending)) && !generated {
            found.push(path);
        }
    }
}

fn is_doc(line: &str) -> bool {
    line.trim_start().starts_with("///")
}

/// Numbers of long lines, and of doc comments with one of these openings.
fn faults(text: &str) -> [usize; 2] {
    let lines: Vec<&str> = text.lines().collect();
    let long = lines.iter().filter(|line| line.chars().count() > WIDTH).count();
    let opens = |(k, line): (usize, &&str)| {
        let words = line.trim_start().trim_start_matches('/').trim_start();
        let first = words.split(|c: char| !c.is_alphabetic()).next().unwrap_or_default();
        is_doc(line) && (k == 0 || !is_doc(lines[k - 1])) && OPENINGS.contains(&first)
    };
    [long, lines.iter().enumerate().filter(|&(k, line)| opens((k, line))).count()]
}

#[test]
fn faults_are_found() {
    let long = "x".repeat(WIDTH + 1);
    let text = format!(
        "    /// What it is.\n    /// Where it lies.\n    a: u8,\n    /// Whatever.\n{long}\n// How\n/// Why.\n"
    );
    assert_eq!(faults(&text), [1, 2]);
}

#[test]
fn exceptions_only_shrink() {
    let mut files = Vec::new();
    FOLDERS.iter().for_each(|folder| sources(&root().join(folder), &mut files));
    let name = |file: &Path| file.strip_prefix(root()).unwrap().to_string_lossy().replace('\\', "/");
    let found: BTreeMap<String, [usize; 2]> = files
        .iter()
        .map(|file| (name(file), faults(&std::fs::read_to_string(file).unwrap())))
        .filter(|(_, faults)| *faults != [0, 0])
        .collect();
    let path = root().join("tests/house/exceptions.txt");
    let stored = std::fs::read_to_string(&path).unwrap();
    let mut known = BTreeMap::new();
    for line in stored.lines().filter(|line| !line.starts_with('#')) {
        let mut words = line.split(' ');
        let mut number = || words.next().unwrap().parse::<usize>().unwrap();
        let numbers = [number(), number()];
        known.insert(words.next().unwrap().to_owned(), numbers);
    }
    for (file, faults) in &found {
        let allowed = known.get(file).copied().unwrap_or_default();
        let worse = (0..2).any(|k| faults[k] > allowed[k]);
        assert!(!worse, "{file}: {} long lines and {} openings, and not {allowed:?}", faults[0], faults[1]);
    }
    let mut text = String::from(
        "# tests/house/words.rs: lines over 120 columns, doc comments that begin with What or the like, file.\n",
    );
    for (file, [long, openings]) in &found {
        text += &format!("{long} {openings} {file}\n");
    }
    if std::env::var_os("VRTM_UPDATE_EXCEPTIONS").is_some_and(|value| value == "1") {
        std::fs::write(&path, &text).unwrap();
    }
    assert!(
        found == known || std::fs::read_to_string(&path).unwrap() == text,
        "{} may shrink",
        path.display()
    );
}
