//! Areas and barycentric coordinates of triangles in the plane.

use glam::DVec2;

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
