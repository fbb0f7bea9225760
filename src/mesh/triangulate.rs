//! Polygons to triangles, in UV.

/// Twice the signed area.
fn cross(a: [f64; 2], b: [f64; 2], c: [f64; 2]) -> f64 {
    (b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0])
}

/// True for UVs without area, or so thin that f32 UVs cannot tell on which side of an edge the third corner lies.
pub fn is_degenerate(uv: &[[f64; 2]; 3]) -> bool {
    let length2 = |a: [f64; 2], b: [f64; 2]| (b[0] - a[0]).powi(2) + (b[1] - a[1]).powi(2);
    let longest2 = length2(uv[0], uv[1]).max(length2(uv[1], uv[2])).max(length2(uv[2], uv[0]));
    cross(uv[0], uv[1], uv[2]).abs() <= 1e-7 * longest2
}

/// Ear clipping; a convex polygon becomes the fan around its first corner.
pub fn polygon(uv: &[[f64; 2]]) -> Vec<[usize; 3]> {
    let n = uv.len();
    let area: f64 = (1..n - 1).map(|k| cross(uv[0], uv[k], uv[k + 1])).sum();
    let sign = if area < 0.0 { -1.0 } else { 1.0 };
    let mut left: Vec<usize> = (0..n).collect();
    let mut triangles = Vec::with_capacity(n - 2);
    while left.len() > 3 {
        let m = left.len();
        let is_ear = |k: usize| {
            let [a, b, c] = [left[(k + m - 1) % m], left[k], left[(k + 1) % m]];
            let inside = |p: [f64; 2]| {
                sign * cross(uv[a], uv[b], p) >= 0.0
                    && sign * cross(uv[b], uv[c], p) >= 0.0
                    && sign * cross(uv[c], uv[a], p) >= 0.0
            };
            sign * cross(uv[a], uv[b], uv[c]) > 0.0
                // A corner's own point may come twice: polygons with holes are given with bridges.
                && !left.iter().any(|&p| ![uv[a], uv[b], uv[c]].contains(&uv[p]) && inside(uv[p]))
        };
        // Starting at 1 gives the fan; a polygon without any ear has no area worth an argument.
        let ear = (1..m).chain([0]).find(|&k| is_ear(k)).unwrap_or(1);
        triangles.push([left[(ear + m - 1) % m], left[ear], left[(ear + 1) % m]]);
        left.remove(ear);
    }
    triangles.push([left[0], left[1], left[2]]);
    triangles
}
