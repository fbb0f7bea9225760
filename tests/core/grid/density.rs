use vrtm_core::allocation::Vec;
use vrtm_core::grid::coverage::NodeMaps;
use vrtm_core::grid::density::*;

fn of(nx: usize, ny: usize, rigidity: impl Fn(usize, usize) -> f32) -> Vec<f32> {
    let rigidity = (0..(nx + 1) * (ny + 1)).map(|k| rigidity(k % (nx + 1), k / (nx + 1))).collect();
    density(&NodeMaps { nx, ny, rigidity, ..NodeMaps::default() })
}

#[test]
fn it_is_a_mean_over_a_tent() {
    assert!(of(64, 32, |_, _| 0.5).iter().all(|&x| (x - 0.5).abs() < 1e-6));
    // A single line, filtered twice with a box of 8 + 1 + 8 nodes.
    let line = of(64, 64, |i, _| if i == 30 { 1.0 } else { 0.0 });
    for (i, weight) in [(30, 17.0), (31, 16.0), (46, 1.0), (47, 0.0), (14, 1.0)] {
        assert!((line[65 * 20 + i] - weight / 289.0f32).abs() < 1e-6, "{i}: {}", line[65 * 20 + i]);
    }
    // Stripes over half of the surface, narrower than the box.
    let stripes = of(256, 256, |i, _| if i % 4 < 2 { 1.0 } else { 0.0 });
    assert!((stripes[257 * 128 + 128] - 0.5).abs() < 0.06);
}
