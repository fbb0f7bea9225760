//! A written redirection map, as positions in texels.

use crate::map::canvas::Canvas;
use crate::map::{Form, smallest_jacobian};

/// A quad folds, or might after a renderer's rounding, if the Jacobian at one of its corners is at most this.
pub(super) const LEAST: f64 = 1e-3;
/// The value to which the Jacobian at a corner of such a quad is raised.
pub(super) const TARGET: f64 = 0.02;

/// A written redirection map of a whole tile.
pub(crate) struct WrittenMap<'a> {
    canvas: &'a Canvas,
    form: Form,
    pub(super) size: [usize; 2],
}

impl<'a> WrittenMap<'a> {
    pub fn new(canvas: &'a Canvas, form: Form, size: [usize; 2]) -> WrittenMap<'a> {
        WrittenMap { canvas, form, size }
    }

    /// Calls `f(x)` for the quads of a row that have a corner with a Jacobian of at most `most`.
    pub(super) fn each_fold(&self, y: usize, most: f64, mut f: impl FnMut(usize)) {
        let side = |x: usize| [self.delta([x, y]), self.delta([x, y + 1])];
        let size = self.size.map(|n| n as f64);
        let mut left = side(0);
        for x in 1..self.size[0] {
            let right = side(x);
            if smallest_jacobian([left[0], right[0], left[1], right[1]], size) <= most {
                f(x - 1);
            }
            left = right;
        }
    }

    pub(super) fn smallest_jacobian(&self, quad: [usize; 2]) -> f64 {
        let deltas = [[0, 0], [1, 0], [0, 1], [1, 1]].map(|way| self.delta([0, 1].map(|k| quad[k] + way[k])));
        smallest_jacobian(deltas, self.size.map(|n| n as f64))
    }

    #[inline(always)]
    fn centre(&self, [x, y]: [usize; 2]) -> [f64; 2] {
        [(x as f64 + 0.5) / self.size[0] as f64, (y as f64 + 0.5) / self.size[1] as f64]
    }

    /// The offset from a texel's centre to where its value points, in UV.
    #[inline(always)]
    fn delta(&self, texel: [usize; 2]) -> [f64; 2] {
        self.form.delta(self.canvas.get(texel[0], texel[1]), self.centre(texel))
    }

    /// The position that a texel's value points to, in texels.
    pub(super) fn place(&self, texel: [usize; 2]) -> [f64; 2] {
        self.place_of(texel, self.value(texel))
    }

    /// The position that another value of the texel would point to, in texels.
    pub(super) fn place_of(&self, texel: [usize; 2], value: [f32; 2]) -> [f64; 2] {
        let delta = self.form.delta(value.map(f64::from), self.centre(texel));
        [0, 1].map(|k| texel[k] as f64 + delta[k] * self.size[k] as f64)
    }

    pub(super) fn put(&self, texel: [usize; 2], place: [f64; 2]) {
        let delta = [0, 1].map(|k| (place[k] - texel[k] as f64) / self.size[k] as f64);
        let centre = self.centre(texel);
        let value = self.form.value([0, 1].map(|k| centre[k] + delta[k]), delta);
        self.canvas.put(texel[0], texel[1], value);
    }

    /// A texel's two numbers; f32 represents either format exactly.
    pub(super) fn value(&self, texel: [usize; 2]) -> [f32; 2] {
        self.canvas.get(texel[0], texel[1]).map(|x| x as f32)
    }

    pub(super) fn put_value(&self, texel: [usize; 2], value: [f32; 2]) {
        self.canvas.put(texel[0], texel[1], value.map(f64::from));
    }

    pub(super) fn is_f16(&self) -> bool {
        self.canvas.epsilon() > f64::from(f32::EPSILON)
    }

    /// The largest rounding error of writing a texel's present numbers, in texels.
    pub(super) fn rounding(&self, texel: [usize; 2]) -> f64 {
        let value = self.value(texel);
        let of = |k: usize| f64::from(value[k].abs()) * self.canvas.epsilon() * self.size[k] as f64;
        of(0).max(of(1))
    }
}

/// Twice the area of a triangle.
pub(super) fn cross(a: [f64; 2], b: [f64; 2], c: [f64; 2]) -> f64 {
    (b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0])
}
