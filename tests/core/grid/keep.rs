use vrtm_core::allocation::Vec;
use vrtm_core::grid::blocks::Part;
use vrtm_core::grid::keep::*;
use vrtm_core::grid::node_set::NodeSet;
use vrtm_core::grid::planes::SIDE;

/// A spiral over four squares, one node of which is at a border, and a feature beside it.
#[test]
fn a_feature_is_kept_to_its_end() {
    let mut rigid: Vec<RigidPart> = Vec::new();
    let spiral = |x: i64, y: i64| {
        let r = (x - 16).abs().max((y - 16).abs());
        r < 14 && r % 2 == 1 && !(y == 16 && x > 16) || (x - 16 == r && y == 17 && r % 2 == 0 && r < 13)
    };
    let apart = |x: i64, y: i64| (29..31).contains(&y) && x == 31;
    let mut wanted = 0;
    for (bx, by) in [(1, 1), (0, 1), (1, 0), (0, 0)] {
        let mut nodes = NodeSet::EMPTY;
        for (i, j) in (0..SIDE * SIDE).map(|n| (n % SIDE, n / SIDE)) {
            let (x, y) = ((bx * SIDE + i) as i64, (by * SIDE + j) as i64);
            if spiral(x, y) || apart(x, y) {
                nodes.insert(i, j);
            }
            wanted += u64::from(spiral(x, y));
        }
        let mut fixed = NodeSet::EMPTY;
        if (bx, by) == (0, 0) {
            fixed.insert(3, 3);
            assert!(nodes.contains(3, 3));
        }
        rigid.push(RigidPart { part: Part { chart: 0, x: bx as u32, y: by as u32, nodes }, fixed });
    }
    // Another chart in the same square.
    let all = NodeSet([u16::MAX; SIDE]);
    rigid.push(RigidPart { part: Part { chart: 1, x: 0, y: 0, nodes: all }, fixed: NodeSet::EMPTY });
    spread(&mut rigid);
    let fixed: u64 = rigid.iter().filter(|of| of.part.chart == 0).map(|of| of.fixed.count()).sum();
    assert_eq!(fixed, wanted);
    assert!(rigid.iter().filter(|of| of.part.chart == 1).all(|of| of.fixed.is_empty()));
}
