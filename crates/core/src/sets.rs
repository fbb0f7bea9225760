//! Disjoint sets of numbers, each a tree: a number knows its parent, and the root is its own.

/// The root of a number's tree, which is made flatter on the way.
pub fn root(parents: &mut [u32], mut a: u32) -> u32 {
    while parents[a as usize] != a {
        parents[a as usize] = parents[parents[a as usize] as usize];
        a = parents[a as usize];
    }
    a
}
