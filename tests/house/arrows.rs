//! The order of the house: a module of `src` imports only modules below it. `src/lib.rs` lists them from the ground up.

use std::collections::BTreeMap;
use std::fs;
use std::path::Path;

/// The modules of `src/lib.rs` in their order, each with its rank.
fn ranks(root: &Path) -> BTreeMap<String, usize> {
    let lib = fs::read_to_string(root.join("lib.rs")).unwrap();
    let mut ranks = BTreeMap::new();
    for line in lib.lines() {
        let line = line.strip_prefix("pub ").unwrap_or(line);
        if let Some(name) = line.strip_prefix("mod ").and_then(|rest| rest.strip_suffix(';')) {
            let next = ranks.len();
            ranks.entry(name.to_owned()).or_insert(next);
        }
    }
    ranks
}

/// All Rust files under a folder, without those of tests.
fn sources(folder: &Path, found: &mut Vec<std::path::PathBuf>) {
    for entry in fs::read_dir(folder).unwrap() {
        let path = entry.unwrap().path();
        if path.is_dir() {
            sources(&path, found);
        } else if path.extension().is_some_and(|e| e == "rs") && !path.ends_with("tests.rs") {
            found.push(path);
        }
    }
}

/// A file's code: without comments, and without the tests at its end.
fn code(path: &Path) -> String {
    let text = fs::read_to_string(path).unwrap();
    let mut code = String::new();
    let mut lines = text.lines().peekable();
    while let Some(line) = lines.next() {
        let only_in_tests = line.starts_with("#[cfg(test)]") || line.starts_with("#[cfg(all(test");
        let next = lines.peek().map_or("", |next| next.trim_start());
        if only_in_tests && next.starts_with("mod ") && next.ends_with('{') {
            break;
        }
        if only_in_tests && next.starts_with("use ") {
            lines.next();
            continue;
        }
        code.push_str(line.split("//").next().unwrap_or_default());
        code.push('\n');
    }
    code
}

/// What follows each `crate::` in the code: the names of modules, or of what `lib.rs` exports.
fn imported(code: &str) -> Vec<String> {
    let name = |text: &str| text.chars().take_while(|c| c.is_alphanumeric() || *c == '_').collect::<String>();
    let mut names = Vec::new();
    for (at, _) in code.match_indices("crate::") {
        if code[..at].ends_with(|c: char| c.is_alphanumeric() || c == '_' || c == '$') {
            continue;
        }
        let rest = &code[at + "crate::".len()..];
        match rest.strip_prefix('{') {
            Some(list) => {
                let list = list.split('}').next().unwrap_or_default();
                names.extend(list.split(',').map(|item| name(item.trim())).filter(|name| !name.is_empty()));
            }
            None => names.push(name(rest)),
        }
    }
    names
}

#[test]
fn imports_point_down_and_name_the_defining_module() {
    let root = Path::new(env!("CARGO_MANIFEST_DIR")).join("src");
    let ranks = ranks(&root);
    assert!(ranks.len() > 20 && ranks["line"] < ranks["ffi"], "{ranks:?}");
    let mut files = Vec::new();
    sources(&root, &mut files);
    let (mut arrows, mut wrong) = (0, Vec::new());
    for path in files {
        let place = path.strip_prefix(&root).unwrap();
        let first = place.components().next().unwrap().as_os_str().to_str().unwrap();
        let own = match first.strip_suffix(".rs").unwrap_or(first) {
            "lib" => continue,
            "gpu_absent" => "gpu",
            own => own,
        };
        for name in imported(&code(&path)) {
            match ranks.get(&name) {
                Some(rank) if *rank > ranks[own] => wrong.push(format!("{}: up to {name}", place.display())),
                Some(_) => arrows += 1,
                None => wrong.push(format!("{}: crate::{name} is defined elsewhere", place.display())),
            }
        }
    }
    assert!(arrows > 500, "only {arrows} imports were found");
    assert!(wrong.is_empty(), "\n{}", wrong.join("\n"));
}
