//! Metrics on the coarser levels (method §3), and rest lengths on all of them: exact chords on level 0 (method §2), arc
//! lengths on the others.

use glam::{DVec2, DVec3};

use super::blocks::{Block, NODES, Plane, SIDE, slot};
use super::codes::Lengths;
use super::window::{self, WINDOW_NODES, Window, place};
use super::{EDGES, FLOOR_FRACTION, Grid, Level};
use crate::mesh::triangle::barycentrics;
use crate::mesh::{Mesh, NONE, TileMesh};

/// For each node of level 1, the triangles in its dual cell with their fractions of its covered area (method §3).
#[derive(Debug, Default)]
pub struct Gather {
    /// Per block and slot, the index of its first entry; one more at the end.
    starts: Vec<u32>,
    /// (triangle, fraction).
    entries: Vec<(u32, f32)>,
}

/// Area of a dual cell of level 1, in cells of level 0.
const DUAL_AREA: f64 = 4.0;

impl Gather {
    /// Clips the triangles to the dual cells of level 1. Also returns that level's coverage, per block.
    pub(super) fn new(tile: &TileMesh, nx: usize, ny: usize, level: &Level) -> (Gather, Vec<Plane>) {
        let cells = DVec2::new(nx as f64, ny as f64);
        // (node, triangle, area of the triangle in the node's dual cell).
        let mut pieces: Vec<(u32, u32, f32)> = Vec::new();
        for (c, chart) in tile.charts.iter().enumerate() {
            if level.blocks.of_chart[c].is_empty() {
                continue;
            }
            for t in chart.triangles.clone() {
                let corners = tile.triangles[t].uv.map(|uv| uv * cells);
                each_dual_cell(corners, level.nx, level.ny, |i, j| {
                    let b = level.blocks.find(c as u32, i as i64 / SIDE as i64, j as i64 / SIDE as i64);
                    if b != NONE {
                        let area = area_in_box(corners, 2.0 * DVec2::new(i as f64, j as f64) - 1.0);
                        if area > 0.0 {
                            let node = b * NODES as u32 + slot(i % SIDE, j % SIDE) as u32;
                            pieces.push((node, t as u32, area as f32));
                        }
                    }
                });
            }
        }
        pieces.sort_by_key(|p| p.0);
        let nodes = level.blocks.list.len() * NODES;
        let mut starts = vec![0u32; nodes + 1];
        let mut coverage = vec![[0.0f32; NODES]; level.blocks.list.len()];
        let mut entries = Vec::with_capacity(pieces.len());
        let mut remaining = &pieces[..];
        for node in 0..nodes {
            let count = remaining.iter().take_while(|p| p.0 as usize == node).count();
            let (of_node, others) = remaining.split_at(count);
            remaining = others;
            let sum: f32 = of_node.iter().map(|p| p.2).sum();
            coverage[node / NODES][node % NODES] = (sum / DUAL_AREA as f32).min(1.0);
            entries.extend(of_node.iter().map(|p| (p.1, p.2 / sum)));
            starts[node + 1] = entries.len() as u32;
        }
        (Gather { starts, entries }, coverage)
    }

    /// Per node of some blocks, the index of its first entry among those of these blocks (one more at the end), and
    /// these entries.
    #[cfg(feature = "gpu")]
    pub fn of_blocks(&self, blocks: std::ops::Range<usize>) -> (Vec<u32>, &[(u32, f32)]) {
        let starts = &self.starts[blocks.start * NODES..=blocks.end * NODES];
        let (first, end) = (starts[0], starts[starts.len() - 1]);
        (starts.iter().map(|start| start - first).collect(), &self.entries[first as usize..end as usize])
    }

    /// Bytes of the two arrays of `of_blocks`, an entry having 8.
    #[cfg(feature = "gpu")]
    pub fn bytes_of(&self, blocks: std::ops::Range<usize>) -> [u64; 2] {
        let [first, end] = [blocks.start, blocks.end].map(|b| self.starts[b * NODES]);
        [(blocks.len() * NODES + 1) as u64 * 4, u64::from(end - first) * 8]
    }

    /// Bytes held.
    pub fn bytes(&self) -> usize {
        self.starts.len() * 4 + self.entries.len() * 8
    }

    /// Computes the metrics (E, F, G) of one block of level 1, per level-1 cell squared, from those of the triangles
    /// per level-0 cell squared.
    pub fn block(&self, b: usize, triangles: &[[f32; 3]], out: &mut [Plane; 3]) {
        for s in 0..NODES {
            let node = b * NODES + s;
            let mut sum = [0.0f32; 3];
            for &(t, fraction) in &self.entries[self.starts[node] as usize..self.starts[node + 1] as usize] {
                for (x, m) in sum.iter_mut().zip(triangles[t as usize]) {
                    *x += fraction * m;
                }
            }
            for (plane, x) in out.iter_mut().zip(sum) {
                plane[s] = 4.0 * x;
            }
        }
    }
}

