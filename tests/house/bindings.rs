//! The order of the bindings: a Python file imports only files of its own row, or of a row further down, in the table
//! of docs/architecture.md; and no files import one another in a circle.

use std::collections::{BTreeMap, BTreeSet};
use std::fs;
use std::path::{MAIN_SEPARATOR, Path};

use crate::{files, root};

/// The packages, and where they are.
const PACKAGES: [(&str, &str); 2] = [("vrtm_blender", "bindings/blender"), ("vrtm", "bindings/python/src")];
/// The build writes these, which import nothing of the package but `_table`.
const GENERATED: [&str; 2] = ["vrtm/_abi", "vrtm/_records"];
/// A tile tells type checkers what it belongs to; nothing is loaded for that.
const ALLOWED: (&str, &str) = ("vrtm/_tile", "vrtm/_asset");

type Arrows = BTreeMap<String, BTreeSet<String>>;

/// Adds the files of a package, without `.py`, such as `vrtm/bake/run`, each with its code.
fn sources(base: &Path, package: &str, found: &mut BTreeMap<String, String>) {
    for path in files(&base.join(package), &["py"]) {
        let name = path.strip_prefix(base).unwrap().with_extension("");
        let name = name.to_str().unwrap().replace(MAIN_SEPARATOR, "/");
        // Every other piece between quotes is text.
        let code = fs::read_to_string(&path).unwrap().split("\"\"\"").step_by(2).collect();
        found.insert(name, code);
    }
    found.retain(|name, _| !GENERATED.contains(&name.as_str()));
}

/// Imports of a file, each as a package or module and one of its names, which is empty for `import module`.
fn imports(file: &str, code: &str) -> Vec<(String, String)> {
    let mut found = Vec::new();
    let mut lines = code.lines().map(|line| line.split('#').next().unwrap().trim());
    while let Some(line) = lines.next() {
        if let Some(modules) = line.strip_prefix("import ") {
            let first = |module: &str| module.split_whitespace().next().unwrap_or_default().replace('.', "/");
            found.extend(modules.split(',').map(|module| (first(module), String::new())));
        } else if let Some((from, names)) =
            line.strip_prefix("from ").and_then(|rest| rest.split_once(" import "))
        {
            let mut names = names.to_owned();
            while names.contains('(') && !names.contains(')') {
                names += lines.next().expect("a list of names ends");
            }
            let dots = from.len() - from.trim_start_matches('.').len();
            let mut place: Vec<&str> = if dots > 0 { file.split('/').collect() } else { Vec::new() };
            place.truncate(place.len().saturating_sub(dots));
            place.extend(from.split('.').filter(|part| !part.is_empty()));
            let name = |name: &str| name.split_whitespace().next().unwrap_or_default().to_owned();
            let names = names.split(['(', ')', ',']).map(name).filter(|name| !name.is_empty());
            found.extend(names.map(|name| (place.join("/"), name)));
        }
    }
    found
}

/// Imports between files, of all packages.
fn arrows() -> Arrows {
    let mut code_of = BTreeMap::new();
    for (package, folder) in PACKAGES {
        sources(&root().join(folder), package, &mut code_of);
    }
    let mut arrows = Arrows::new();
    for (file, code) in &code_of {
        let named = imports(file, code).into_iter().filter_map(|(module, name)| {
            let places = [format!("{module}/{name}"), module.clone(), format!("{module}/__init__")];
            places
                .into_iter()
                .find(|place| code_of.contains_key(place) || GENERATED.contains(&place.as_str()))
        });
        arrows.insert(
            file.clone(),
            named.filter(|name| name != file && !GENERATED.contains(&name.as_str())).collect(),
        );
    }
    assert!(arrows.get_mut(ALLOWED.0).unwrap().remove(ALLOWED.1), "{ALLOWED:?}: it is not imported any more");
    let count: usize = arrows.values().map(BTreeSet::len).sum();
    assert!(code_of.len() > 120 && count > 500, "only {count} arrows between {} files", code_of.len());
    arrows
}

/// The rows of the table, from the top: the files and folders of each.
fn rows() -> Vec<Vec<String>> {
    let text = fs::read_to_string(root().join("docs/architecture.md")).unwrap();
    let section = text
        .split("\n## ")
        .find(|section| section.starts_with("The bindings\n"))
        .expect("the section is there");
    let (mut rows, mut place) = (Vec::new(), "");
    for line in section.lines() {
        if let [_, of, files, ..] = line.split('|').map(str::trim).collect::<Vec<_>>()[..] {
            place = if of.is_empty() { place } else { of.trim_matches('`') };
            let files = files.split('`').skip(1).step_by(2);
            rows.push(files.map(|file| format!("{place}/{file}")).collect());
        }
    }
    rows
}

#[test]
fn imports_point_down_the_table() {
    let (arrows, rows) = (arrows(), rows());
    let row_of = |file: &str| {
        let is_in =
            |place: &String| file == place || (place.ends_with('/') && file.starts_with(place.as_str()));
        rows.iter().position(|row| row.iter().any(is_in))
    };
    let mut wrong = Vec::new();
    for (from, named) in &arrows {
        // What imports nothing and is not imported, as a bare `__init__`, has no place.
        let has_place = !named.is_empty() || arrows.values().any(|named| named.contains(from));
        match row_of(from) {
            None if has_place => wrong.push(format!("{from}: in no row")),
            row => wrong
                .extend(named.iter().filter(|to| row_of(to) < row).map(|to| format!("{from}: up to {to}"))),
        }
    }
    let gone = rows.iter().flatten().filter(|place| !place.ends_with('/') && !arrows.contains_key(*place));
    wrong.extend(gone.map(|place| format!("{place}: there is no such file")));
    assert!(wrong.is_empty(), "docs/architecture.md, The bindings:\n{}", wrong.join("\n"));
}

#[test]
fn no_python_files_import_one_another_in_a_circle() {
    let circles = crate::circles(&arrows());
    assert!(circles.is_empty(), "files import one another:\n{}", circles.join("\n"));
}
