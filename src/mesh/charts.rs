//! The charts of a tile (method §1), from its triangles: which of them are neighbours in the UV plane, and the
//! connected components of this relation.

use super::triangle::doubled_area;
use super::{Chart, NONE, RawTriangle, TileMesh, Triangle};

/// Builds a tile from its triangles, which it sorts by chart. Also returns the chart of each triangle, in the order of
/// `raw`.
///
/// Two triangles are neighbours if they, and no third one, share a UV edge and lie on opposite sides of it: where a
/// mirrored half is folded onto the other one, or where three triangles meet, there is a border.
pub(super) fn build(udim: u32, raw: &[RawTriangle]) -> (TileMesh, Vec<u32>) {
    let neighbours = neighbours(raw);
    let chart_of = components(&neighbours);
    let chart_count = chart_of.iter().max().map_or(0, |&c| c + 1) as usize;
    // A stable sort keeps the order of faces inside a chart.
    let mut order: Vec<u32> = (0..raw.len() as u32).collect();
    order.sort_by_key(|&t| chart_of[t as usize]);
    let mut new_index = vec![NONE; raw.len()];
    for (new, &old) in order.iter().enumerate() {
        new_index[old as usize] = new as u32;
    }
    let mut charts = Vec::with_capacity(chart_count);
    let mut triangles = Vec::with_capacity(raw.len());
    let mut remaining = &order[..];
    for chart in 0..chart_count as u32 {
        let count = remaining.partition_point(|&t| chart_of[t as usize] == chart);
        let (members, others) = remaining.split_at(count);
        remaining = others;
        let mut vertices: Vec<u32> = members.iter().flat_map(|&t| raw[t as usize].vertices).collect();
        vertices.sort_unstable();
        vertices.dedup();
        let start = triangles.len();
        for &t in members {
            let source = &raw[t as usize];
            triangles.push(Triangle {
                local: source.vertices.map(|v| vertices.partition_point(|&w| w < v) as u32),
                uv: source.uv,
                neighbours: neighbours[t as usize]
                    .map(|n| if n == NONE { NONE } else { new_index[n as usize] }),
            });
        }
        charts.push(Chart { triangles: start..triangles.len(), vertices });
    }
    (TileMesh { udim, triangles, charts }, chart_of)
}

/// Per triangle, its neighbour across the edge opposite to each corner.
fn neighbours(raw: &[RawTriangle]) -> Vec<[u32; 3]> {
    // (edge as a sorted pair of UV corners, triangle, its corner opposite to the edge), sorted, so that the triangles
    // at an edge are adjacent.
    let mut edges: Vec<(u32, u32, u32, u8)> = Vec::with_capacity(raw.len() * 3);
    for (t, triangle) in raw.iter().enumerate() {
        for k in 0..3 {
            let (a, b) = (triangle.welded[(k + 1) % 3], triangle.welded[(k + 2) % 3]);
            edges.push((a.min(b), a.max(b), t as u32, k as u8));
        }
    }
    edges.sort_unstable();
    let mut neighbours = vec![[NONE; 3]; raw.len()];
    for at_edge in edges.chunk_by(|x, y| (x.0, x.1) == (y.0, y.1)) {
        if let [(_, _, t, k), (_, _, s, j)] = *at_edge
            && side(&raw[t as usize], k) * side(&raw[s as usize], j) < 0.0
        {
            neighbours[t as usize][k as usize] = s;
            neighbours[s as usize][j as usize] = t;
        }
    }
    neighbours
}

/// The side, 1 or -1, on which a triangle's corner `k` lies of the opposite edge, taken from its lower to its higher UV
/// corner.
fn side(triangle: &RawTriangle, k: u8) -> f64 {
    let k = k as usize;
    let (mut a, mut b) = ((k + 1) % 3, (k + 2) % 3);
    if triangle.welded[a] > triangle.welded[b] {
        (a, b) = (b, a);
    }
    doubled_area([a, b, k].map(|i| triangle.uv[i])).signum()
}

/// Per triangle, the number of its connected component. Components are numbered in the order of their first triangles.
fn components(neighbours: &[[u32; 3]]) -> Vec<u32> {
    let mut component = vec![NONE; neighbours.len()];
    let mut count = 0;
    let mut stack = Vec::new();
    for seed in 0..neighbours.len() {
        if component[seed] != NONE {
            continue;
        }
        component[seed] = count;
        stack.push(seed as u32);
        while let Some(t) = stack.pop() {
            for &n in neighbours[t as usize].iter().filter(|&&n| n != NONE) {
                if component[n as usize] == NONE {
                    component[n as usize] = count;
                    stack.push(n);
                }
            }
        }
        count += 1;
    }
    component
}
