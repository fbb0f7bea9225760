//! The density ρ of rigid material around the nodes of level 0 (method §4), computed from their rigidity. With the
//! heuristic of the paper's figure 5, the weight of orientation depends on it.

use super::coverage::NodeMaps;
use crate::allocation::Vec;

/// The tile's longer side divided by the width of a box filter that is applied to the rigidity twice. Both passes
/// together are a tent filter over half of the tile: the density should depend on whether features are far apart, not
/// on whether a node lies in one.
const SIDE_PER_BOX: usize = 4;

/// Mean rigidity around each node, 0..1, row by row from v = 0, under a tent half as wide as the tile's longer side and
/// cut off at the tile's rim.
pub fn density(maps: &NodeMaps) -> Vec<f32> {
    let radius = (maps.nx.max(maps.ny) / SIDE_PER_BOX / 2).max(1);
    let (columns, rows) = (maps.nx + 1, maps.ny + 1);
    let mut values: Vec<f64> = maps.rigidity.iter().map(|&r| f64::from(r)).collect();
    for _ in 0..2 {
        for row in values.chunks_exact_mut(columns) {
            let line = means(row, radius);
            row.copy_from_slice(&line);
        }
        for i in 0..columns {
            let column: Vec<f64> = (0..rows).map(|j| values[j * columns + i]).collect();
            for (j, mean) in means(&column, radius).into_iter().enumerate() {
                values[j * columns + i] = mean;
            }
        }
    }
    values.into_iter().map(|x| x as f32).collect()
}

/// For each value, the mean of it and of up to `radius` values on either side.
fn means(line: &[f64], radius: usize) -> Vec<f64> {
    let sums: Vec<f64> = std::iter::once(0.0)
        .chain(line.iter().scan(0.0, |sum, x| {
            *sum += x;
            Some(*sum)
        }))
        .collect();
    (0..line.len())
        .map(|k| {
            let (first, end) = (k.saturating_sub(radius), (k + radius + 1).min(line.len()));
            (sums[end] - sums[first]) / (end - first) as f64
        })
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;

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
}
