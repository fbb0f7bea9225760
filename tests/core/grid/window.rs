use vrtm_core::grid::blocks::{Blocks, Part};
use vrtm_core::grid::node_set::NodeSet;
use vrtm_core::grid::planes::{NODES, node_at};
use vrtm_core::grid::planes::{Plane, SIDE};
use vrtm_core::grid::window::*;
use vrtm_core::mesh::NONE;
use vrtm_core::team::Team;

#[test]
fn a_window_holds_the_nodes_of_its_surroundings() {
    let parts: Vec<Part> = (0..9)
        .map(|k| Part { chart: 0, x: k % 3, y: k / 3, nodes: NodeSet::EMPTY })
        .map(|mut part| {
            for n in 0..NODES {
                let (i, j) = (part.x as usize * SIDE + n % SIDE, part.y as usize * SIDE + n / SIDE);
                if (1..40).contains(&i) && (8..40).contains(&j) {
                    part.nodes.insert(n % SIDE, n / SIDE);
                }
            }
            part
        })
        .collect();
    let (blocks, _) = Team::with(1, |team| Blocks::new(team, 1, &parts));
    let planes: Vec<Plane<i64>> = blocks
        .list
        .iter()
        .map(|b| {
            std::array::from_fn(|s| {
                let (i, j) = node_at(s);
                (b.x as usize * SIDE + i) as i64 + 1000 * (b.y as usize * SIDE + j) as i64
            })
        })
        .collect();
    assert_eq!(NODES, 256);
    let mut window = [0i64; WINDOW_NODES];
    for (b, block) in blocks.list.iter().enumerate() {
        load(&blocks.neighbours[b], -1, |b| &planes[b], &mut window);
        for j in 0..18 {
            for i in 0..18 {
                let x = i64::from(block.x) * 16 + i as i64 - 1;
                let y = i64::from(block.y) * 16 + j as i64 - 1;
                let stored = blocks.holding(b, x, y) != NONE;
                let expected = if stored { x + 1000 * y } else { -1 };
                assert_eq!(window[place(i, j)], expected, "block {b}, node ({x}, {y})");
            }
        }
    }
}
