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
