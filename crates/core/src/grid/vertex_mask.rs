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
pub fn darkest(corners: &[DVec3; 3], at: DVec2) -> f64 {
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
