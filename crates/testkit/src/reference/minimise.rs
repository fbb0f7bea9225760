//! The minimum of one chart's energy E (method §4), by Gauss-Newton steps.
//!
//! Where features have too little room, the bound on J is active at the minimum. It is approached from inside by a
//! barrier of decreasing strength μ. The gradient of E with the barrier is that of E minus the gradients of the active
//! J, times multipliers >= 0; close to a minimum with the barrier, its norm is that of the gradient of E projected onto
//! the bounds.

use glam::DVec2;

use super::chart::{ChartProblem, DIM};
use super::energy::Shape;
use super::law::{BARRIER_WIDTH, BOUND};
use super::linear::{Multigrid, Stencil};
use super::step::State;
use vrtm_core::strain::exact::{Locator, Surface};

/// Stopping criteria and starts.
#[derive(Clone, Copy, Debug)]
pub struct Options {
    /// A chart has converged when its gradient's norm is at most this fraction of that at the identity ...
    pub tolerance: f64,
    /// ... or when three corrections in a row, each with its sweep, gain no more than this fraction of its energy each:
    /// the energy has kinks at the edges of triangles, and its gradient need not vanish at a minimum.
    pub stall: f64,
    /// Greatest number of corrections of a chart, per strength of the barrier.
    pub max_corrections: usize,
    /// True for several starts: the given one, if any, the identity by way of intermediate metrics, and the identity
    /// itself. The lowest result is kept, chart by chart. Crowded charts have many minima, a few per mille apart.
    pub thorough: bool,
}

impl Default for Options {
    fn default() -> Self {
        Options { tolerance: 1e-6, stall: 3e-7, max_corrections: 100, thorough: false }
    }
}

/// The result of the minimisation of one chart.
pub struct Descent {
    pub u: Vec<DVec2>,
    pub energy: f64,
    /// Norm of the (projected) gradient at the end and at the identity.
    pub gradient: f64,
    pub initial_gradient: f64,
    pub corrections: usize,
    pub converged: bool,
}

/// Intermediate metrics for a start from the identity: t in (1 - t) G_rest + t G_pose.
const STAGES: [f64; 3] = [0.25, 0.5, 0.75];

/// First strength of the barrier; a start from the identity itself may have a greater one.
const FIRST_BARRIER: f64 = 1e-3;
/// Last strength of the barrier.
const LAST_BARRIER: f64 = 1.1e-6;

/// The minimisation of one chart.
pub struct Minimiser<'a> {
    pub chart: ChartProblem,
    pub locator: &'a Locator,
    /// The surface with the metric (1 - t) G_rest + t G_pose, as a function of t.
    pub surface: &'a dyn Fn(f64) -> Surface<DIM>,
    pub options: Options,
}

