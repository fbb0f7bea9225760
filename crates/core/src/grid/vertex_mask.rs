//! A mask with one value per vertex, at the nodes of a square (method §1). The mask is linear on each triangle, and a
//! node is fixed if the mask is below 0.5 anywhere within half a cell of it, as with a mask image.

use glam::{DVec2, DVec3};

use super::cover::Coverer;
use super::node_set::NodeSet;
use crate::grid::planes::SIDE;

/// Nodes where the mask is below this are fixed.
const FREE: f64 = 0.5;

/// The nodes of a square that the mask leaves free.
pub fn free(coverer: &Coverer, values: &[f32], index: usize) -> NodeSet {
    let mut free = NodeSet([u16::MAX; SIDE]);
    let tile = coverer.tile;
    let cells = DVec2::new(coverer.nx as f64, coverer.ny as f64);
    let square = coverer.squares.list[index].at;
    let first = DVec2::from(square.map(|x| f64::from(x) * SIDE as f64));
    for &t in coverer.squares.triangles(index) {
        let triangle = &tile.triangles[t as usize];
        let chart = &tile.charts[coverer.charts[t as usize] as usize];
        let masks = triangle.local.map(|v| chart.value(v, |v| [f64::from(values[v as usize])])[0]);
        if masks.iter().all(|&mask| mask >= FREE) {
            continue;
        }
        // Corners in cells from the square's first node; the third component is the mask.
        let corner = |k: usize| (triangle.uv[k] * cells - first).extend(masks[k]);
        let corners = [0, 1, 2].map(corner);
        let low = corners[0].min(corners[1]).min(corners[2]);
        let high = corners[0].max(corners[1]).max(corners[2]);
        let range = |low: f64, high: f64| {
            let first = (low - 0.5).ceil().max(0.0) as usize;
            let end = (high + 0.5).floor().min(SIDE as f64 - 1.0) + 1.0;
            first..end.max(0.0) as usize
        };
        for j in range(low.y, high.y) {
            for i in range(low.x, high.x) {
                if free.contains(i, j) && darkest(&corners, DVec2::new(i as f64, j as f64)) < FREE {
                    free.remove(i, j);
                }
            }
        }
    }
    free
}

/// The smallest mask of a triangle within half a cell of a point; infinite if the triangle does not reach there.
fn darkest(corners: &[DVec3; 3], at: DVec2) -> f64 {
    // Four cuts leave 7 corners, or 13 if rounding makes every other side of the polygon cross each cut.
    let mut polygon = [DVec3::ZERO; 13];
    polygon[..3].copy_from_slice(corners);
    let mut count = 3;
    for (axis, sign) in [(0, 1.0), (0, -1.0), (1, 1.0), (1, -1.0)] {
        let inside = |p: DVec3| sign * (at[axis] - p[axis]) + 0.5;
        let whole = polygon;
        let mut cut = 0;
        for k in 0..count {
            let (p, q) = (whole[k], whole[(k + 1) % count]);
            let (a, b) = (inside(p), inside(q));
            if a >= 0.0 {
                polygon[cut] = p;
                cut += 1;
            }
            if (a > 0.0 && b < 0.0) || (a < 0.0 && b > 0.0) {
                polygon[cut] = p + (q - p) * (a / (a - b));
                cut += 1;
            }
        }
        count = cut;
    }
    polygon[..count].iter().fold(f64::INFINITY, |least, p| least.min(p.z))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_darkest_place_of_a_triangle_near_a_point_is_found() {
        // The mask grows along x, from 0 at x = 0 to 1 at x = 10.
        let corners = [DVec3::new(0.0, 0.0, 0.0), DVec3::new(10.0, 0.0, 1.0), DVec3::new(0.0, 10.0, 0.0)];
        let at = |x: f64, y: f64| darkest(&corners, DVec2::new(x, y));
        assert!((at(3.0, 3.0) - 0.25).abs() < 1e-12);
        assert!((at(0.0, 0.0) - 0.0).abs() < 1e-12);
        // Near the long side, where part of the square is outside.
        assert!((at(5.0, 5.0) - 0.45).abs() < 1e-12);
        // The triangle ends beyond the square's corner, at it, or before it.
        assert!((at(5.25, 5.25) - 0.475).abs() < 1e-12);
        assert!((at(5.5, 5.5) - 0.5).abs() < 1e-12);
        assert_eq!(at(5.6, 5.6), f64::INFINITY);
        assert_eq!(at(-0.6, 3.0), f64::INFINITY);
        // A triangle inside the square.
        let small = corners.map(|p| p * DVec3::new(0.01, 0.01, 1.0) + DVec3::new(4.0, 4.0, 0.25));
        assert_eq!(darkest(&small, DVec2::new(4.0, 4.0)), 0.25);
    }

    #[test]
    #[cfg_attr(miri, ignore = "too long, and safe code")]
    fn it_is_that_of_many_points_of_the_triangle() {
        let mut state = 1u64;
        let mut random = || {
            state = state.wrapping_mul(6364136223846793005).wrapping_add(1442695040888963407);
            (state >> 40) as f64 / (1u64 << 24) as f64
        };
        let mut met = 0;
        for _ in 0..200 {
            let corners = [0; 3].map(|_| DVec3::new(4.0 * random() - 2.0, 4.0 * random() - 2.0, random()));
            let found = darkest(&corners, DVec2::ZERO);
            const N: usize = 400;
            let mut least = f64::INFINITY;
            for a in 0..=N {
                for b in 0..=N - a {
                    let weights = DVec3::new(a as f64, b as f64, (N - a - b) as f64) / N as f64;
                    let p = corners[0] * weights.x + corners[1] * weights.y + corners[2] * weights.z;
                    if p.x.abs().max(p.y.abs()) <= 0.5 {
                        least = least.min(p.z);
                    }
                }
            }
            assert!(least >= found - 1e-12, "{corners:?}: {least} is under {found}");
            if least < f64::INFINITY {
                met += 1;
                // Neighbouring points differ by at most 1 / N of the mask's range of 1, and the corners of the polygon
                // that the square cuts out may lie between points. Thin triangles are exempt, since few points lie in
                // them.
                let area =
                    (corners[1] - corners[0]).truncate().perp_dot((corners[2] - corners[0]).truncate());
                assert!(area.abs() < 0.5 || least - found < 0.05, "{corners:?}: {least} against {found}");
            }
        }
        assert!(met > 50, "{met}");
    }
}
