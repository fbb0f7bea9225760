use super::map_of;
use vrtm_core::allocation::Vec;
use vrtm_core::allocation::vec;
use vrtm_core::image::map::Map;
use vrtm_core::image::resample::*;

fn at_nodes(map: &Map, cells: [usize; 2], first: [usize; 2], count: [usize; 2]) -> Vec<f32> {
    let mut values = vec![f32::NAN; count[0] * count[1]];
    Resampled::new(map, cells).at_nodes(first, count, |i, j, value| values[j * count[0] + i] = value);
    values
}

#[test]
fn nodes_of_a_constant_or_a_ramp_lie_on_it() {
    for (w, h) in [(1, 1), (3, 7), (16, 16), (100, 33), (64, 129)] {
        let nodes = at_nodes(&map_of(w, h, |_, _| 0.75), [32, 16], [0, 0], [33, 17]);
        assert!(nodes.iter().all(|v| (v - 0.75).abs() < 1e-6));
    }
    // A linear map keeps its values under both filters, except near the clamped edge.
    for w in [8, 16, 64, 200] {
        let ramp = map_of(w, 4, |x, _| (x as f32 + 0.5) / w as f32);
        let nodes = at_nodes(&ramp, [16, 16], [0, 0], [17, 17]);
        for (i, node) in nodes.iter().enumerate().take(15).skip(2) {
            assert!((node - i as f32 / 16.0).abs() < 1e-6, "{w}: {node} at {i}");
        }
    }
}

#[test]
fn a_node_has_the_value_of_its_place() {
    // A part of the nodes, too, and nodes at the rim, which repeat the outermost texels.
    let rough = map_of(150, 90, |x, y| (x * 37 + y * 101) as f32 % 17.0 / 16.0);
    for cells in [[16, 32], [160, 96], [320, 80]] {
        for (first, count) in [([0, 0], cells.map(|n| n + 1)), ([5, 7], [cells[0] - 5, 9])] {
            let nodes = at_nodes(&rough, cells, first, count);
            for (n, value) in nodes.iter().enumerate() {
                let node = [first[0] + n % count[0], first[1] + n / count[0]];
                let uv = [0, 1].map(|axis| node[axis] as f64 / cells[axis] as f64);
                assert!((value - at_point(&rough, cells, uv)).abs() < 1e-6, "{cells:?} {node:?}");
            }
        }
    }
}
