//! The part of the surface under the brush: triangles that hang together with the one under the mouse, up to a
//! distance in space. Another part of the surface that is as near, such as the other side of a thin wall, does not
//! belong to it.

use std::collections::HashSet;

use crate::model::{Model, cross, dot, length, minus, plus};

/// A triangle under the brush.
#[derive(Clone, Copy, Debug)]
pub struct Part {
    pub triangle: usize,
    /// The part of it that may lie under the brush: least and greatest UV.
    pub low: [f32; 2],
    pub high: [f32; 2],
}

/// The triangles within `radius` of a point of the surface.
pub fn disc(model: &Model, positions: &[[f32; 3]], first: usize, centre: [f32; 3], radius: f32) -> Vec<Part> {
    let mut seen = HashSet::from([first]);
    let mut waiting = vec![first];
    let mut parts = Vec::new();
    while let Some(k) = waiting.pop() {
        let triangle = &model.triangles[k];
        let corners = triangle.vertices.map(|v| positions[v as usize]);
        let weights = closest(centre, corners);
        let nearest = [0, 1, 2].map(|c| (0..3).map(|j| weights[j] * corners[j][c]).sum());
        if length(minus(nearest, centre)) > radius {
            continue;
        }
        parts.push(part(k, triangle.uvs.map(|uv| uv.map(|x| x as f32)), corners, weights, radius));
        for &vertex in &triangle.vertices {
            for &next in model.around(vertex) {
                if seen.insert(next as usize) {
                    waiting.push(next as usize);
                }
            }
        }
    }
    parts
}

/// The UVs of a triangle up to twice the radius from a point of it.
fn part(triangle: usize, uvs: [[f32; 2]; 3], corners: [[f32; 3]; 3], weights: [f32; 3], radius: f32) -> Part {
    let [e, f] = [minus(corners[1], corners[0]), minus(corners[2], corners[0])];
    let (ee, ef, ff) = (dot(e, e), dot(e, f), dot(f, f));
    let det = ee * ff - ef * ef;
    let mut found = Part { triangle, low: [0.0; 2], high: [0.0; 2] };
    for c in 0..2 {
        let values = uvs.map(|uv| uv[c]);
        let ends = [
            values.iter().copied().fold(f32::MAX, f32::min),
            values.iter().copied().fold(f32::MIN, f32::max),
        ];
        // How fast the UV changes along the surface at most.
        let (du, dv) = (values[1] - values[0], values[2] - values[0]);
        let slope = ((du * du * ff - 2.0 * du * dv * ef + dv * dv * ee) / det).max(0.0).sqrt();
        let middle: f32 = (0..3).map(|j| weights[j] * values[j]).sum();
        let reach = 2.0 * radius * slope;
        let reach = if reach.is_finite() { reach } else { 1.0 };
        found.low[c] = ends[0].max(middle - reach);
        found.high[c] = ends[1].min(middle + reach);
    }
    found
}

/// The weights of the corners of a triangle at its point that is closest to another point.
pub fn closest(p: [f32; 3], [a, b, c]: [[f32; 3]; 3]) -> [f32; 3] {
    let n = cross(minus(b, a), minus(c, a));
    let area = dot(n, n);
    if area > 0.0 {
        let side = |from: [f32; 3], to: [f32; 3]| dot(n, cross(minus(to, from), minus(p, from))) / area;
        let w = [side(b, c), side(c, a), side(a, b)];
        if w.iter().all(|&w| w >= 0.0) {
            return w;
        }
    }
    // Otherwise it lies on an edge.
    let on = |from: [f32; 3], to: [f32; 3]| {
        let way = minus(to, from);
        let t = (dot(minus(p, from), way) / dot(way, way).max(f32::MIN_POSITIVE)).clamp(0.0, 1.0);
        (t, length(minus(plus(from, way, t), p)))
    };
    let edges = [(on(a, b), [0, 1]), (on(b, c), [1, 2]), (on(c, a), [2, 0])];
    let nearest = edges.into_iter().min_by(|x, y| x.0.1.total_cmp(&y.0.1)).unwrap_or(edges[0]);
    let ((t, _), [from, to]) = nearest;
    let mut w = [0.0; 3];
    w[from] += 1.0 - t;
    w[to] += t;
    w
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_closest_point_is_inside_on_an_edge_or_a_corner() {
        let triangle = [[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]];
        let near = |p: [f32; 3], expected: [f32; 3]| {
            let w = closest(p, triangle);
            assert!((0..3).all(|k| (w[k] - expected[k]).abs() < 1e-6), "{p:?}: {w:?}");
        };
        near([0.25, 0.25, 3.0], [0.5, 0.25, 0.25]);
        near([0.5, -2.0, 0.0], [0.5, 0.5, 0.0]);
        near([-1.0, -1.0, 1.0], [1.0, 0.0, 0.0]);
        near([1.0, 1.0, 0.0], [0.0, 0.5, 0.5]);
    }

    #[test]
    fn a_disc_hangs_together_and_stays_within_its_radius() {
        let model = Model::scene("mug_to_jug");
        let rest = &model.rest;
        let first = model.triangles.len() / 3;
        let centre = rest[model.triangles[first].vertices[0] as usize];
        let radius = 0.2 * model.radius;
        let parts = disc(&model, rest, first, centre, radius);
        assert!(parts.len() > 3 && parts.len() < model.triangles.len() / 2, "{}", parts.len());
        for part in parts {
            let corners = model.triangles[part.triangle].vertices.map(|v| rest[v as usize]);
            let side = corners.map(|p| length(minus(p, corners[0]))).into_iter().fold(0.0, f32::max);
            assert!(length(minus(corners[0], centre)) <= radius + side);
            assert!((0..2).all(|c| part.low[c] <= part.high[c]));
        }
    }

    #[test]
    fn another_part_that_is_near_in_space_is_left_out() {
        // Two sheets, one closely above the other, that share no vertex.
        let mut model = Model::scene("squash");
        let alone = disc(&model, &model.rest, 0, model.rest[0], 0.3 * model.radius).len();
        let count = model.rest.len() as u32;
        let above: Vec<_> = model.rest.iter().map(|p| [p[0], p[1], p[2] + 1e-4]).collect();
        let mut rest = model.rest.clone();
        rest.extend(above);
        let mut triangles = model.triangles.clone();
        triangles.extend(model.triangles.iter().map(|t| {
            let mut t = *t;
            t.vertices = t.vertices.map(|v| v + count);
            t
        }));
        model.replace_for_test(rest, triangles);
        let rest = &model.rest;
        assert_eq!(disc(&model, rest, 0, rest[0], 0.3 * model.radius).len(), alone);
    }
}
