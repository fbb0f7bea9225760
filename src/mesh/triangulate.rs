//! Triangulation of polygons, and the test for degenerate triangles, in the UV plane (method §1).

use glam::DVec2;

use super::triangle::doubled_area;
use crate::allocation::{Collect, Grow, with_capacity};

/// True for a triangle without area, or so thin that f32 UVs do not determine on which side of an edge the third corner
/// lies.
pub fn is_degenerate(uv: [DVec2; 3]) -> bool {
    let length2 = |a: usize, b: usize| uv[a].distance_squared(uv[b]);
    let longest2 = length2(0, 1).max(length2(1, 2)).max(length2(2, 0));
    doubled_area(uv).abs() <= 1e-7 * longest2
}

/// Triangulates a polygon by ear clipping; a convex one becomes the fan around its first corner.
pub fn polygon(uv: &[DVec2]) -> Vec<[usize; 3]> {
    let n = uv.len();
    let area: f64 = (1..n - 1).map(|k| doubled_area([uv[0], uv[k], uv[k + 1]])).sum();
    let sign = if area < 0.0 { -1.0 } else { 1.0 };
    let mut open: Vec<usize> = (0..n).collected();
    let mut triangles = with_capacity(n - 2);
    while open.len() > 3 {
        let m = open.len();
        let is_ear = |k: usize| {
            let [a, b, c] = [open[(k + m - 1) % m], open[k], open[(k + 1) % m]];
            let inside = |p: DVec2| {
                [(a, b), (b, c), (c, a)].iter().all(|&(i, j)| sign * doubled_area([uv[i], uv[j], p]) >= 0.0)
            };
            sign * doubled_area([uv[a], uv[b], uv[c]]) > 0.0
                // Points equal to a corner are skipped: a polygon with holes comes with bridges, whose points occur
                // twice.
                && !open.iter().any(|&p| ![uv[a], uv[b], uv[c]].contains(&uv[p]) && inside(uv[p]))
        };
        // The search begins at 1, which yields the fan. A polygon without an ear has next to no area: any corner will
        // do.
        let ear = (1..m).chain([0]).find(|&k| is_ear(k)).unwrap_or(1);
        triangles.put([open[(ear + m - 1) % m], open[ear], open[(ear + 1) % m]]);
        open.remove(ear);
    }
    triangles.put([open[0], open[1], open[2]]);
    triangles
}
