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