impl Minimiser<'_> {
    /// Descends from `start`, or from the identity if `start` is `None`, or from all starts if `thorough`. Returns the
    /// lowest result.
    pub fn run(&mut self, start: Option<Vec<DVec2>>) -> Descent {
        let identity = vec![DVec2::ZERO; self.chart.movable.len()];
        let mut grid = Multigrid::new(self.chart.nx, self.chart.ny, &self.chart.movable);
        let last = (self.surface)(1.0);
        let shape = Shape { locator: self.locator, surface: &last };
        let samples = self.chart.samples(&shape, &identity);
        let initial_gradient = norm(&self.chart.gradient(&shape, &identity, &samples, None));
        let mut best = Descent {
            energy: self.chart.energy(&identity, &samples),
            u: identity.clone(),
            gradient: initial_gradient,
            initial_gradient,
            corrections: 0,
            converged: initial_gradient == 0.0,
        };
        // The pose is isometric: all of the energy is rounding.
        if best.energy <= 1e-20 * self.chart.edges.len() as f64 {
            best.converged = true;
            return best;
        }
        let energy_before = best.energy;
        let mut corrections = 0;
        let mut keep = |found: Descent| {
            corrections += found.corrections;
            if found.energy < best.energy {
                best = found;
            }
            best.corrections = corrections;
        };
        if let Some(start) = start.as_ref().filter(|s| s.iter().all(|u| u.is_finite())) {
            let inside = self.inside(start);
            keep(self.descend(&mut grid, &shape, inside, FIRST_BARRIER, initial_gradient));
        }
        if start.is_none() || self.options.thorough {
            let eased = self.ease(&mut grid, initial_gradient, identity.clone());
            keep(self.descend(&mut grid, &shape, eased, FIRST_BARRIER, initial_gradient));
        }
        if self.options.thorough {
            // With a barrier weaker than the forces at the start, nodes would jam at the bound.
            let typical = energy_before / self.chart.nodes.len() as f64;
            let barrier = FIRST_BARRIER.max(0.1 * typical).min(1.0);
            keep(self.descend(&mut grid, &shape, identity, barrier, initial_gradient));
        }
        best
    }

    /// Follows the minimum from the rest metric towards that of the pose: in a crowded chart the minimum reached
    /// depends on the path, and using the pose's metric at once drives nodes into the bound unnecessarily.
    fn ease(&mut self, grid: &mut Multigrid, initial: f64, mut u: Vec<DVec2>) -> Vec<DVec2> {
        for t in STAGES {
            let surface = (self.surface)(t);
            let shape = Shape { locator: self.locator, surface: &surface };
            self.chart.law.barrier = FIRST_BARRIER;
            let mut state = self.chart.state(&shape, u);
            self.newton(grid, &shape, &mut state, &Goal { gradient: 1e-3 * initial, stall: 1e-3, most: 8 });
            u = state.u;
        }
        u
    }

    /// A warp strictly inside the bounds: `start`, blended with the identity as little as necessary.
    fn inside(&self, start: &[DVec2]) -> Vec<DVec2> {
        let mut fraction = 0.0;
        loop {
            let u: Vec<DVec2> = start.iter().map(|u| u * (1.0 - fraction)).collect();
            if fraction >= 1.0 || self.chart.min_jacobian(&u) > BOUND + 1e-6 {
                return u;
            }
            fraction = (fraction * 2.0).clamp(1e-5, 1.0);
        }
    }

    /// Minimises with the barrier while its strength decreases, then evaluates E without it.
    fn descend(
        &mut self,
        grid: &mut Multigrid,
        shape: &Shape,
        u: Vec<DVec2>,
        mut barrier: f64,
        initial: f64,
    ) -> Descent {
        let mut state = self.chart.state(shape, u);
        let mut corrections = 0;
        let (gradient, converged);
        loop {
            let last = barrier <= LAST_BARRIER;
            self.chart.law.barrier = barrier.max(LAST_BARRIER);
            state.energy = self.chart.energy(&state.u, &state.samples);
            let loose =
                Goal { gradient: 1e-3 * initial, stall: 1e-4, most: self.options.max_corrections.min(20) };
            let goal = if last { self.options.goal(initial) } else { loose };
            let found = self.newton(grid, shape, &mut state, &goal);
            corrections += found.corrections;
            if last {
                (gradient, converged) = (found.gradient, found.converged);
                break;
            }
            // If no corner is within the barrier's width, the barrier is 0 and its strength does not matter.
            let room = self.chart.min_jacobian(&state.u) > BOUND + BARRIER_WIDTH;
            barrier *= if room { LAST_BARRIER } else { 0.25 };
        }
        self.chart.law.barrier = 0.0;
        let energy = self.chart.energy(&state.u, &state.samples);
        Descent { u: state.u, energy, gradient, initial_gradient: initial, corrections, converged }
    }

    /// Alternates Gauss-Newton steps and sweeps until the gradient is small, or until neither gains: E has kinks at the
    /// edges of triangles, and at a minimum on a kink the gradient is not small.
    fn newton(&self, grid: &mut Multigrid, shape: &Shape, state: &mut State, goal: &Goal) -> Outcome {
        let chart = &self.chart;
        let mut last = state.u.clone();
        let mut damping = 0.0;
        let mut stalled = 0;
        let mut out = Outcome { gradient: f64::INFINITY, corrections: 0, converged: false };
        loop {
            let gradient = chart.gradient(shape, &state.u, &state.samples, Some(grid.matrix()));
            out.gradient = norm(&gradient);
            if out.gradient <= goal.gradient || stalled >= 3 {
                out.converged = true;
                return out;
            }
            if out.corrections >= goal.most {
                return out;
            }
            damp(grid.matrix(), &chart.nodes, damping);
            grid.prepare();
            let minus: Vec<DVec2> = gradient.iter().map(|g| -g).collect();
            let mut step = grid.solve(&minus, 1e-3, 150);
            chart.limit(&state.u, &mut step);
            out.corrections += 1;
            let before = state.energy;
            let taken = self.search(shape, state, &step);
            damping = match taken {
                a if a >= 1.0 => damping * 0.25,
                a if a > 0.2 => damping,
                _ => (damping * 4.0f64).max(1e-3),
            };
            if damping < 1e-5 {
                damping = 0.0;
            }
            chart.sweep(shape, state, out.corrections.is_multiple_of(2));
            let change: Vec<DVec2> = state.u.iter().zip(&last).map(|(u, l)| u - l).collect();
            last.copy_from_slice(&state.u);
            self.extrapolate(shape, state, &change);
            let gain = before - state.energy;
            stalled = if gain <= goal.stall * state.energy { stalled + 1 } else { 0 };
        }
    }

    /// Repeats the joint change of the last correction and sweep, half of it first and twice as much each time, while
    /// the energy falls. The part of the curvature that Gauss-Newton leaves out is negative where crowded features
    /// buckle: there its steps are too short, in the same direction again and again.
    fn extrapolate(&self, shape: &Shape, state: &mut State, step: &[DVec2]) {
        let mut fraction = 0.5;
        while let Some(trial) = self.trial(shape, state, step, fraction) {
            *state = trial;
            fraction *= 2.0;
        }
    }

    /// The state after a fraction of a step, if it is inside the bounds and its energy is lower.
    fn trial(&self, shape: &Shape, state: &State, step: &[DVec2], fraction: f64) -> Option<State> {
        let u: Vec<DVec2> = state.u.iter().zip(step).map(|(u, s)| u + fraction * s).collect();
        if self.chart.min_jacobian(&u) <= BOUND {
            return None;
        }
        let trial = self.chart.state(shape, u);
        (trial.energy < state.energy).then_some(trial)
    }

    /// Applies a fraction of a step that lowers the energy, found by halving. Returns the fraction, or 0 if no fraction
    /// lowers it.
    fn search(&self, shape: &Shape, state: &mut State, step: &[DVec2]) -> f64 {
        let mut fraction = 1.0;
        for _ in 0..8 {
            if let Some(trial) = self.trial(shape, state, step, fraction) {
                *state = trial;
                return fraction;
            }
            fraction *= 0.5;
        }
        0.0
    }
}

/// Termination criteria of a descent.
struct Goal {
    /// Norm of the gradient.
    gradient: f64,
    /// See `Options`.
    stall: f64,
    /// Greatest number of corrections.
    most: usize,
}

impl Options {
    fn goal(&self, initial: f64) -> Goal {
        Goal { gradient: self.tolerance * initial, stall: self.stall, most: self.max_corrections }
    }
}

struct Outcome {
    gradient: f64,
    corrections: usize,
    converged: bool,
}

/// Levenberg-Marquardt damping: multiplies the diagonal blocks by 1 + damping.
fn damp(matrix: &mut [Stencil], nodes: &[u32], damping: f64) {
    if damping > 0.0 {
        for &n in nodes {
            matrix[n as usize][4].iter_mut().for_each(|x| *x *= 1.0 + damping);
        }
    }
}

fn norm(g: &[DVec2]) -> f64 {
    g.iter().flat_map(DVec2::to_array).map(|x| x * x).sum::<f64>().sqrt()
}
