//! Sets of numbers: groups one after the other, and disjoint sets, each a tree in which a number knows its parent and
//! the root is its own.

use crate::allocation::{Vec, zeroed};

/// Sorts items, each given with its group: per group the index of its first item, followed by the number of all items;
/// and the items, in each group in their order.
pub fn grouped(groups: usize, items: impl Iterator<Item = (usize, u32)> + Clone) -> (Vec<u32>, Vec<u32>) {
    let mut starts: Vec<u32> = zeroed(groups + 1);
    items.clone().for_each(|(group, _)| starts[group + 1] += 1);
    (0..groups).for_each(|group| starts[group + 1] += starts[group]);
    let mut next = starts.clone();
    let mut sorted: Vec<u32> = zeroed(starts[groups] as usize);
    for (group, item) in items {
        sorted[next[group] as usize] = item;
        next[group] += 1;
    }
    (starts, sorted)
}

/// The root of a number's tree, which is made flatter on the way.
pub fn root(parents: &mut [u32], mut a: u32) -> u32 {
    while parents[a as usize] != a {
        parents[a as usize] = parents[parents[a as usize] as usize];
        a = parents[a as usize];
    }
    a
}
