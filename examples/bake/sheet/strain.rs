//! Strain at a point of the picture: how much longer or shorter than at rest what is painted there appears.

use super::raster::Raster;
use crate::maps::Field;
use crate::mesh::{Triangle, dot, minus};

/// A symmetric matrix of two rows, as [xx, xy, yy]: squared lengths of steps in UV.
type Metric = [f64; 3];

/// Lengths on a triangle.
fn metric(t: &Triangle, positions: &[[f32; 3]]) -> Option<Metric> {
    let [a, b, c] = t.vertices.map(|v| positions[v as usize].map(f64::from));
    let (p, q) = (minus(b, a), minus(c, a));
    let [[u0, v0], [u1, v1], [u2, v2]] = t.uvs;
    let (u1, v1, u2, v2) = (u1 - u0, v1 - v0, u2 - u0, v2 - v0);
    // The inverse of the matrix with the edges in UV as columns turns u and v into the edges' shares.
    let det = u1 * v2 - u2 * v1;
    let edges = [dot(p, p), dot(p, q), dot(q, q)];
    (det != 0.0).then(|| along(edges, [v2 / det, -u2 / det, -v1 / det, u1 / det]))
}

/// Lengths of the steps that a matrix, given by rows, makes of steps.
fn along([xx, xy, yy]: Metric, [a, b, c, d]: [f64; 4]) -> Metric {
    let product =
        |x: [f64; 2], y: [f64; 2]| xx * x[0] * y[0] + xy * (x[0] * y[1] + x[1] * y[0]) + yy * x[1] * y[1];
    [product([a, c], [a, c]), product([a, c], [b, d]), product([b, d], [b, d])]
}

/// The redirection's derivatives by rows, from differences over a texel.
fn jacobian(map: &Field<3>, uv: [f32; 2]) -> [f64; 4] {
    let difference = |axis: usize| {
        let half = 0.5 / map.size[axis] as f32;
        let at = |sign: f32| {
            let mut uv = uv;
            uv[axis] += sign * half;
            map.sample(uv)
        };
        let (low, high) = (at(-1.0), at(1.0));
        [0, 1].map(|c| f64::from(high[c] - low[c]) / f64::from(2.0 * half))
    };
    let (by_u, by_v) = (difference(0), difference(1));
    [by_u[0], by_v[0], by_u[1], by_v[1]]
}

/// A tile's triangles, to be found by UV.
pub struct Locator(pub Raster);

impl Locator {
    /// Samples per side.
    const SIDE: usize = 1024;

    pub fn new<'a>(triangles: impl Iterator<Item = (u32, &'a Triangle)>) -> Locator {
        let side = Self::SIDE as f64;
        let corners = |t: &Triangle| t.uvs.map(|[u, v]| [u * side, (1.0 - v) * side, 0.0]);
        Locator(Raster::new(triangles.map(|(index, t)| (index, corners(t))), [Self::SIDE; 2]))
    }

    fn find(&self, uv: [f32; 2]) -> Option<u32> {
        let place = |x: f32| ((x * Self::SIDE as f32).max(0.0) as usize).min(Self::SIDE - 1);
        self.0.hits[place(1.0 - uv[1]) * Self::SIDE + place(uv[0])].map(|(index, _)| index)
    }
}

/// Stretch and compression, each >= 0, at a UV of a triangle; `map` is what redirects it, and `target` where to.
pub fn measure(
    (triangles, index): (&[Triangle], u32),
    (rest, pose): (&[[f32; 3]], &[[f32; 3]]),
    uv: [f32; 2],
    redirection: Option<(&Field<3>, [f32; 2], &Locator)>,
) -> Option<[f32; 2]> {
    let shown = metric(&triangles[index as usize], pose)?;
    let (painted, shown) = match redirection {
        None => (metric(&triangles[index as usize], rest)?, shown),
        Some((map, target, locator)) => {
            let [a, b, c, d] = jacobian(map, uv);
            let det = a * d - b * c;
            let origin = locator.find(target).unwrap_or(index);
            // A step of the texture is shown as the step of the mesh's UV that the redirection makes it of.
            let shown = along(shown, [d / det, -b / det, -c / det, a / det]);
            (metric(&triangles[origin as usize], rest)?, shown)
        }
    };
    // Squares of the largest and the smallest ratio of lengths: the eigenvalues of one metric in the other.
    let det = |m: Metric| m[0] * m[2] - m[1] * m[1];
    let half =
        (painted[2] * shown[0] - 2.0 * painted[1] * shown[1] + painted[0] * shown[2]) / (2.0 * det(painted));
    let root = (half * half - det(shown) / det(painted)).max(0.0).sqrt();
    let [large, small] = [half + root, (half - root).max(0.0)].map(f64::sqrt);
    let strain = [large - 1.0, 1.0 - small].map(|x| x.max(0.0) as f32);
    strain.iter().all(|x| x.is_finite()).then_some(strain)
}
