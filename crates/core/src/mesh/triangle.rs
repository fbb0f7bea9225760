//! Triangles in the UV plane: areas, barycentric coordinates, and the triangulation of polygons (method §1).

use glam::DVec2;

use crate::allocation::Vec;

/// Twice the signed area of a triangle.
pub fn doubled_area([a, b, c]: [DVec2; 3]) -> f64 {
    (b - a).perp_dot(c - a)
}

/// Barycentric coordinates of corners 1 and 2 at the point `at`.
pub fn barycentrics([a, b, c]: [DVec2; 3], at: DVec2) -> [f64; 2] {
    let (e1, e2, d) = (b - a, c - a, at - a);
    let det = e1.perp_dot(e2);
    [d.perp_dot(e2) / det, e1.perp_dot(d) / det]
}

/// The point of a triangle with barycentric coordinates of corners 1 and 2.
pub fn point([a, b, c]: [DVec2; 3], [s, t]: [f64; 2]) -> DVec2 {
    a + s * (b - a) + t * (c - a)
}

/// True for a triangle without area, or so thin that f32 UVs do not determine on which side of an edge the third corner
/// lies.
pub fn is_degenerate(uv: [DVec2; 3]) -> bool {
    let length2 = |a: usize, b: usize| uv[a].distance_squared(uv[b]);
    let longest2 = length2(0, 1).max(length2(1, 2)).max(length2(2, 0));
    doubled_area(uv).abs() <= 1e-7 * longest2
}

/// Triangulates a polygon by ear clipping; a convex one becomes the fan around its first corner.
pub fn triangulate(uv: &[DVec2]) -> Vec<[usize; 3]> {
    let n = uv.len();
    let area: f64 = (1..n - 1).map(|k| doubled_area([uv[0], uv[k], uv[k + 1]])).sum();
    let sign = if area < 0.0 { -1.0 } else { 1.0 };
    let mut open: Vec<usize> = (0..n).collect();
    let mut triangles = Vec::with_capacity(n - 2);
    while open.len() > 3 {
        let m = open.len();
        let is_ear = |k: usize| {
            let [a, b, c] = [open[(k + m - 1) % m], open[k], open[(k + 1) % m]];
            let inside = |p: DVec2| {
                [(a, b), (b, c), (c, a)].iter().all(|&(i, j)| sign * doubled_area([uv[i], uv[j], p]) >= 0.0)
            };
            sign * doubled_area([uv[a], uv[b], uv[c]]) > 0.0
                // Points equal to a corner are skipped: a polygon with holes has bridges, whose points occur twice.
                && !open.iter().any(|&p| ![uv[a], uv[b], uv[c]].contains(&uv[p]) && inside(uv[p]))
        };
        // The search begins at 1, which yields the fan. A polygon without an ear has almost no area: any corner will
        // do.
        let ear = (1..m).chain([0]).find(|&k| is_ear(k)).unwrap_or(1);
        triangles.push([open[(ear + m - 1) % m], open[ear], open[(ear + 1) % m]]);
        open.remove(ear);
    }
    triangles.push([open[0], open[1], open[2]]);
    triangles
}
