//! A map's values at the nodes of a grid (method §1).

use std::ops::Range;

use super::map::{Line, Map};
use crate::allocation::Vec;

/// A map with the texels that each node of a grid averages: a box of one cell around the node where the map is finer
/// than the grid, and else a bilinear filter between texel centres. They are found once, for rows and columns.
pub struct Resampled<'a> {
    map: &'a Map,
    axes: [Axis; 2],
}

/// The texels that nodes average along one axis.
struct Axis {
    /// Per node, where its taps begin, followed by their number.
    starts: Vec<u32>,
    /// Texels, inside of the map, and their weights.
    taps: Vec<(u32, f32)>,
}

impl Axis {
    fn new(texels: usize, cells: usize) -> Axis {
        let mut axis = Axis { starts: Vec::with_capacity(cells + 2), taps: Vec::new() };
        for node in 0..=cells {
            axis.starts.push(axis.taps.len() as u32);
            let of_node = Taps::new(texels, cells, node as f64);
            axis.taps.extend(of_node.each().map(|(texel, weight)| (clamp(texel, texels) as u32, weight)));
        }
        axis.starts.push(axis.taps.len() as u32);
        axis
    }

    fn of(&self, node: usize) -> &[(u32, f32)] {
        &self.taps[self.starts[node] as usize..self.starts[node + 1] as usize]
    }

    /// The texels that some nodes average, from the first to the last one.
    fn texels(&self, nodes: Range<usize>) -> Range<usize> {
        let taps = &self.taps[self.starts[nodes.start] as usize..self.starts[nodes.end] as usize];
        taps.first().map_or(0, |tap| tap.0 as usize)..taps.last().map_or(0, |tap| tap.0 as usize + 1)
    }
}

impl<'a> Resampled<'a> {
    pub fn new(map: &'a Map, cells: [usize; 2]) -> Resampled<'a> {
        Resampled { map, axes: [0, 1].map(|axis| Axis::new(map.shape().0[axis], cells[axis])) }
    }

    /// Calls `put(i, j, value)` for first[0]..first[0] + count[0] along u, and likewise along v; (i, j) are counted
    /// from `first`.
    pub fn at_nodes(&self, first: [usize; 2], count: [usize; 2], mut put: impl FnMut(usize, usize, f32)) {
        if count.contains(&0) {
            return;
        }
        let [columns, rows] = &self.axes;
        let texels = columns.texels(first[0]..first[0] + count[0]);
        let width = texels.len();
        // Sums over v, and the last even and odd rows of texels: neighbouring nodes average the same ones.
        let mut lines = Line::new(3 * width, 0.0f32);
        let (sums, kept) = lines.all().split_at_mut(width);
        let mut rows_kept = [usize::MAX; 2];
        for j in 0..count[1] {
            sums.fill(0.0);
            for &(y, weight) in rows.of(first[1] + j) {
                let y = y as usize;
                let row = &mut kept[y % 2 * width..][..width];
                if rows_kept[y % 2] != y {
                    self.map.row(y, texels.start, row);
                    rows_kept[y % 2] = y;
                }
                sums.iter_mut().zip(row).for_each(|(sum, value)| *sum += weight * *value);
            }
            for i in 0..count[0] {
                let weighted = |&(x, weight): &(u32, f32)| weight * sums[x as usize - texels.start];
                let value: f32 = columns.of(first[0] + i).iter().map(weighted).sum();
                put(i, j, value.clamp(0.0, 1.0));
            }
        }
    }
}

/// A map's value at a point, as at a node of a grid that lies there.
pub fn at_point(map: &Map, cells: [usize; 2], uv: [f64; 2]) -> f32 {
    let taps = |axis: usize| Taps::new(map.shape().0[axis], cells[axis], uv[axis] * cells[axis] as f64);
    let (columns, rows) = (taps(0), taps(1));
    let mut sum = 0.0;
    for (y, of_row) in rows.each() {
        for (x, of_column) in columns.each() {
            sum += of_row * of_column * map.value(clamp(x, map.width), clamp(y, map.height));
        }
    }
    sum.clamp(0.0, 1.0)
}

/// The texels along one axis that are averaged for a node's value, with weights that sum to 1. Texels beyond the map
/// repeat its outermost ones.
#[derive(Clone)]
struct Taps {
    texels: Range<i64>,
    /// The box around the node, in texels.
    low: f64,
    high: f64,
}

impl Taps {
    fn new(texels: usize, cells: usize, node: f64) -> Taps {
        let per_cell = texels as f64 / cells as f64;
        let half = 0.5 * per_cell.max(1.0);
        let centre = node * per_cell;
        // A box one texel wide, sampled between texel centres, equals the bilinear filter.
        let (low, high) = (centre - half, centre + half);
        Taps { texels: low.floor() as i64..high.ceil() as i64, low, high }
    }

    /// The contributing texels, as (texel, weight).
    fn each(&self) -> impl Iterator<Item = (i64, f32)> {
        let Taps { texels, low, high } = self.clone();
        let weight = move |texel: i64| {
            ((high.min(texel as f64 + 1.0) - low.max(texel as f64)).max(0.0) / (high - low)) as f32
        };
        texels.map(move |texel| (texel, weight(texel))).filter(|&(_, weight)| weight > 0.0)
    }
}

fn clamp(texel: i64, texels: usize) -> usize {
    texel.clamp(0, texels as i64 - 1) as usize
}
