//! The borders of charts that a model has whatever the library makes of it, and the nodes that they hold. The warp is
//! the identity in each cell that a border crosses, and on each edge of the grid that a border runs along; since it is
//! one-to-one, nothing crosses a border then.

use std::collections::{HashMap, HashSet};

use vrtm::WeldBy;

use super::build::{Model, edges};
use super::recipe::Recipe;

/// A cell counts as crossed if a border comes this far into it: UVs are f32, and welded ones are moved onto each other.
const SLACK: f64 = 1e-3;

/// The edges without a neighbour on the other side for certain, of the faces that `is_solid` says are kept.
pub fn borders(
    recipe: &Recipe,
    model: &Model,
    pose: &[[f64; 3]],
    is_solid: impl Fn(&[u32]) -> bool,
) -> Vec<(usize, [u32; 2])> {
    let by_position = recipe.joints.weld == WeldBy::Position;
    let sorted = |[a, b]: [u32; 2]| [a.min(b), a.max(b)];
    let name = |v: u32| if by_position { model.original[v as usize] } else { v };
    let seams: HashSet<[u32; 2]> = model.seams.iter().map(|&seam| sorted(seam)).collect();
    let textured = || model.faces.iter().enumerate().filter(|(f, _)| model.textured[*f]);
    let mut at_edge: HashMap<[u32; 2], Vec<[u32; 2]>> = HashMap::new();
    for (_, face) in textured() {
        for edge in edges(face) {
            at_edge.entry(sorted(edge.map(name))).or_default().push(edge);
        }
    }
    // A hundred times the tolerance, and the rounding of positions: it is torn, however that is counted.
    let span = |c: usize| {
        let all = || model.rest.iter().map(|p| p[c]);
        all().fold(f64::NEG_INFINITY, f64::max) - all().fold(f64::INFINITY, f64::min)
    };
    let largest = |points: &[[f64; 3]]| points.iter().flatten().fold(0.0, |m: f64, x| m.max(x.abs()));
    let rounding = f64::from(f32::EPSILON);
    let extent = (0..3).map(span).fold(0.0, f64::max);
    let torn = 100.0 * (1e-5 * extent + rounding * (largest(&model.rest) + largest(pose)));
    let apart = |v: u32, w: u32| (0..3).any(|c| (pose[v as usize][c] - pose[w as usize][c]).abs() > torn);
    let is_border = |edge: [u32; 2]| match at_edge[&sorted(edge.map(name))].as_slice() {
        [_] => true,
        [a, b] => {
            let vertices = |v: u32| [a, b].map(|side| side.iter().copied().find(|&w| name(w) == name(v)));
            let is_torn = |v: u32| matches!(vertices(v), [Some(v), Some(w)] if v != w && apart(v, w));
            seams.contains(&sorted(edge)) || edge.into_iter().any(is_torn)
        }
        _ => seams.contains(&sorted(edge)),
    };
    textured()
        .filter(|(_, face)| is_solid(face))
        .flat_map(|(f, face)| edges(face).map(move |edge| (f, edge)))
        .filter(|(_, edge)| is_border(*edge))
        .collect()
}

/// Marks the nodes that a border from `p` to `q` (in cells) holds.
pub fn hold([p, q]: [[f64; 2]; 2], n: [usize; 2], held: &mut [bool]) {
    let width = n[0] + 1;
    let low = [0, 1].map(|c| p[c].min(q[c]).floor().max(0.0));
    let high = [0, 1].map(|c| p[c].max(q[c]).ceil().min(n[c] as f64));
    if (0..2).any(|c| low[c] > high[c]) {
        return;
    }
    let span = |c: usize| low[c] as usize..high[c] as usize;
    for j in span(1) {
        for i in span(0) {
            if comes_into([p, q], [i as f64, j as f64]) {
                for (di, dj) in [(0, 0), (1, 0), (0, 1), (1, 1)] {
                    held[(j + dj) * width + i + di] = true;
                }
            }
        }
    }
    for (along, line) in [(0, 1), (1, 0)] {
        let at = p[line];
        if at != q[line] || at.fract() != 0.0 || !(0.0..=n[line] as f64).contains(&at) {
            continue;
        }
        for k in span(along) {
            let part = p[along].max(q[along]).min(k as f64 + 1.0) - p[along].min(q[along]).max(k as f64);
            if part > SLACK {
                for k in [k, k + 1] {
                    let node = if along == 0 { [k, at as usize] } else { [at as usize, k] };
                    held[node[1] * width + node[0]] = true;
                }
            }
        }
    }
}

/// True if the way from `p` to `q` crosses the middle of a cell (clipping after Liang and Barsky).
fn comes_into([p, q]: [[f64; 2]; 2], cell: [f64; 2]) -> bool {
    let (mut from, mut to) = (0.0f64, 1.0f64);
    for c in 0..2 {
        let (d, low, high) = (q[c] - p[c], cell[c] + SLACK, cell[c] + 1.0 - SLACK);
        if d == 0.0 {
            if p[c] <= low || p[c] >= high {
                return false;
            }
            continue;
        }
        let (a, b) = ((low - p[c]) / d, (high - p[c]) / d);
        (from, to) = (from.max(a.min(b)), to.min(a.max(b)));
    }
    from < to
}
