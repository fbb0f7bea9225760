//! Triangles in the UV plane, prepared for point location (method §2).

use glam::DVec2;

use crate::allocation::Vec;
use crate::mesh::TileMesh;

/// A triangle in the UV plane, in cells.
#[derive(Clone, Copy, Debug)]
pub struct UvTriangle {
    /// The first UV corner, in cells.
    pub origin: [f32; 2],
    /// Rows of the 2x2 matrix that takes an offset from `origin` to the barycentric coordinates of corners 1 and 2.
    pub barycentric: [[f32; 2]; 2],
    /// The triangle across the edge opposite to each corner, or `NONE`.
    pub neighbours: [u32; 3],
}

impl UvTriangle {
    /// Barycentric coordinates of corners 1 and 2 at a point in cells.
    pub fn barycentrics(&self, at: [f32; 2]) -> [f32; 2] {
        let offset = [at[0] - self.origin[0], at[1] - self.origin[1]];
        self.barycentric.map(|row| row[0] * offset[0] + row[1] * offset[1])
    }

    /// A linear function at a point in cells, from its values at the corners.
    pub fn interpolate(&self, [a, b, c]: [f32; 3], at: [f32; 2]) -> f32 {
        let [l1, l2] = self.barycentrics(at);
        a + l1 * (b - a) + l2 * (c - a)
    }
}

/// The triangles of a tile, prepared for point location on a grid of nx by ny cells.
pub fn uv_triangles(tile: &TileMesh, nx: usize, ny: usize) -> Vec<UvTriangle> {
    let cells = DVec2::new(nx as f64, ny as f64);
    tile.triangles
        .iter()
        .map(|t| {
            let [a, b, c] = t.uv.map(|uv| uv * cells);
            let (e1, e2) = (b - a, c - a);
            let det = e1.perp_dot(e2);
            let single = |v: DVec2| v.to_array().map(|x| x as f32);
            UvTriangle {
                origin: single(a),
                barycentric: [single(-e2.perp() / det), single(e1.perp() / det)],
                neighbours: t.neighbours,
            }
        })
        .collect()
}
