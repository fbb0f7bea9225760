//! Strain at a point of the picture: how much longer or shorter than at rest the painting appears there.

use super::raster::Raster;
use vrtm_examples::mesh::{Triangle, dot, minus};

/// A tile's surface, searchable by UV.
pub struct Surface {
    /// The triangle at each sample of the tile.
    raster: Raster,
    /// Half of the length in UV over which strain is measured.
    step: f32,
}

/// Samples per side of a tile.
const SIDE: usize = 1024;

impl Surface {
    /// `triangles` are those of the tile, with their indices among all triangles. Strain is measured over two cells of
    /// its grid.
    pub fn new<'a>(triangles: impl Iterator<Item = (u32, &'a Triangle)>, cells: u32) -> Surface {
        let side = SIDE as f64;
        let corners = |t: &Triangle| t.uvs.map(|[u, v]| [u * side, (1.0 - v) * side, 0.0]);
        let raster = Raster::new(triangles.map(|(index, t)| (index, corners(t))), [SIDE; 2]);
        Surface { raster, step: 1.0 / cells as f32 }
    }

    /// The triangle at a UV, and the weights of its corners there.
    fn find(&self, triangles: &[Triangle], uv: [f32; 2]) -> Option<(usize, [f64; 3])> {
        let place = |x: f32| ((x * SIDE as f32).max(0.0) as usize).min(SIDE - 1);
        let (index, _) = self.raster.hits[place(1.0 - uv[1]) * SIDE + place(uv[0])]?;
        let [a, b, c] = triangles[index as usize].uvs;
        let [u, v] = uv.map(f64::from);
        let side = |p: [f64; 2], q: [f64; 2]| (q[0] - p[0]) * (v - p[1]) - (q[1] - p[1]) * (u - p[0]);
        let weights = [side(b, c), side(c, a), side(a, b)];
        let area: f64 = weights.iter().sum();
        Some((index as usize, weights.map(|w| w / area)))
    }

    /// Stretch and compression, each >= 0, at a UV; `target` returns the UV at which the texture is looked up.
    pub fn strain(
        &self,
        (triangles, charts): (&[Triangle], &[u32]),
        [rest, pose]: [&[[f32; 3]]; 2],
        uv: [f32; 2],
        target: impl Fn([f32; 2]) -> [f32; 2],
    ) -> Option<[f32; 2]> {
        let chart = charts[self.find(triangles, uv)?.0];
        // The point on the surface of this chart at a UV.
        let place = |uv: [f32; 2], positions: &[[f32; 3]]| -> Option<[f64; 3]> {
            let (t, weights) = self.find(triangles, uv).filter(|(t, _)| charts[*t] == chart)?;
            let corners = triangles[t].vertices.map(|v| positions[v as usize]);
            Some([0, 1, 2].map(|c| (0..3).map(|k| weights[k] * f64::from(corners[k][c])).sum()))
        };
        // The point in the pose where a UV is seen, and the point at rest where its texture was painted.
        let both = |uv: [f32; 2]| Some([place(uv, pose)?, place(target(uv), rest)?]);
        let edge = |axis: usize| {
            let end = |length: f32| {
                let mut end = uv;
                end[axis] += length;
                both(end)
            };
            // Next to a border of the chart, one end is the point itself.
            let (low, high) = match (end(-self.step), end(self.step)) {
                (Some(low), Some(high)) => (low, high),
                (Some(low), None) => (low, both(uv)?),
                (None, high) => (both(uv)?, high?),
            };
            Some([minus(high[0], low[0]), minus(high[1], low[1])])
        };
        let [u, v] = [edge(0)?, edge(1)?];
        // Squared lengths of steps as matrices [xx, xy, yy]. The generalised eigenvalues of the pose's matrix with
        // respect to the rest's are the squares of the largest and of the smallest ratio of lengths.
        let [p, r] = [0, 1].map(|k| [dot(u[k], u[k]), dot(u[k], v[k]), dot(v[k], v[k])]);
        let det = |m: [f64; 3]| m[0] * m[2] - m[1] * m[1];
        let half = (r[2] * p[0] - 2.0 * r[1] * p[1] + r[0] * p[2]) / (2.0 * det(r));
        let root = (half * half - det(p) / det(r)).max(0.0).sqrt();
        let [large, small] = [half + root, (half - root).max(0.0)].map(f64::sqrt);
        let strain = [large - 1.0, 1.0 - small].map(|x| x.max(0.0) as f32);
        strain.iter().all(|x| x.is_finite()).then_some(strain)
    }
}
