use std::collections::BTreeSet;

use vrtm_core::method::pbd::*;

#[test]
fn the_eight_sets_share_no_node_and_have_every_edge_once() {
    let inside = |(i, j): (i64, i64)| (0..16).contains(&i) && (0..16).contains(&j);
    let mut edges = BTreeSet::new();
    for set in SETS {
        let mut seen = BTreeSet::new();
        for (i, j) in (0..256).map(|k| (k % 16, k / 16)) {
            let ((di, dj), owned_by_other) = set.partner(i, j);
            let (node, other) = ((i as i64, j as i64), (i as i64 + di, j as i64 + dj));
            if !inside(other) {
                continue;
            }
            // Seen from the other end, it is the same edge.
            let back = set.partner(other.0 as usize, other.1 as usize);
            assert_eq!(back, ((-di, -dj), !owned_by_other), "{set:?} at {node:?}");
            if !owned_by_other {
                assert!(seen.insert(node) && seen.insert(other), "{set:?} has a node of {node:?} twice");
                assert!(edges.insert((node, other)), "{node:?} to {other:?} is in two sets");
            }
        }
    }
    // 15 x 16 along each axis, 15 x 15 along each diagonal.
    assert_eq!(edges.len(), 2 * 15 * 16 + 2 * 15 * 15);
}
