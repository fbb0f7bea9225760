use vrtm_core::allocation::Vec;
use vrtm_core::grid::blocks::*;
use vrtm_core::grid::node_set::NodeSet;
use vrtm_core::grid::planes::SIDE;
use vrtm_core::mesh::NONE;
use vrtm_core::team::Team;

/// The blocks of the given movable nodes (chart, i, j).
fn blocks_of(charts: usize, nodes: &[(u32, usize, usize)]) -> (Blocks, Vec<NodeSet>) {
    let mut parts: Vec<Part> = Vec::new();
    for &(chart, i, j) in nodes {
        let (x, y) = ((i / SIDE) as u32, (j / SIDE) as u32);
        let key = (chart, y, x);
        let at = parts.binary_search_by_key(&key, Part::key).unwrap_or_else(|at| {
            parts.insert(at, Part { chart, x, y, nodes: NodeSet::EMPTY });
            at
        });
        parts[at].nodes.insert(i % SIDE, j % SIDE);
    }
    Team::with(2, |team| Blocks::new(team, charts, &parts))
}

#[test]
fn blocks_hold_movable_nodes_and_their_neighbours() {
    // One movable node of chart 1, in the corner of a block.
    let (blocks, movable) = blocks_of(2, &[(1, 32, 31)]);
    assert_eq!(blocks.of_chart, [0..0, 0..4]);
    let active: Vec<_> = blocks.list.iter().filter(|b| b.active).collect();
    assert_eq!(active.len(), 1);
    assert_eq!((active[0].x, active[0].y), (2, 1));
    assert_eq!(movable.iter().map(NodeSet::count).sum::<u64>(), 1);
    let at = blocks.find(1, 2, 1) as usize;
    assert_eq!(blocks.neighbours[at][4], at as u32);
    assert_eq!(blocks.neighbours[at][3], blocks.find(1, 1, 1));
    assert_eq!(blocks.neighbours[at][5], NONE);
    assert_eq!(blocks.holding(at, 31, 32), blocks.find(1, 1, 2));
    assert_eq!(blocks.holding(at, 0, 0), NONE);
    let around = blocks.window(&movable, blocks.find(1, 1, 2) as usize);
    assert!(around.contains(17, 0) && around.dilated().contains(15, 0) && around.dilated().count() == 1);
}

/// Also where charts meet in a square, which then has a block of each.
#[test]
fn blocks_are_those_of_the_nodes_one_by_one() {
    let mut seed = 5u32;
    let mut nodes = Vec::new();
    for _ in 0..60 {
        seed = seed.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
        nodes.push((seed >> 30, 1 + (seed >> 8) as usize % 90, 1 + (seed >> 16) as usize % 70));
    }
    let (blocks, _) = blocks_of(4, &nodes);
    let mut expected = std::collections::BTreeMap::new();
    for &(chart, i, j) in &nodes {
        for (di, dj) in (0..9).map(|k| (k % 3, k / 3)) {
            let key = (chart, ((j + dj - 1) / SIDE) as u32, ((i + di - 1) / SIDE) as u32);
            *expected.entry(key).or_insert(false) |= (j / SIDE, i / SIDE) == (key.1 as usize, key.2 as usize);
        }
    }
    let found: Vec<_> = blocks.list.iter().map(|b| ((b.chart, b.y, b.x), b.active)).collect();
    assert_eq!(found, expected.into_iter().collect::<Vec<_>>());
}
