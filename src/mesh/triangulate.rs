//! Triangulation of polygons, and the test for degenerate triangles, in the UV plane (method §1).

/// Twice the signed area of a triangle.
fn cross(a: [f64; 2], b: [f64; 2], c: [f64; 2]) -> f64 {
    (b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0])
}

/// True for a triangle without area, or so thin that f32 UVs do not determine on which side of an edge the third corner
/// lies.
pub fn is_degenerate(uv: &[[f64; 2]; 3]) -> bool {
    let length2 = |a: [f64; 2], b: [f64; 2]| (b[0] - a[0]).powi(2) + (b[1] - a[1]).powi(2);
    let longest2 = length2(uv[0], uv[1]).max(length2(uv[1], uv[2])).max(length2(uv[2], uv[0]));
    cross(uv[0], uv[1], uv[2]).abs() <= 1e-7 * longest2
}

/// Triangulates a polygon by ear clipping; a convex one becomes the fan around its first corner.
pub fn polygon(uv: &[[f64; 2]]) -> Vec<[usize; 3]> {
    let n = uv.len();
    let area: f64 = (1..n - 1).map(|k| cross(uv[0], uv[k], uv[k + 1])).sum();
    let sign = if area < 0.0 { -1.0 } else { 1.0 };
    let mut open: Vec<usize> = (0..n).collect();
    let mut triangles = Vec::with_capacity(n - 2);
    while open.len() > 3 {
        let m = open.len();
        let is_ear = |k: usize| {
            let [a, b, c] = [open[(k + m - 1) % m], open[k], open[(k + 1) % m]];
            let inside = |p: [f64; 2]| {
                sign * cross(uv[a], uv[b], p) >= 0.0
                    && sign * cross(uv[b], uv[c], p) >= 0.0
                    && sign * cross(uv[c], uv[a], p) >= 0.0
            };
            sign * cross(uv[a], uv[b], uv[c]) > 0.0
                // Points equal to a corner are skipped: a polygon with holes comes with bridges, whose points occur
                // twice.
                && !open.iter().any(|&p| ![uv[a], uv[b], uv[c]].contains(&uv[p]) && inside(uv[p]))
        };
        // The search begins at 1, which yields the fan. A polygon without an ear has next to no area: any corner will
        // do.
        let ear = (1..m).chain([0]).find(|&k| is_ear(k)).unwrap_or(1);
        triangles.push([open[(ear + m - 1) % m], open[ear], open[(ear + 1) % m]]);
        open.remove(ear);
    }
    triangles.push([open[0], open[1], open[2]]);
    triangles
}
