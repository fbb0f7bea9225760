//! Metrics and coverage on the coarser levels (method §3), each level from the next finer one.

use super::Level;
use super::window::{self, WINDOW_NODES, Window, place};
use crate::grid::planes::{NODES, Plane, SIDE, slot};
use crate::mesh::NONE;

/// Computes the metrics of one block, per squared cell of this level, by the 3x3 Gaussian of the finer level's metrics,
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
                // Without coverage the sum is 0 as well. (A branch would not help: the compiler divides on both sides
                // of it.)
                plane[s] = 4.0 * sum / weight.max(f32::MIN_POSITIVE);
            });
        }
    }
}

/// Coverage of one block: the 3x3 Gaussian of the finer level's coverage.
pub fn restrict_coverage(level: &Level, finer: &Level, b: usize) -> Plane {
    let mut out = [0.0; NODES];
    for (quarter, &child) in level.children[b].iter().enumerate() {
        if child != NONE {
            let window = window::of(&finer.blocks.neighbours[child as usize], 0.0, |b| &finer.coverage[b]);
            each_coarse_node(quarter, |s, i, j| out[s] = gaussian(&window, &[1.0; WINDOW_NODES], i, j).0);
        }
    }
    out
}

/// Calls `f(slot, i, j)` for the 8x8 nodes of a quarter of a block; (i, j) is the node's position in the window of the
/// finer level's block that covers the quarter.
fn each_coarse_node(quarter: usize, mut f: impl FnMut(usize, usize, usize)) {
    for j in 0..SIDE / 2 {
        for i in 0..SIDE / 2 {
            f(slot(i + quarter % 2 * 8, j + quarter / 2 * 8), 2 * i + 1, 2 * j + 1);
        }
    }
}

/// The weighted sum of the values at 3x3 nodes, and the sum of the weights. Both are multiplied by the Gaussian's 1/4,
/// 1/2, 1/4 along both axes.
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
