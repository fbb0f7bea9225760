//! Steps that keep every corner Jacobian above the bound: relaxation of one node (compare method §6), and the limit on
//! a step of all nodes (compare method §7.6).

use glam::DVec2;

use super::chart::ChartProblem;
use super::energy::{Sample, Shape};
use super::law::BOUND;
use super::linear::{inverse, times};

/// A step takes a corner Jacobian at most this fraction of the way to the bound, so that the barrier stays finite.
const MAX_APPROACH: f64 = 0.9;

/// A warp during the minimisation, with its samples and energy.
pub struct State {
    pub u: Vec<DVec2>,
    pub samples: Vec<Sample>,
    pub energy: f64,
}

impl ChartProblem {
    /// The state of a warp.
    pub fn state(&self, shape: &Shape, u: Vec<DVec2>) -> State {
        let samples = self.samples(shape, &u);
        let energy = self.energy(&u, &samples);
        State { u, samples, energy }
    }

    /// Least corner Jacobian that counts; infinite if none does.
    pub fn min_jacobian(&self, u: &[DVec2]) -> f64 {
        let mut least = f64::INFINITY;
        self.each_jacobian(u, |j| least = least.min(j));
        least
    }

    /// Relaxes every node in turn.
    pub fn sweep(&self, shape: &Shape, state: &mut State, backward: bool) {
        let count = self.nodes.len();
        for k in 0..count {
            let n = self.nodes[if backward { count - 1 - k } else { k }] as usize;
            self.relax(shape, state, n);
        }
        state.energy = self.energy(&state.u, &state.samples);
    }

    /// One node takes its own Gauss-Newton step, limited by the bound, if the energy of its edges and corners falls.
    fn relax(&self, shape: &Shape, state: &mut State, n: usize) {
        let (g, h) = self.node_system(shape, &state.samples, &state.u, n);
        let step = -times(&inverse(&h), g);
        if step == DVec2::ZERO {
            return;
        }
        // J is affine in one node's displacement: the step at which it reaches the bound is exact.
        let mut scale: f64 = 1.0;
        for corner in self.corners_of(n) {
            let (j, slopes) = corner.jacobian(corner.nodes.map(|m| state.u[m]), corner.rest());
            let at = corner.nodes.iter().position(|&m| m == n).unwrap_or(0);
            let fall = -slopes[at].dot(step);
            if fall > 0.0 {
                scale = scale.min(MAX_APPROACH * (j - BOUND).max(0.0) / fall);
            }
        }
        let old = self.node_energy(&state.samples, &state.u, n, state.u[n], &state.samples[n]);
        for _ in 0..6 {
            let at = state.u[n] + scale * step;
            let sample = self.sample(shape, n, at);
            if self.node_energy(&state.samples, &state.u, n, at, &sample) < old {
                state.u[n] = at;
                state.samples[n] = sample;
                return;
            }
            scale *= 0.5;
        }
    }

    /// Scales a step of all nodes by a factor per node: it is multiplied by 0.7 at corners whose Jacobian would fall
    /// too far, and falls off smoothly, so that a crowded corner does not hold up the rest of the chart.
    pub fn limit(&self, u: &[DVec2], step: &mut [DVec2]) {
        let mut factor = vec![1.0f64; u.len()];
        // Factors shrink by 0.7 per round, to 2e-5 in thirty; the line search rejects a step that is still too long.
        for _ in 0..30 {
            let mut crossed = false;
            for &cell in &self.cells {
                for corner in self.corners(cell as usize).filter(|&c| self.counts(c)) {
                    let moved = corner.nodes.map(|n| u[n] + factor[n] * step[n]);
                    let before = corner.jacobian(corner.nodes.map(|n| u[n]), corner.rest()).0;
                    let after = corner.jacobian(moved, corner.rest()).0;
                    if after - BOUND < (1.0 - MAX_APPROACH) * (before - BOUND).min(0.1) {
                        crossed = true;
                        for n in corner.nodes {
                            factor[n] *= 0.7;
                        }
                    }
                }
            }
            if !crossed {
                break;
            }
            self.smooth(&mut factor);
        }
        for (s, f) in step.iter_mut().zip(&factor) {
            *s *= *f;
        }
    }

    /// Lowers factors so that none exceeds that of a neighbour by more than 0.1.
    fn smooth(&self, factor: &mut [f64]) {
        let width = self.width();
        let mut lower = |n: usize, m: usize| factor[n] = factor[n].min(factor[m] + 0.1);
        for &n in &self.nodes {
            let n = n as usize;
            [n - 1, n - width - 1, n - width, n - width + 1].into_iter().for_each(|m| lower(n, m));
        }
        for &n in self.nodes.iter().rev() {
            let n = n as usize;
            [n + 1, n + width - 1, n + width, n + width + 1].into_iter().for_each(|m| lower(n, m));
        }
    }
}