/// Calls `f` for each node of level 1 whose dual cell meets the triangle's bounding box.
fn each_dual_cell(corners: [DVec2; 3], nx: usize, ny: usize, mut f: impl FnMut(usize, usize)) {
    let range = |axis: usize, cells: usize| {
        let values = corners.map(|c| c[axis]);
        let low = values.iter().copied().fold(f64::INFINITY, f64::min);
        let high = values.iter().copied().fold(f64::NEG_INFINITY, f64::max);
        let first = ((low + 1.0) * 0.5).floor().max(0.0);
        let last = ((high + 1.0) * 0.5).floor().min(cells as f64);
        (first as usize, if last < first { None } else { Some(last as usize) })
    };
    if let ((i0, Some(i1)), (j0, Some(j1))) = (range(0, nx), range(1, ny)) {
        for j in j0..=j1 {
            for i in i0..=i1 {
                f(i, j);
            }
        }
    }
}

/// Area of a triangle inside the box of side 2 whose lower corner is `low`, by Sutherland-Hodgman clipping.
fn area_in_box(corners: [DVec2; 3], low: DVec2) -> f64 {
    let mut polygon = corners.to_vec();
    let mut clipped = Vec::with_capacity(8);
    for (axis, sign, bound) in
        [(0, 1.0, low.x), (0, -1.0, -low.x - 2.0), (1, 1.0, low.y), (1, -1.0, -low.y - 2.0)]
    {
        clipped.clear();
        for (k, &b) in polygon.iter().enumerate() {
            let a = polygon[(k + polygon.len() - 1) % polygon.len()];
            let (da, db) = (sign * a[axis] - bound, sign * b[axis] - bound);
            if (da < 0.0) != (db < 0.0) {
                clipped.push(a + da / (da - db) * (b - a));
            }
            if db >= 0.0 {
                clipped.push(b);
            }
        }
        std::mem::swap(&mut polygon, &mut clipped);
        if polygon.len() < 3 {
            return 0.0;
        }
    }
    let twice: f64 = (0..polygon.len())
        .map(|k| {
            let (a, b) = (polygon[k], polygon[(k + 1) % polygon.len()]);
            (a - low).perp_dot(b - low)
        })
        .sum();
    0.5 * twice.abs()
}

/// Computes the metrics of one block, per cell squared of this level: the 3x3 Gaussian of the finer level's metrics,
/// weighted by coverage (method §3).
pub fn restrict_block(level: &Level, finer: &Level, fine: &[[Plane; 3]], b: usize, out: &mut [Plane; 3]) {
    *out = [[0.0; NODES]; 3];
    let mut weights = [0.0f32; WINDOW_NODES];
    let mut window = [0.0f32; WINDOW_NODES];
    for (quarter, &child) in level.children[b].iter().enumerate() {
        if child == NONE {
            continue;
        }
        let neighbours = &finer.blocks.neighbours[child as usize];
        window::load(neighbours, 0.0, |b| &finer.coverage[b], &mut weights);
        for (c, plane) in out.iter_mut().enumerate() {
            window::load(neighbours, 0.0, |b| &fine[b][c], &mut window);
            each_coarse_node(quarter, |s, i, j| {
                let (sum, weight) = gaussian(&window, &weights, i, j);
                // Without coverage the sum is 0, too. (A branch is no help: the compiler divides on both sides of it.)
                plane[s] = 4.0 * sum / weight.max(f32::MIN_POSITIVE);
            });
        }
    }
}

/// Coverage of one block: the 3x3 Gaussian of the finer level's.
fn restrict_coverage(level: &Level, finer: &Level, b: usize) -> Plane {
    let mut out = [0.0; NODES];
    let mut window = [0.0f32; WINDOW_NODES];
    for (quarter, &child) in level.children[b].iter().enumerate() {
        if child != NONE {
            window::load(&finer.blocks.neighbours[child as usize], 0.0, |b| &finer.coverage[b], &mut window);
            each_coarse_node(quarter, |s, i, j| out[s] = gaussian(&window, &[1.0; WINDOW_NODES], i, j).0);
        }
    }
    out
}

/// Calls `f(slot, i, j)` for the 8x8 nodes of a quarter of a block; (i, j) is the node's place in the window of the
/// finer level's block that covers the quarter.
fn each_coarse_node(quarter: usize, mut f: impl FnMut(usize, usize, usize)) {
    for j in 0..SIDE / 2 {
        for i in 0..SIDE / 2 {
            f(slot(i + quarter % 2 * 8, j + quarter / 2 * 8), 2 * i + 1, 2 * j + 1);
        }
    }
}

