//! The words of comments, and the width of lines. A doc comment begins with its noun or verb: "Bytes of a block.",
//! never "What a block takes."; a docstring of Python does, too. `tests/house/exceptions.txt` counts, file by file,
//! what is otherwise: it may only shrink, and a file that is not in it has none. `VRTM_UPDATE_EXCEPTIONS=1 cargo test
//! --test house words::` writes it anew where it has shrunk.

use std::collections::BTreeMap;
use std::path::Path;

use crate::{files, root};

const WIDTH: usize = 120;
const OPENINGS: [&str; 8] = ["What", "Whether", "Where", "How", "Those", "That", "Which", "Why"];
const QUOTES: &str = "\"\"\"";
/// Folders of sources, and the endings of their files.
const FOLDERS: [&str; 8] = ["benches", "bindings", "capi", "crates", "examples", "include", "src", "tests"];
const ENDINGS: [&str; 11] = ["c", "cpp", "cs", "h", "hpp", "js", "mjs", "py", "rs", "ts", "wgsl"];

/// First lines of all doc comments, without their marks: of `///`, or of docstrings.
fn docs(text: &str, is_python: bool) -> Vec<&str> {
    let (mut found, mut is_inside) = (Vec::new(), false);
    for line in text.lines().map(str::trim_start) {
        // A string that is assigned stands behind its name.
        let doc = line.strip_prefix(if is_python { QUOTES } else { "///" });
        if !is_inside {
            found.extend(doc);
        }
        is_inside =
            if is_python { is_inside ^ (line.matches(QUOTES).count() % 2 == 1) } else { doc.is_some() };
    }
    found
}

/// Numbers of long lines, and of doc comments with one of these openings.
fn faults(text: &str, is_python: bool) -> [usize; 2] {
    let long = text.lines().filter(|line| line.chars().count() > WIDTH).count();
    let opens = |doc: &&str| {
        let first = doc.trim_start().split(|c: char| !c.is_alphabetic()).next();
        first.is_some_and(|word| OPENINGS.contains(&word))
    };
    [long, docs(text, is_python).iter().filter(|doc| opens(doc)).count()]
}

#[test]
fn faults_are_found() {
    let long = "x".repeat(WIDTH + 1);
    let text = format!(
        "    /// What it is.\n    /// Where it lies.\n    a: u8,\n    /// Whatever.\n{long}\n// How\n/// Why.\n"
    );
    assert_eq!(faults(&text, false), [1, 2]);
    let text = r#"
"""What it is.

How it ends."""
def whatever(a):
    """Where it lies."""
    b = """
What is no docstring.
"""
    c: int
    """Whether."""
    """The number of
    """
"#;
    assert_eq!(faults(text, true), [0, 3]);
}

#[test]
fn exceptions_only_shrink() {
    // Written from the header, line by line.
    let generated = |path: &Path| path.ends_with("_abi.py") || path.ends_with("_records.py");
    let sources = FOLDERS.iter().flat_map(|folder| files(&root().join(folder), &ENDINGS));
    let name = |file: &Path| file.strip_prefix(root()).unwrap().to_string_lossy().replace('\\', "/");
    let found: BTreeMap<String, [usize; 2]> = sources
        .filter(|file| !generated(file))
        .map(|file| {
            (name(&file), faults(&std::fs::read_to_string(&file).unwrap(), name(&file).ends_with(".py")))
        })
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
    let is_worse = |(file, faults): &(&String, &[usize; 2])| {
        let allowed = known.get(*file).copied().unwrap_or_default();
        (0..2).any(|k| faults[k] > allowed[k])
    };
    let worse: Vec<_> = found.iter().filter(is_worse).collect();
    assert!(worse.is_empty(), "more long lines and openings than before: {worse:#?}");
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
