use vrtm_core::allocation::{Vec, zeroed};
use vrtm_core::fixtures::{maps, sheet};
use vrtm_core::grid::Grid;
use vrtm_core::grid::features::{LEAST_EDGES, LEVELS};
use vrtm_core::grid::planes::{EDGES, SIDE, slot};
use vrtm_core::mesh::NONE;
use vrtm_core::settings::TileSettings;

/// The features are those of a flood over the nodes, and their edges are the pairs of neighbours.
#[test]
fn features_are_connected_rigid_nodes() {
    let mesh = sheet(4, |u, v| [u, v, 0.0]);
    // Rings through many blocks, a weaker half, and a speck.
    let paint = |u: f64, v: f64| {
        let ring = ((u - 0.5).hypot(v - 0.5) * 16.0).fract() < 0.3;
        let speck = (u - 0.52).hypot(v - 0.48) < 0.012;
        0.8 * f64::from(ring || speck) + 0.3 * f64::from(!ring && u < 0.5)
    };
    let maps = maps(128, TileSettings::default(), paint);
    let grid = Grid::new(&mesh, &mesh.tiles[0], &maps);
    for (k, level) in grid.levels.iter().enumerate().take(LEVELS) {
        let pieces = &grid.features.levels[k];
        let feature = |i: i64, j: i64| {
            let side = SIDE as i64;
            let b = level.blocks.find(0, i.div_euclid(side), j.div_euclid(side));
            let s = slot(i.rem_euclid(side) as usize, j.rem_euclid(side) as usize);
            let tag = if b == NONE { 0 } else { pieces.tags[b as usize][s] };
            let piece =
                |piece: u16| pieces.feature[pieces.first[b as usize] as usize + usize::from(piece) - 1];
            (tag & 0xff != 0).then(|| (piece(tag & 0xff), tag >> 8, level.movable[b as usize][s]))
        };
        let mut edges: Vec<u32> = zeroed(grid.features.count);
        for j in 0..=level.ny as i64 {
            for i in 0..=level.nx as i64 {
                let Some((own, inside, movable)) = feature(i, j) else { continue };
                for (e, (di, dj)) in EDGES.into_iter().enumerate() {
                    let far = feature(i + di, j + dj);
                    let is_free = far.is_some_and(|(.., far)| movable | far != 0);
                    let same = is_free && far.is_some_and(|(other, ..)| other == own);
                    assert_eq!(inside >> e & 1 == 1, same, "level {k}, node {i}, {j}, edge {e}");
                    edges[own as usize] += u32::from(same);
                    // On level 0 connected neighbours are of one feature.
                    assert!(k > 0 || same || !is_free);
                }
            }
        }
        assert_eq!(edges, pieces.edges);
        for n in 0..grid.features.count {
            assert!(pieces.of(n).iter().all(|&piece| pieces.feature[piece as usize] == n as u32));
            assert!(k > 0 || edges[n] >= LEAST_EDGES);
        }
        assert_eq!(pieces.of_feature.len(), pieces.feature.len());
    }
    // A disc, seven rings and four arcs at each corner. The speck has too few edges.
    assert_eq!(grid.features.count, 24);
}

/// Outlines that are half covered, as those of a map on a grid of half its size are, join nothing.
#[test]
fn half_rigid_nodes_are_in_no_feature() {
    let mesh = sheet(4, |u, v| [u, v, 0.0]);
    for largest in [1.0, 0.4, 0.7] {
        let bars = |u: f64, _: f64| largest * f64::from((u * 8.0).fract() < 0.4).max(0.5);
        let grid = Grid::new(&mesh, &mesh.tiles[0], &maps(64, TileSettings::default(), bars));
        assert_eq!(grid.features.count, 8, "{largest}");
    }
}
