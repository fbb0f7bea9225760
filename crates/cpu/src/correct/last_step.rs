//! The step of the correction before, as a third direction of conjugate gradients (method §7.3).

use glam::DVec4;

use super::super::lanes::{LANES, Lanes, Mask, Vectorised, dispatch};
use super::super::prefetch::nothing;
use super::super::row::Row;
use super::super::run::Run;
use super::multigrid;
use super::rows::BlockRows;
use super::transfer::active_neighbours;
use super::workspace::{Solving, SolvingLevel};
use vrtm_core::allocation::Vec;
use vrtm_core::grid::codes::unpack_two;
use vrtm_core::grid::planes::{NODES, Plane};
use vrtm_core::grid::window::{self, WINDOW_NODES, Window};
use vrtm_core::method::law::{MAX_STEP, MIN_NEW_CURVATURE};
use vrtm_core::team::SharedSlice;

/// The lengths of the two steps of conjugate gradients and the curvatures along their directions, per chart.
#[derive(Default)]
pub struct Directions {
    pub lengths: [Vec<f32>; 2],
    pub curvatures: [Vec<f64>; 2],
}

/// The factors of the step so far, of the second direction and of the last step in the step of a chart.
type Factors = [f32; 3];

impl Run<'_> {
    /// Copies the step of the correction before, which conjugate gradients overwrite.
    pub(super) fn keep_last_step(&self, level: usize, solving: &mut Solving) {
        let (step, product) = (&*solving.step, SharedSlice::new(solving.levels[0].product));
        self.each_block(level, nothing, |_, b, _| {
            // SAFETY: each item has its own block.
            dispatch(Encode { step: &step[b], words: unsafe { &mut product.get_mut(b)[2] } });
        });
    }

    /// Adds to the step of `level` the part of the last step that is conjugate to both directions, at the length that
    /// is best for the model, and what it gains to `predicted`. The residual is that between the two directions.
    pub(super) fn add_last_step(
        &self,
        level: usize,
        solving: &mut Solving,
        directions: &Directions,
        predicted: &mut [f64],
    ) {
        let SolvingLevel { rows, residual, direction, product } = &solving.levels[0];
        let grid = &self.grid.levels[level];
        let next = |b: usize| rows.prefetch(b);
        let products = self.sum_blocks(level, next, |_, b| {
            let words = &window::of(&active_neighbours(grid, b), 0.0, |b| &product[b][2]);
            let rows = rows.block(b);
            let (vectors, residual) = ([&solving.step[b], &direction[b]], &residual[b]);
            DVec4::from(dispatch(Products { rows, words, vectors, residual }).map(f64::from))
        });
        let factors: Vec<Factors> = (0..predicted.len())
            .map(|c| {
                let (factors, gain) = combined(products[c].to_array(), directions, c);
                predicted[c] += gain;
                factors
            })
            .collect();
        let (direction, product) = (&**direction, &**product);
        let step = SharedSlice::new(solving.step);
        self.each_block(level, nothing, |_, b, c| {
            // SAFETY: each item has its own block.
            let x = unsafe { step.get_mut(b) };
            if factors[c][2] != 0.0 {
                let (second, last, factors) = (&direction[b], &product[b][2], factors[c]);
                dispatch(Combine { x, second, last, factors });
            }
        });
    }
}

/// The factors of the step of chart `c`, and what the last step gains. `products` are those of A p with the last step
/// p, the step so far x and the second direction s1, and that of p with the residual.
fn combined(products: [f64; 4], directions: &Directions, c: usize) -> (Factors, f64) {
    const UNCHANGED: (Factors, f64) = ([1.0, 0.0, 0.0], 0.0);
    let [curvature, of_step, of_second, of_residual] = products;
    let lengths = directions.lengths.each_ref().map(|of| f64::from(of[c]));
    // A direction along which no step was taken is no part of the step.
    let along = |n: usize, product: f64| {
        if lengths[n] == 0.0 { 0.0 } else { product / directions.curvatures[n][c] }
    };
    let of_first = (of_step - lengths[1] * of_second) / lengths[0];
    let parts = [along(0, of_first), along(1, of_second)];
    let first = if lengths[0] == 0.0 { 0.0 } else { parts[0] * of_first };
    let new = curvature - first - parts[1] * of_second;
    let falls = of_residual - lengths[1] * of_second;
    let length = falls / new;
    if !(new > f64::from(MIN_NEW_CURVATURE) * curvature && (length as f32).is_finite()) {
        return UNCHANGED;
    }
    // The first direction is (x - α1 s1) / α0.
    let shorter = if lengths[0] == 0.0 { 0.0 } else { length * parts[0] / lengths[0] };
    let factors = [1.0 - shorter, shorter * lengths[1] - length * parts[1], length];
    (factors.map(|factor| factor as f32), length * falls)
}

/// Packs a step into one word per node, in one block.
struct Encode<'a> {
    step: &'a [Plane; 2],
    words: &'a mut Plane,
}

impl Vectorised for Encode<'_> {
    type Output = ();

    #[inline(always)]
    fn run<V: Lanes>(self) {
        for s in (0..NODES).step_by(LANES) {
            let [x, y] = self.step.each_ref().map(|plane| V::load(plane, s));
            V::from_bits(V::pack_two(x, y)).store(self.words, s);
        }
    }
}

