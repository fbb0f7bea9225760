//! Links within the documents: each relative link leads to a file or folder, each anchor to a heading of that document,
//! and the indices in `docs/` and its folders name every page there.

use std::collections::BTreeSet;
use std::path::Path;

use crate::root;

/// A document's lines without its blocks and spans of code, in which brackets are no links and `#` is no heading.
fn prose(path: &Path) -> Vec<String> {
    let text = std::fs::read_to_string(path).unwrap();
    let mut in_code = false;
    let mut lines = Vec::new();
    for line in text.lines() {
        if line.trim_start().starts_with("```") {
            in_code = !in_code;
        } else if !in_code {
            lines.push(line.to_string());
        }
    }
    lines
}

/// Targets of the links in a line; images are links, too.
fn targets(line: &str) -> Vec<&str> {
    // Every other piece between backticks is code.
    let pieces = line.split('`').step_by(2);
    pieces
        .flat_map(|piece| piece.split("](").skip(1).filter_map(|rest| Some(rest.split_once(')')?.0)))
        .collect()
}

/// The anchors of a document's headings, as GitHub makes them.
fn anchors(path: &Path) -> BTreeSet<String> {
    let mut anchors = BTreeSet::new();
    for line in prose(path) {
        let Some((marks, heading)) = line.split_once(' ') else { continue };
        if marks.is_empty() || marks.chars().any(|c| c != '#') {
            continue;
        }
        let kept = heading.to_lowercase().replace(' ', "-");
        let anchor: String = kept.chars().filter(|&c| c.is_alphanumeric() || c == '-' || c == '_').collect();
        // Headings of the same words are numbered from the second one on.
        let numbered = (1..).map(|k| format!("{anchor}-{k}"));
        let free = std::iter::once(anchor.clone()).chain(numbered).find(|name| !anchors.contains(name));
        anchors.extend(free);
    }
    anchors
}

#[test]
fn every_relative_link_and_anchor_leads_somewhere() {
    let found = crate::files(root(), &["md"]);
    let (mut links, mut broken) = (0, Vec::new());
    for document in &found {
        for line in prose(document) {
            for target in targets(&line).into_iter().filter(|target| !target.contains(':')) {
                links += 1;
                let (file, anchor) = target.split_once('#').unwrap_or((target, ""));
                let path =
                    if file.is_empty() { document.clone() } else { document.parent().unwrap().join(file) };
                let there = path.exists() && (anchor.is_empty() || anchors(&path).contains(anchor));
                if !there {
                    broken.push(format!("{}: {target}", document.strip_prefix(root()).unwrap().display()));
                }
            }
        }
    }
    assert!(found.len() > 20 && links > 80, "only {} documents with {links} links found", found.len());
    assert!(broken.is_empty(), "links that lead nowhere:\n{}", broken.join("\n"));
}

#[test]
fn indices_name_every_page() {
    for folder in ["docs", "docs/decisions", "docs/rendering"] {
        let folder = root().join(folder);
        let index = std::fs::read_to_string(folder.join("README.md")).unwrap();
        for entry in std::fs::read_dir(&folder).unwrap() {
            let name = entry.unwrap().file_name().into_string().unwrap();
            if name.ends_with(".md") && name != "README.md" {
                assert!(index.contains(&format!("]({name})")), "{} does not name {name}", folder.display());
            }
        }
    }
}