/// Weighted sum of values, and sum of weights, over 3x3 nodes, times the Gaussian's 1/4, 1/2, 1/4 along both axes.
fn gaussian(values: &Window, weights: &Window, i: usize, j: usize) -> (f32, f32) {
    let mut sums = (0.0, 0.0);
    for dj in 0..3 {
        for di in 0..3 {
            let at = place(i + di - 1, j + dj - 1);
            let kernel = [0.25, 0.5, 0.25][di] * [0.25, 0.5, 0.25][dj];
            sums.0 += kernel * weights[at] * values[at];
            sums.1 += kernel * weights[at];
        }
    }
    sums
}

/// Squared length of an offset under the mean of two metrics.
fn length2(a: [f32; 3], b: [f32; 3], d: [f32; 2]) -> f32 {
    let [e, f, g] = [0, 1, 2].map(|k| 0.5 * (a[k] + b[k]));
    d[0] * d[0] * e + 2.0 * d[0] * d[1] * f + d[1] * d[1] * g
}

/// Sets the rest lengths, their floors and the coverages of all levels.
pub(super) fn rest_lengths(grid: &mut Grid, mesh: &Mesh, tile: &TileMesh) {
    let scales: Vec<f64> = grid.rest.charts.iter().map(|c| c.scale).collect();
    let [nx, ny] = [grid.levels[0].nx, grid.levels[0].ny];
    let mut exact: Vec<[Plane; 4]> = Vec::with_capacity(grid.levels[0].blocks.list.len());
    for b in 0..grid.levels[0].blocks.list.len() {
        let scale = scales[grid.levels[0].blocks.list[b].chart as usize];
        exact.push(chords(grid, mesh, tile, DVec2::new(nx as f64, ny as f64), b, scale));
    }
    let medians: Vec<f32> =
        (0..tile.charts.len()).map(|c| median_length(&grid.levels[0], &exact, c)).collect();
    let triangle = grid.pose_triangles(tile, &grid.rest);
    let triangles: Vec<[f32; 3]> = (0..grid.triangles.len()).map(|t| triangle(t).metric()).collect();
    drop(triangle);
    let mut metrics: Vec<[Plane; 3]> = Vec::new();
    for k in 0..grid.levels.len() {
        // An edge of level k is 2^k times as long.
        grid.levels[k].floor = medians.iter().map(|m| FLOOR_FRACTION * m * (1u32 << k) as f32).collect();
        if k == 0 {
            store_lengths(&mut grid.levels[0], &exact);
            exact.clear();
            continue;
        }
        let (finer, level) = grid.levels.split_at_mut(k);
        let (finer, level) = (&finer[k - 1], &mut level[0]);
        let mut next = vec![[[0.0; NODES]; 3]; level.blocks.list.len()];
        if k > 1 {
            level.coverage =
                (0..level.blocks.list.len()).map(|b| restrict_coverage(level, finer, b)).collect();
        }
        for (b, out) in next.iter_mut().enumerate() {
            match k {
                1 => grid.gather.block(b, &triangles, out),
                _ => restrict_block(level, finer, &metrics, b, out),
            }
        }
        metrics = next;
        let lengths: Vec<_> = level.blocks.neighbours.iter().map(|b| arc_lengths(b, &metrics)).collect();
        store_lengths(level, &lengths);
    }
}

/// Lengths of at most this fraction of the floor are stored as 0.
const SHORTEST: f32 = 1.0 / 1024.0;

/// Stores a level's rest lengths as codes.
fn store_lengths(level: &mut Level, lengths: &[[Plane; 4]]) {
    for (chart, range) in level.blocks.of_chart.iter().enumerate() {
        let least = level.floor[chart] * SHORTEST;
        for e in 0..4 {
            let all = || lengths[range.clone()].iter().flat_map(|planes| planes[e]);
            let low = all().filter(|&x| x > least).fold(f32::INFINITY, f32::min);
            let codes = Lengths::between(low, all().fold(0.0, f32::max));
            level.lengths[chart][e] = codes;
            for b in range.clone() {
                level.rest_length[b][e] = lengths[b][e].map(|length| codes.code(length));
            }
        }
    }
}

/// Rest lengths of a block's edges on a coarser level.
fn arc_lengths(neighbours: &[u32; 9], metrics: &[[Plane; 3]]) -> [Plane; 4] {
    let mut windows = [[0.0f32; WINDOW_NODES]; 3];
    for (c, window) in windows.iter_mut().enumerate() {
        window::load(neighbours, 0.0, |b| &metrics[b][c], window);
    }
    let metric = |at: usize| windows.each_ref().map(|w| w[at]);
    edges(|i, j, (di, dj)| {
        let other = place((i as i64 + 1 + di) as usize, (j as i64 + 1 + dj) as usize);
        length2(metric(place(i + 1, j + 1)), metric(other), [di as f32, dj as f32]).max(0.0).sqrt()
    })
}

