//! The table of docs/languages.md: each name stands in the files of its language, and where there is none, a reason.

use std::fs;
use std::path::Path;

use crate::{files, root};

/// Columns, and where their names are declared: files, or folders of them. The structs of C are those of C++, too, and
/// those of Python and C# are made of them.
const COLUMNS: [(&str, &[&str]); 6] = [
    ("C", &["include/vrtm.h"]),
    ("C++", &["include/vrtm.hpp", "include/vrtm.h"]),
    ("Rust", &["src", "crates/core/src", "crates/carry/src"]),
    ("Python", &["bindings/python/src/vrtm", "include/vrtm.h"]),
    // Without the declarations that are written into src/wasm.
    (
        "JavaScript",
        &[
            "bindings/web/src/index.ts",
            "bindings/web/src/methods.ts",
            "bindings/web/src/paint.ts",
            "bindings/web/src/three/basis.ts",
            "bindings/web/src/worker_asset.ts",
        ],
    ),
    ("C#", &["bindings/csharp/Asset.cs", "include/vrtm.h"]),
];
const ENDINGS: [&str; 6] = ["h", "hpp", "rs", "py", "ts", "cs"];

/// Lines of code of a file or folder, without comments, docstrings, what is written from the header, and a command's.
fn code(place: &Path) -> Vec<String> {
    let mut found = Vec::new();
    for path in files(place, &ENDINGS) {
        let is_other =
            |part: &std::ffi::OsStr| ["_abi.py", "_records.py", "bake"].iter().any(|name| part == *name);
        if path.strip_prefix(place).unwrap().iter().any(is_other) {
            continue;
        }
        let text = fs::read_to_string(&path).unwrap_or_else(|e| panic!("{}: {e}", path.display()));
        // Every other piece between such quotes is text.
        for line in text.split("\"\"\"").step_by(2).flat_map(str::lines) {
            let is_mark = |mark: &&str| line.trim_start().starts_with(*mark);
            if !["//", "/*", "* ", "#!", "# "].iter().any(is_mark) {
                found.push(line.to_owned());
            }
        }
    }
    found
}

/// True if the line declares the name: it is not part of an expression.
fn declares(line: &str, name: &str) -> bool {
    let is_part = |c: char| c.is_alphanumeric() || c == '_';
    line.match_indices(name).any(|(at, _)| {
        let (before, after) = (&line[..at], &line[at + name.len()..]);
        let before = before.trim_start();
        !before.ends_with(is_part)
            && !after.starts_with(is_part)
            && !before.contains(['(', '=', '.', '"', '\''])
            && !["return", "use", "import", "from", "await", "throw"]
                .contains(&before.split(' ').next().unwrap())
    })
}

/// True if the lines declare the last name of a path, within what is declared by the name before it.
fn declare(lines: &[String], path: &str) -> bool {
    let Some((outer, name)) = path.rsplit_once(['.', ':']) else {
        return lines.iter().any(|line| declares(line, path));
    };
    let indent = |line: &str| line.len() - line.trim_start().len();
    let opens = |line: &str| declares(line, outer.trim_end_matches(':')) && !line.ends_with(';');
    (0..lines.len()).filter(|&k| opens(&lines[k])).any(|k| {
        let ends = |line: &&String| {
            let is_label = ["", "{", "public:", "private:", "protected:"].contains(&line.trim());
            !is_label && indent(line) <= indent(&lines[k])
        };
        lines[k + 1..].iter().take_while(|line| !ends(line)).any(|line| declares(line, name))
    })
}

#[test]
fn each_language_has_what_the_table_names() {
    let document = fs::read_to_string(root().join("docs/languages.md")).unwrap();
    let mut rows = document
        .lines()
        .filter(|line| line.starts_with('|'))
        .map(|line| line.trim_matches('|').split('|').map(|cell| cell.trim().to_owned()).collect::<Vec<_>>());
    let head = rows.next().unwrap();
    assert!(head.iter().skip(1).eq(COLUMNS.iter().map(|(language, _)| language)), "{head:?}");
    let rows: Vec<_> = rows.skip(1).collect();
    assert!(rows.len() >= 20, "only {} rows", rows.len());
    let mut missing = Vec::new();
    for (k, (language, places)) in COLUMNS.iter().enumerate() {
        let lines: Vec<_> = places.iter().flat_map(|place| code(&root().join(place))).collect();
        for row in &rows {
            assert_eq!(row.len(), 1 + COLUMNS.len(), "{row:?}");
            let cell = &row[1 + k];
            if cell.starts_with("no: ") && cell.len() > 10 {
                continue;
            }
            // Code stands between every second pair of marks.
            let names: Vec<_> =
                cell.split('`').skip(1).step_by(2).filter(|name| !name.ends_with(".cs")).collect();
            if names.is_empty() {
                missing.push(format!("{language}: neither a name nor a reason for {}", row[0]));
            }
            let lacks = |name: &&str| !declare(&lines, name);
            missing.extend(
                names.into_iter().filter(lacks).map(|name| format!("{language}: {name}, {}", row[0])),
            );
        }
    }
    assert!(missing.is_empty(), "docs/languages.md names what is not there:\n{}", missing.join("\n"));
}
