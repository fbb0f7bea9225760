//! Finds the nodes that must be fixed, from the faces alone: those without all four cells inside one chart (method §1).
//! The library may fix more nodes, never fewer.

use std::collections::HashMap;

use vrtm_testkit::Model;

/// Distance in cells from a border or a grid line under which a point counts as on it: the rounding of f32 UVs on a
/// grid of 1024.
const SLACK: f64 = 1e-4;

/// Distance in cells from a grid line up to which a border along it counts as on it (method §1).
const OFF_LINE: f64 = 1e-3;

/// True for an edge along a grid line: it is on the line, if it is the border of a chart.
fn is_along_a_line([a, b]: [[f64; 2]; 2]) -> bool {
    let near = |x: f64, y: f64| {
        x.round() == y.round() && (x - x.round()).abs().max((y - y.round()).abs()) <= OFF_LINE
    };
    near(a[0], b[0]) || near(a[1], b[1])
}

/// True for each node of a tile's n by n grid that must be fixed.
pub fn fixed_nodes(model: &Model, udim: u32, n: usize) -> Vec<bool> {
    let width = n + 1;
    let origin = [(udim - 1001) % 10, (udim - 1001) / 10].map(f64::from);
    let in_cells = |uv: [f32; 2]| [0, 1].map(|k| (f64::from(uv[k]) - origin[k]) * n as f64);
    let mut layers = vec![0u8; width * width];
    let mut edges: HashMap<_, (u32, [[f64; 2]; 2])> = HashMap::new();
    for face in model.faces() {
        let uv = |c: usize| model.uvs[model.uv_indices[c] as usize];
        let centre =
            [0, 1].map(|k| face.clone().map(|c| f64::from(uv(c)[k])).sum::<f64>() / face.len() as f64);
        if [0, 1].iter().any(|&k| centre[k].floor() != origin[k]) {
            continue;
        }
        let polygon: Vec<[f64; 2]> = face.clone().map(|c| in_cells(uv(c))).collect();
        cover(&polygon, width, &mut layers);
        for k in 0..polygon.len() {
            let next = (k + 1) % polygon.len();
            // Corners with the same rest position and the same UV are one corner.
            let key = |k: usize| {
                let c = face.start + k;
                (model.rest[model.indices[c] as usize].map(|x| (x + 0.0).to_bits()), uv(c).map(f32::to_bits))
            };
            let (a, b) = (key(k), key(next));
            let edge = edges.entry((a.min(b), a.max(b))).or_insert((0, [polygon[k], polygon[next]]));
            edge.0 += 1;
        }
    }
    let mut cells = vec![false; n * n];
    for (_, [a, b]) in edges.values().filter(|(count, ends)| *count == 1 && !is_along_a_line(*ends)) {
        cross(*a, *b, n, &mut cells);
    }
    let at = |i: usize, j: usize| layers[j * width + i];
    let free = |i: usize, j: usize| {
        // The corners of the cells (i-1..=i, j-1..=j) lie in one layer, and no border crosses these cells.
        let corners = (0..9).all(|k| at(i + k % 3 - 1, j + k / 3 - 1) == 1);
        corners && (0..4).all(|k| !cells[(j - k / 2) * n + i - k % 2])
    };
    let inside = |k: usize| (1..n).contains(&k);
    (0..width * width)
        .map(|k| (k % width, k / width))
        .map(|(i, j)| !(inside(i) && inside(j) && free(i, j)))
        .collect()
}

/// Counts a layer at the nodes inside a polygon. Nodes within the slack of its edges, beyond which there may or may not
/// be a neighbour, count as in one layer.
fn cover(polygon: &[[f64; 2]], width: usize, layers: &mut [u8]) {
    let span = |axis: usize| {
        let low = polygon.iter().fold(f64::INFINITY, |m, p| m.min(p[axis]));
        let high = polygon.iter().fold(f64::NEG_INFINITY, |m, p| m.max(p[axis]));
        (low - 1.0).max(0.0) as usize..((high + 2.0).max(0.0) as usize).min(width)
    };
    for j in span(1) {
        for i in span(0) {
            let p = [i as f64, j as f64];
            let layer = &mut layers[j * width + i];
            if polygon.iter().enumerate().any(|(k, a)| near(*a, polygon[(k + 1) % polygon.len()], p)) {
                *layer = (*layer).max(1);
            } else if contains(polygon, p) {
                *layer += 1;
            }
        }
    }
}

fn near(a: [f64; 2], b: [f64; 2], p: [f64; 2]) -> bool {
    let (d, q) = ([b[0] - a[0], b[1] - a[1]], [p[0] - a[0], p[1] - a[1]]);
    let along = ((d[0] * q[0] + d[1] * q[1]) / (d[0] * d[0] + d[1] * d[1]).max(1e-30)).clamp(0.0, 1.0);
    let slack = if is_along_a_line([a, b]) { 1.5 * OFF_LINE } else { SLACK };
    (q[0] - along * d[0]).hypot(q[1] - along * d[1]) < slack
}

/// True if the point is inside, by the number of edges that a ray toward +x crosses.
fn contains(polygon: &[[f64; 2]], p: [f64; 2]) -> bool {
    let crossed = |k: usize| {
        let (a, b) = (polygon[k], polygon[(k + 1) % polygon.len()]);
        (a[1] > p[1]) != (b[1] > p[1]) && p[0] < a[0] + (b[0] - a[0]) * (p[1] - a[1]) / (b[1] - a[1])
    };
    (0..polygon.len()).filter(|&k| crossed(k)).count() % 2 == 1
}

/// Marks the cells whose interior a segment crosses, by points along the segment.
fn cross(a: [f64; 2], b: [f64; 2], n: usize, cells: &mut [bool]) {
    let steps = ((b[0] - a[0]).hypot(b[1] - a[1]) * 50.0).ceil().max(1.0);
    for k in 0..=steps as usize {
        let p = [0, 1].map(|c| a[c] + (b[c] - a[c]) * k as f64 / steps);
        let inside = |x: f64| x > 0.0 && x < n as f64 && (x - x.round()).abs() > SLACK;
        if inside(p[0]) && inside(p[1]) {
            cells[p[1] as usize * n + p[0] as usize] = true;
        }
    }
}