/// The values of `f(i, j, offset)` at all edges that the nodes (i, j) of a block own.
fn edges(f: impl Fn(usize, usize, (i64, i64)) -> f32) -> [Plane; 4] {
    std::array::from_fn(|e| {
        let mut plane = [0.0; NODES];
        for j in 0..SIDE {
            for i in 0..SIDE {
                plane[slot(i, j)] = f(i, j, EDGES[e]);
            }
        }
        plane
    })
}

/// Exact rest lengths of a block's edges on level 0 (method §2), in f64 from the mesh itself; inside one triangle from
/// its edge vectors.
fn chords(grid: &Grid, mesh: &Mesh, tile: &TileMesh, cells: DVec2, b: usize, scale: f64) -> [Plane; 4] {
    let level = &grid.levels[0];
    let Block { x, y, chart, .. } = level.blocks.list[b];
    let mut triangles = [NONE; WINDOW_NODES];
    window::load(&level.blocks.neighbours[b], NONE, |b| &grid.triangle[b], &mut triangles);
    let vertices = &tile.charts[chart as usize].vertices;
    // At a node: its triangle, the triangle's first vertex, the position relative to it, and the map from an offset in
    // the plane to one in space.
    let sample = |i: usize, j: usize| {
        let t = triangles[place(i, j)];
        if t == NONE || grid.chart_of[t as usize] != chart {
            return None;
        }
        let source = &tile.triangles[t as usize];
        let [a, b, c] = source.uv.map(|uv| uv * cells);
        let [p, q, r] = source.local.map(|v| DVec3::from(mesh.rest[vertices[v as usize] as usize]));
        let in_space = move |d: DVec2| {
            let [l1, l2] = barycentrics([DVec2::ZERO, b - a, c - a], d);
            l1 * (q - p) + l2 * (r - p)
        };
        let node = DVec2::new((x as usize * SIDE + i) as f64, (y as usize * SIDE + j) as f64) - 1.0;
        Some((t, p, in_space(node - a), in_space))
    };
    // Scaled before it is squared: units of 1e300 must not overflow.
    let length = |v: DVec3| (v * scale).length();
    edges(|i, j, (di, dj)| {
        let other = ((i as i64 + 1 + di) as usize, (j as i64 + 1 + dj) as usize);
        let chord = match (sample(i + 1, j + 1), sample(other.0, other.1)) {
            (Some((s, _, _, in_space)), Some((t, ..))) if s == t => {
                length(in_space(DVec2::new(di as f64, dj as f64)))
            }
            (Some((_, p, v, _)), Some((_, q, w, _))) => length((q - p) + (w - v)),
            // An end without a triangle of the chart: no movable node has this edge.
            _ => 0.0,
        };
        chord as f32
    })
}

/// The smaller one of two medians over a chart's movable nodes: that of the lengths of their edges to the east, and
/// that of their edges to the north. On an anisotropic chart the larger one would exceed all lengths of the other
/// direction.
fn median_length(level: &Level, exact: &[[Plane; 4]], chart: usize) -> f32 {
    let median = |edge: usize| {
        let mut lengths: Vec<f32> = Vec::new();
        for b in level.blocks.of_chart[chart].clone() {
            let movable = level.movable[b].iter().zip(&exact[b][edge]).filter(|(m, _)| **m != 0);
            lengths.extend(movable.map(|(_, length)| length));
        }
        let middle = lengths.len() / 2;
        if lengths.is_empty() { 0.0 } else { *lengths.select_nth_unstable_by(middle, f32::total_cmp).1 }
    };
    median(0).min(median(1))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn clipped_areas_add_up_to_the_triangle() {
        let corners = [[1.3, 2.1], [9.7, 3.2], [4.4, 11.9]].map(DVec2::from);
        let mut sum = 0.0;
        each_dual_cell(corners, 10, 10, |i, j| {
            sum += area_in_box(corners, 2.0 * DVec2::new(i as f64, j as f64) - 1.0);
        });
        let exact: f64 = 0.5 * (8.4 * 9.8 - 1.1 * 3.1);
        assert!((sum - exact).abs() < 1e-9, "{sum} {exact}");
        let half_square = |side: f64| [DVec2::ZERO, side * DVec2::X, side * DVec2::Y];
        assert_eq!(area_in_box(half_square(20.0), DVec2::splat(1.0)), 4.0);
        assert_eq!(area_in_box(half_square(1.0), DVec2::splat(5.0)), 0.0);
    }
}
