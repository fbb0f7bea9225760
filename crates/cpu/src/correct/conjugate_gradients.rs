//! Solves a level's system for the step: conjugate gradients, preconditioned with a V-cycle (method §7.3).

use super::super::lanes::{LANES, Lanes, Mask, Vectorised, dispatch};
use super::super::prefetch::nothing;
use super::super::run::Run;
use super::last_step::Directions;
use super::multigrid;
use super::workspace::{Solving, SolvingLevel};
use vrtm_core::allocation::{Vec, zeroed};
use vrtm_core::grid::planes::{NODES, Plane};
use vrtm_core::method::acceptance::Correction;
use vrtm_core::method::law::MAX_STEP;
use vrtm_core::team::SharedSlice;

impl Run<'_> {
    /// Solves the system of `level` for the step, chart by chart: charts share only the passes over memory. Returns the
    /// predicted gain per chart, which is the decrease of the quadratic model of the energy.
    ///
    /// With two iterations the second direction is a combination of the preconditioned residual and of the first step,
    /// so that no direction has to be stored. On the finest level, corrections after the first one have a third
    /// direction, the step of the correction before.
    pub(super) fn conjugate_gradients(
        &self,
        level: usize,
        correction: &Correction,
        solving: &mut Solving,
    ) -> Vec<f64> {
        let charts = self.charts.len();
        let mut predicted = zeroed::<f64>(charts);
        let has_last_step = level == 0 && !correction.first;
        if has_last_step {
            self.keep_last_step(level, solving);
        }
        // r·z of the first iteration.
        let mut first_rz = zeroed::<f64>(charts);
        let mut directions = Directions::default();
        let iterations = correction.iterations as usize;
        for iteration in 0..iterations {
            let (first, last) = (iteration == 0, iteration + 1 == iterations);
            let rz = multigrid::precondition(self, level, &mut solving.levels);
            let SolvingLevel { rows, residual, direction, product } = &mut solving.levels[0];
            if !first {
                let beta: Vec<f32> = (0..charts)
                    .map(|c| {
                        // A chart that takes no part, or whose system is already solved, has no first step.
                        let first_alpha = directions.lengths[0][c];
                        let stepped = first_rz[c] != 0.0 && first_alpha != 0.0;
                        let (rz_before, alpha) =
                            if stepped { (first_rz[c], first_alpha) } else { (1.0, 1.0) };
                        let beta = (rz[c] / rz_before) as f32 / alpha;
                        if stepped && beta.is_finite() { beta } else { 0.0 }
                    })
                    .collect();
                let (direction, step) = (SharedSlice::new(direction), &*solving.step);
                self.each_block(level, nothing, |_, b, c| {
                    // SAFETY: each item has its own block.
                    dispatch(Direction { z: unsafe { direction.get_mut(b) }, x: &step[b], beta: beta[c] });
                });
            }
            let curvature = multigrid::multiply(self, level, rows, direction, product);
            let alpha: Vec<f32> = (0..charts)
                .map(|c| {
                    let alpha = (rz[c] / if curvature[c] > 0.0 { curvature[c] } else { 1.0 }) as f32;
                    // Take no step if the curvature is not positive, as when the system is already solved, or if a
                    // scalar is NaN.
                    if curvature[c] > 0.0 && alpha.is_finite() { alpha } else { 0.0 }
                })
                .collect();
            for c in 0..charts {
                predicted[c] += f64::from(alpha[c]) * rz[c];
            }
            let (step, residual) = (SharedSlice::new(solving.step), SharedSlice::new(residual));
            self.each_block(level, nothing, |_, b, c| {
                // SAFETY: each item has its own block.
                let (x, r) = unsafe { (step.get_mut(b), residual.get_mut(b)) };
                dispatch(Update { x, r, z: &direction[b], t: &product[b], alpha: alpha[c], first, last });
            });
            if first {
                first_rz = rz;
            }
            (directions.lengths[iteration], directions.curvatures[iteration]) = (alpha, curvature);
        }
        if has_last_step && iterations == 2 {
            self.add_last_step(level, solving, &directions, &mut predicted);
        }
        predicted
    }
}

/// Computes z += beta x in one block.
struct Direction<'a> {
    z: &'a mut [Plane; 2],
    x: &'a [Plane; 2],
    beta: f32,
}

impl Vectorised for Direction<'_> {
    type Output = ();

    #[inline(always)]
    fn run<V: Lanes>(self) {
        for (z, x) in self.z.iter_mut().zip(self.x) {
            for s in (0..NODES).step_by(LANES) {
                (V::load(z, s) + V::load(x, s) * self.beta).store(z, s);
            }
        }
    }
}

/// Computes x += alpha z and r -= alpha t in one block, where t = A z. `first`: x is overwritten with alpha z. `last`:
/// r is not needed any more and is not updated.
struct Update<'a> {
    x: &'a mut [Plane; 2],
    r: &'a mut [Plane; 2],
    z: &'a [Plane; 2],
    t: &'a [Plane; 3],
    alpha: f32,
    first: bool,
    last: bool,
}

impl Vectorised for Update<'_> {
    type Output = ();

    #[inline(always)]
    fn run<V: Lanes>(self) {
        let Update { x, r, z, t, alpha, first, last } = self;
        for c in 0..2 {
            for s in (0..NODES).step_by(LANES) {
                let step = V::load(&z[c], s) * alpha;
                let sum = if first { step } else { V::load(&x[c], s) + step };
                // Where f32 is too imprecise to solve the system, components may be huge or NaN; they become 0.
                let small = sum.lt(V::splat(MAX_STEP)).and(V::splat(-MAX_STEP).lt(sum));
                small.select(sum, V::zero()).store(&mut x[c], s);
                if !last {
                    (V::load(&r[c], s) - V::load(&t[c], s) * alpha).store(&mut r[c], s);
                }
            }
        }
    }
}
