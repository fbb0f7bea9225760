//! The order of the house. Between crates the compiler holds it. Within a crate a module imports only modules below it,
//! which `lib.rs` lists from the ground up; and no files import one another in a circle.

use std::collections::{BTreeMap, BTreeSet};
use std::fs;
use std::path::{Path, PathBuf};

/// The source folders of the library's crates.
fn crates() -> Vec<PathBuf> {
    let root = crate::root().canonicalize().unwrap();
    let mut folders = vec![root.join("src"), root.join("capi/src")];
    folders.extend(fs::read_dir(root.join("crates")).unwrap().map(|entry| entry.unwrap().path().join("src")));
    // For development alone.
    folders.retain(|folder| !folder.ends_with("testkit/src"));
    folders
}

/// The modules of a `lib.rs` in their order, each with its rank.
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
fn sources(folder: &Path) -> Vec<PathBuf> {
    crate::files(folder, &["rs"]).into_iter().filter(|path| !path.ends_with("tests.rs")).collect()
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

/// Names after each `crate::` in the code: modules, or exports of `lib.rs`.
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
    let (mut arrows, mut wrong) = (0, Vec::new());
    for root in crates() {
        let ranks = ranks(&root);
        for path in sources(&root) {
            let place = path.strip_prefix(&root).unwrap();
            let first = place.components().next().unwrap().as_os_str().to_str().unwrap();
            let own = match first.strip_suffix(".rs").unwrap_or(first) {
                "lib" => continue,
                own => own,
            };
            for name in imported(&code(&path)) {
                match ranks.get(&name) {
                    Some(rank) if *rank > ranks[own] => {
                        wrong.push(format!("{}: up to {name}", path.display()))
                    }
                    Some(_) => arrows += 1,
                    None => wrong.push(format!("{}: crate::{name} is defined elsewhere", path.display())),
                }
            }
        }
    }
    assert!(arrows > 300, "only {arrows} imports were found");
    assert!(wrong.is_empty(), "\n{}", wrong.join("\n"));
}

/// The files by the paths of their modules, such as `cpu::correct::rows`. Without `lib`, which hands on.
fn modules(root: &Path) -> BTreeMap<String, PathBuf> {
    let files = sources(root);
    let name = |file: &Path| {
        let place = file.strip_prefix(root).unwrap().with_extension("");
        place.to_str().unwrap().replace(std::path::MAIN_SEPARATOR, "::").replace("::mod", "")
    };
    let mut modules: BTreeMap<_, _> = files.iter().map(|file| (name(file), file.clone())).collect();
    modules.retain(|name, _| name != "lib");
    for (own, file) in modules.clone() {
        // `#[path = "..."]`, and `mod name;` in the next line.
        for attribute in fs::read_to_string(&file).unwrap().split("#[path = \"").skip(1) {
            let (path, rest) = attribute.split_once("\"]").unwrap();
            let child = rest.split_once("mod ").unwrap().1.split_once(';').unwrap().0;
            let path = file.parent().unwrap().join(path).canonicalize().unwrap();
            modules.remove(&name(&path));
            modules.insert(format!("{own}::{child}"), path);
        }
    }
    modules
}

/// The paths in a `use` of `tree`: one for each name in its braces.
fn expand(before: &str, tree: &str, paths: &mut Vec<String>) {
    let Some((head, list)) = tree.split_once('{') else {
        return paths.extend((!tree.is_empty()).then(|| format!("{before}{tree}")));
    };
    let (mut depth, mut from) = (0, 0);
    for (at, sign) in list.char_indices() {
        depth += i32::from(sign == '{') - i32::from(sign == '}');
        if sign == ',' && depth == 0 || depth < 0 {
            expand(&format!("{before}{head}"), list[from..at].trim(), paths);
            from = at + 1;
        }
    }
}

/// All paths in a file's code. In a module within the file, `super` is the file itself.
fn paths(code: &str) -> Vec<String> {
    let (mut text, mut within) = (String::new(), false);
    for line in code.lines() {
        within = if within { line != "}" } else { line.contains("mod ") && line.ends_with('{') };
        text += &if within { line.replacen("super::", "self::", 1) } else { line.to_owned() };
        text.push('\n');
    }
    let in_path = |sign: char| sign.is_alphanumeric() || "_:".contains(sign);
    let mut paths = Vec::new();
    for statement in text.replace("in crate::", "").split(';') {
        let is_tree = |tree: &str| tree.chars().all(|sign| in_path(sign) || "{}*, \n".contains(sign));
        let of_use = statement.rsplit_once("use ").filter(|(_, tree)| is_tree(tree));
        let (body, tree) = of_use.unwrap_or((statement, ""));
        expand("", tree, &mut paths);
        paths.extend(body.split(|sign| !in_path(sign)).filter(|path| path.contains("::")).map(str::to_owned));
    }
    paths
}

/// The module that a path in module `own` leads to, or is in.
fn module<'a>(own: &str, path: &str, modules: &'a BTreeMap<String, PathBuf>) -> Option<&'a String> {
    let mut at: Vec<&str> = own.split("::").collect();
    let first = path.split("::").next().unwrap();
    if !["crate", "self", "super"].contains(&first) && !modules.contains_key(&format!("{own}::{first}")) {
        return None;
    }
    for name in path.split("::") {
        match name {
            "crate" => at.clear(),
            "self" => {}
            "super" => _ = at.pop(),
            name => at.push(name),
        }
    }
    let known = |depth| modules.get_key_value(&at[..depth].join("::"));
    (1..=at.len()).rev().find_map(known).map(|(name, _)| name)
}

/// std's clock panics in browsers.
#[test]
fn the_clock_alone_asks_std_for_the_time() {
    let files: Vec<_> = crates().iter().flat_map(|root| sources(root)).collect();
    let asks = |path: &PathBuf| {
        let code = code(path);
        // In one path or in a list of imports.
        code.contains("time::Instant") || code.contains("time::{") && code.contains("Instant}")
    };
    let found: Vec<&PathBuf> = files.iter().filter(|path| asks(path)).collect();
    assert!(found.len() == 1 && found[0].ends_with("core/src/clock.rs"), "{found:?}");
}

#[test]
fn no_files_import_one_another_in_a_circle() {
    let (mut files, mut count, mut circles) = (0, 0, Vec::new());
    for root in crates() {
        let modules = modules(&root);
        let mut arrows: BTreeMap<String, BTreeSet<String>> = BTreeMap::new();
        for (own, file) in &modules {
            let paths = paths(&code(file));
            let named = paths.iter().filter_map(|path| module(own, path, &modules));
            arrows.insert(own.clone(), named.filter(|name| *name != own).cloned().collect());
        }
        let of_crate = crate::circles(&arrows);
        circles.extend(of_crate.into_iter().map(|circle| format!("{}: {circle}", root.display())));
        files += modules.len();
        count += arrows.values().map(BTreeSet::len).sum::<usize>();
    }
    assert!(files > 200 && count > 600, "only {count} arrows between {files} files");
    assert!(circles.is_empty(), "files import one another:\n{}", circles.join("\n"));
}