/// The products of A p with p and with two other vectors, and that of p with the residual, in one block.
struct Products<'a> {
    rows: BlockRows<'a>,
    /// p.
    words: &'a Window,
    vectors: [&'a [Plane; 2]; 2],
    residual: &'a [Plane; 2],
}

impl Vectorised for Products<'_> {
    type Output = [f32; 4];

    #[inline(always)]
    fn run<V: Lanes>(self) -> [f32; 4] {
        let mut windows = [[0.0f32; WINDOW_NODES]; 2];
        for (k, &word) in self.words.iter().enumerate() {
            let [x, y] = unpack_two(word.to_bits());
            (windows[0][k], windows[1][k]) = (x, y);
        }
        let mut of_pairs = [[0.0; WINDOW_NODES]; 2];
        self.rows.add_product::<V>(&windows, &mut of_pairs);
        let mut sums = [V::zero(); 4];
        for row in Row::all() {
            let product = multigrid::with_diagonal::<V>(&self.rows, row, &windows, &of_pairs);
            for c in 0..2 {
                let last = row.near::<V>(&windows[c], 0, 0);
                sums[0] += product[c] * last;
                for (sum, vector) in sums[1..].iter_mut().zip(self.vectors) {
                    *sum += product[c] * row.load::<V>(&vector[c]);
                }
                sums[3] += row.load::<V>(&self.residual[c]) * last;
            }
        }
        sums.map(V::sum)
    }
}

/// Sets x to a combination of x and two other vectors, in one block.
struct Combine<'a> {
    x: &'a mut [Plane; 2],
    second: &'a [Plane; 2],
    last: &'a Plane,
    factors: Factors,
}

impl Vectorised for Combine<'_> {
    type Output = ();

    #[inline(always)]
    fn run<V: Lanes>(self) {
        let Combine { x, second, last, factors } = self;
        for s in (0..NODES).step_by(LANES) {
            let last = V::unpack_two(V::load(last, s).bits());
            for c in 0..2 {
                let sum = V::load(&x[c], s) * factors[0]
                    + V::load(&second[c], s) * factors[1]
                    + last[c] * factors[2];
                // As in conjugate gradients.
                let small = sum.lt(V::splat(MAX_STEP)).and(V::splat(-MAX_STEP).lt(sum));
                small.select(sum, V::zero()).store(&mut x[c], s);
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const MATRIX: [f64; 4] = [1.0, 2.0, 3.0, 7.0];

    fn dot(a: [f64; 4], b: [f64; 4]) -> f64 {
        a.iter().zip(b).map(|(a, b)| a * b).sum()
    }

    fn times(v: [f64; 4]) -> [f64; 4] {
        std::array::from_fn(|n| MATRIX[n] * v[n])
    }

    fn sum<const N: usize>(terms: [(f64, [f64; 4]); N]) -> [f64; 4] {
        std::array::from_fn(|n| terms.iter().map(|(factor, v)| factor * v[n]).sum())
    }

    /// The residual after a step of two directions and the last step `p`, the three of them, and the difference of the
    /// gain that is predicted and that of the model. `begun`: the first direction has a step.
    fn solved(p: [f64; 4], begun: bool) -> ([f64; 4], [[f64; 4]; 3], f64) {
        let right = [1.0, -0.5, 2.0, 0.7];
        let first = [1.0, 1.0, 0.3, -0.2];
        let curvature = dot(first, times(first));
        let alpha = if begun { dot(right, first) / curvature } else { 0.0 };
        let residual = sum([(1.0, right), (-alpha, times(first))]);
        let conjugate = if begun { dot(residual, times(first)) / curvature } else { 0.0 };
        let second = sum([(1.0, residual), (-conjugate, first)]);
        let second_curvature = dot(second, times(second));
        let beta = dot(residual, second) / second_curvature;
        let x = sum([(alpha, first), (beta, second)]);
        let directions = Directions {
            lengths: [alpha, beta].map(|length| [length as f32].into_iter().collect()),
            curvatures: [curvature, second_curvature].map(|of| [of].into_iter().collect()),
        };
        let products = [p, x, second].map(|v| dot(v, times(p)));
        let products = [products[0], products[1], products[2], dot(residual, p)];
        let ([of_x, of_second, of_last], gain) = combined(products, &directions, 0);
        let step = sum([(of_x.into(), x), (of_second.into(), second), (of_last.into(), p)]);
        let model = |x: [f64; 4]| dot(right, x) - 0.5 * dot(x, times(x));
        let left = sum([(1.0, right), (-1.0, times(step))]);
        (left, [first, second, p], gain - 2.0 * (model(step) - model(x)))
    }

    #[test]
    fn the_step_is_the_best_of_three_directions() {
        for begun in [true, false] {
            let (left, directions, error) = solved([0.2, 0.9, -0.4, 0.6], begun);
            for direction in &directions[usize::from(!begun)..] {
                assert!(dot(left, *direction).abs() < 1e-5, "{left:?}, {direction:?}");
            }
            assert!(error.abs() < 1e-5, "{error}");
        }
    }

    #[test]
    fn a_last_step_along_the_other_directions_is_left_out() {
        let (_, [first, second, _], _) = solved([0.0; 4], true);
        for p in [first, second, sum([(0.3, first), (-2.0, second)]), [0.0; 4]] {
            let (left, directions, error) = solved(p, true);
            assert!(dot(left, directions[0]).abs() < 1e-5 && error.abs() < 1e-6, "{p:?}: {left:?}, {error}");
        }
    }
}
