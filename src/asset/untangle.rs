//! Makes a redirection map one-to-one under bilinear interpolation. The inverse of a warp is affine on pieces, and where
//! two pieces with different derivatives meet, the four texel centres of a quad may lie on both sides: its interpolation
//! may then fold, however fine the map is. Values of such quads move, by a fraction of a texel in most cases, until the
//! Jacobian at each corner of each quad is positive (method §9).

use crate::memory::{Grow, with_capacity, zeroed};
use crate::team::Team;

use super::canvas::Canvas;
use super::form::Form;
use super::quad::smallest_jacobian;

/// A quad with a corner whose Jacobian is not over this folds, or might for a renderer's rounding.
const LEAST: f64 = 1e-3;
/// What the Jacobian at a corner of such a quad is raised to.
const TARGET: f64 = 0.02;
/// Most passes over the quads that fold.
const ROUNDS: usize = 500;
/// Most quads that may fold, and most of all quads, of which this is one in so many: where more do, the numbers of the map
/// are too coarse for its size, and nothing is changed.
const MOST: usize = 1 << 16;
const FEW: usize = 50;

/// The corners of a quad: each with the ends of the edges that meet there, in their order from u to v.
const CORNERS: [[[usize; 2]; 3]; 4] =
    [[[0, 0], [1, 0], [0, 1]], [[1, 0], [1, 1], [0, 0]], [[0, 1], [0, 0], [1, 1]], [[1, 1], [0, 1], [1, 0]]];

/// All memory that the work takes, so that nothing is missing once an image is written.
pub(super) struct Untangler {
    /// Per row of quads the number of those that fold.
    rows: Vec<u32>,
    most: usize,
    /// Quads that fold, and quads around those: each list has room for as many as are ever in it.
    quads: Vec<[u32; 2]>,
    near: Vec<[u32; 2]>,
}

impl Untangler {
    /// For maps of so many texels.
    pub fn new([width, height]: [usize; 2]) -> Untangler {
        let most = (width * height / FEW + FEW).min(MOST);
        let rows = zeroed(height.saturating_sub(1));
        Untangler { rows, most, quads: with_capacity(9 * most), near: with_capacity(9 * most) }
    }

    /// Moves values of quads that fold. One after the other in a fixed order, so that the result does not depend on the
    /// number of threads.
    pub fn untangle(mut self, team: &Team, map: &Map) {
        let [width, height] = map.size.map(|n| n as u32);
        if width < 2 || height < 2 {
            return;
        }
        team.fill(&mut self.rows, |y, count| map.each_fold(y, |_| *count += 1));
        if self.rows.iter().map(|&count| count as usize).sum::<usize>() > self.most {
            return;
        }
        for (y, _) in self.rows.iter().enumerate().filter(|&(_, &count)| count > 0) {
            map.each_fold(y, |x| self.quads.put([x as u32, y as u32]));
        }
        for _ in 0..ROUNDS {
            if self.quads.is_empty() || self.quads.len() > self.most {
                break;
            }
            self.quads.iter().for_each(|&quad| map.open(quad));
            // What moved may have folded the quads around.
            self.near.clear();
            for &[x, y] in &self.quads {
                for j in y.saturating_sub(1)..=(y + 1).min(height - 2) {
                    self.near.put_all((x.saturating_sub(1)..=(x + 1).min(width - 2)).map(|i| [i, j]));
                }
            }
            self.near.sort_unstable_by_key(|&[x, y]| (y, x));
            self.near.dedup();
            self.near.retain(|&quad| map.folds(quad));
            std::mem::swap(&mut self.near, &mut self.quads);
        }
    }
}

/// A written redirection map of a whole tile.
pub(super) struct Map<'a> {
    canvas: &'a Canvas,
    form: Form,
    size: [usize; 2],
}

impl<'a> Map<'a> {
    pub fn new(canvas: &'a Canvas, form: Form, size: [usize; 2]) -> Map<'a> {
        Map { canvas, form, size }
    }

    /// Calls `f(x)` for the quads of a row that fold.
    fn each_fold(&self, y: usize, mut f: impl FnMut(usize)) {
        let side = |x: usize| [self.delta([x, y]), self.delta([x, y + 1])];
        let size = self.size.map(|n| n as f64);
        let mut left = side(0);
        for x in 1..self.size[0] {
            let right = side(x);
            if smallest_jacobian([left[0], right[0], left[1], right[1]], size) <= LEAST {
                f(x - 1);
            }
            left = right;
        }
    }

    fn folds(&self, quad: [u32; 2]) -> bool {
        let deltas = [[0, 0], [1, 0], [0, 1], [1, 1]].map(|way| self.delta(texel(quad, way)));
        smallest_jacobian(deltas, self.size.map(|n| n as f64)) <= LEAST
    }

    /// Moves a quad's texels so that the Jacobian at each of its corners reaches the target: for each corner by the
    /// shortest way that does so to first order.
    fn open(&self, quad: [u32; 2]) {
        for corner in CORNERS {
            let texels = corner.map(|way| texel(quad, way));
            let [a, b, c] = texels.map(|texel| self.place(texel));
            let missing = TARGET - cross(a, b, c);
            // Derivatives of the Jacobian by the three places.
            let of_b = [c[1] - a[1], a[0] - c[0]];
            let of_c = [a[1] - b[1], b[0] - a[0]];
            let of_a = [-of_b[0] - of_c[0], -of_b[1] - of_c[1]];
            let squares: f64 = [of_a, of_b, of_c].as_flattened().iter().map(|x| x * x).sum();
            if missing <= 0.0 || squares < 1e-12 {
                continue;
            }
            let step = missing / squares;
            for (texel, (place, way)) in texels.into_iter().zip([(a, of_a), (b, of_b), (c, of_c)]) {
                self.put(texel, [0, 1].map(|k| place[k] + (step * way[k]).clamp(-0.5, 0.5)));
            }
        }
    }

    fn centre(&self, texel: [usize; 2]) -> [f64; 2] {
        [0, 1].map(|k| (texel[k] as f64 + 0.5) / self.size[k] as f64)
    }

    /// The way from a texel's centre to where its value points, in UV.
    fn delta(&self, texel: [usize; 2]) -> [f64; 2] {
        self.form.delta(self.canvas.get(texel[0], texel[1]), self.centre(texel))
    }

    /// Where a texel's value points to, in texels.
    fn place(&self, texel: [usize; 2]) -> [f64; 2] {
        let delta = self.delta(texel);
        [0, 1].map(|k| texel[k] as f64 + delta[k] * self.size[k] as f64)
    }

    fn put(&self, texel: [usize; 2], place: [f64; 2]) {
        let delta = [0, 1].map(|k| (place[k] - texel[k] as f64) / self.size[k] as f64);
        let centre = self.centre(texel);
        let value = self.form.value([0, 1].map(|k| centre[k] + delta[k]), delta);
        self.canvas.put(texel[0], texel[1], value);
    }
}

/// A texel of a quad.
fn texel(quad: [u32; 2], way: [usize; 2]) -> [usize; 2] {
    [0, 1].map(|k| quad[k] as usize + way[k])
}

/// Twice the area of a triangle.
fn cross(a: [f64; 2], b: [f64; 2], c: [f64; 2]) -> f64 {
    (b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0])
}
