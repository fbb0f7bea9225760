//! The reference solver (method §11.2): it minimises the energy of level 0 (method §4), with exact chords, in f64 and
//! on one thread, from the mesh, the maps and a pose. The solver's results are compared with its minima; the two share
//! no numerical code.
//!
//! A warp is stored for all nodes: node (i, j) of the tile's (nx + 1) x (ny + 1) nodes has the index
//! `j * (nx + 1) + i`, and displacements are in cells.

pub mod chart;
pub mod energy;
pub mod law;
pub mod linear;
pub mod minimise;
pub mod step;

use glam::DVec2;

use chart::{ChartProblem, DIM};
use energy::Shape;
use minimise::{Minimiser, Options};
use vrtm_core::error::{Result, ensure};
use vrtm_core::grid::coverage::node_maps;
use vrtm_core::grid::maps::TileMaps;
use vrtm_core::mesh::{Mesh, TileMesh};
use vrtm_core::strain::exact::{Locator, Surface};

/// The minimum that was found.
#[derive(Clone, Debug)]
pub struct Minimum {
    /// The warp.
    pub u: Vec<[f64; 2]>,
    /// Its energy, over all charts.
    pub energy: f64,
    /// Norm of the gradient over all charts, projected onto the active bounds.
    pub gradient_norm: f64,
    /// This norm at the identity.
    pub initial_gradient_norm: f64,
    /// Gauss-Newton steps, over all charts.
    pub corrections: usize,
    /// True if every chart converged.
    pub converged: bool,
}

/// A tile with its maps and a pose.
pub struct Problem<'a> {
    pub nx: usize,
    pub ny: usize,
    mesh: &'a Mesh,
    tile: &'a TileMesh,
    pub locator: Locator,
    /// Per chart with movable nodes, its problem.
    pub charts: Vec<Option<ChartProblem>>,
    pose: &'a [[f64; 3]],
}

impl<'a> Problem<'a> {
    /// # Errors
    /// `InvalidArgument` unless `pose` has one finite position per vertex.
    pub fn new(
        mesh: &'a Mesh,
        tile: &'a TileMesh,
        maps: &TileMaps,
        pose: &'a [[f64; 3]],
    ) -> Result<Problem<'a>> {
        let (given, needed) = (pose.len(), mesh.rest.len());
        ensure!(given == needed, "pose: {given} positions, but the mesh has {needed}");
        for (v, p) in pose.iter().enumerate() {
            ensure!(p.iter().all(|x| x.is_finite()), "pose[{v}]: not finite");
        }
        let [nx, ny] = maps.grid_size();
        let mut nodes = node_maps(tile, maps, [nx, ny]);
        let locator = Locator::new(tile, nx, ny, std::mem::take(&mut nodes.triangle));
        let rest = Surface::new(tile, &locator, |v| mix(mesh.rest[v], pose[v], 0.0));
        let charts = chart::problems(tile.charts.len(), &nodes, &locator, &rest, &maps.settings);
        Ok(Problem { nx, ny, mesh, tile, locator, charts, pose })
    }

    /// The energy of a warp, over all charts.
    pub fn energy(&self, u: &[[f64; 2]]) -> f64 {
        let surface = self.surface(1.0);
        let shape = Shape { locator: &self.locator, surface: &surface };
        let charts = self.charts.iter().flatten();
        charts.map(|chart| chart.state(&shape, self.window(chart, u)).energy).sum()
    }

    /// The smallest corner Jacobian over all charts, at most 1; 1 without movable nodes.
    pub fn min_jacobian(&self, u: &[[f64; 2]]) -> f64 {
        let charts = self.charts.iter().flatten();
        charts.map(|p| p.min_jacobian(&self.window(p, u))).fold(f64::INFINITY, f64::min).min(1.0)
    }

    /// Descends to a minimum from `start`, or from the identity if `start` is `None`.
    pub fn minimise(&mut self, start: Option<&[[f64; 2]]>, options: &Options) -> Minimum {
        let mut out = Minimum {
            u: vec![[0.0; 2]; (self.nx + 1) * (self.ny + 1)],
            energy: 0.0,
            gradient_norm: 0.0,
            initial_gradient_norm: 0.0,
            corrections: 0,
            converged: true,
        };
        for c in 0..self.charts.len() {
            let Some(chart) = self.charts[c].take() else { continue };
            let surface = |t: f64| self.surface(t);
            let start = start.map(|u| self.window(&chart, u));
            let mut minimiser =
                Minimiser { chart, locator: &self.locator, surface: &surface, options: *options };
            let found = minimiser.run(start);
            let chart = minimiser.chart;
            for &n in &chart.nodes {
                let [i, j] = chart.node(n as usize);
                out.u[j * (self.nx + 1) + i] = found.u[n as usize].into();
            }
            out.energy += found.energy;
            out.gradient_norm = out.gradient_norm.hypot(found.gradient);
            out.initial_gradient_norm = out.initial_gradient_norm.hypot(found.initial_gradient);
            out.corrections += found.corrections;
            out.converged &= found.converged;
            self.charts[c] = Some(chart);
        }
        out
    }

    /// The surface with the metric (1 - t) G_rest + t G_pose.
    pub fn surface(&self, t: f64) -> Surface<DIM> {
        Surface::new(self.tile, &self.locator, |v| mix(self.mesh.rest[v], self.pose[v], t))
    }

    /// The displacements of a warp in a chart's rectangle; 0 at nodes that are fixed.
    pub fn window(&self, chart: &ChartProblem, u: &[[f64; 2]]) -> Vec<DVec2> {
        let at = |n: usize| {
            let [i, j] = chart.node(n);
            DVec2::from(u[j * (self.nx + 1) + i])
        };
        (0..chart.movable.len()).map(|n| if chart.movable[n] { at(n) } else { DVec2::ZERO }).collect()
    }
}

/// A vertex of the surface whose metric is (1 - t) G_rest + t G_pose.
fn mix(rest: [f64; 3], pose: [f64; 3], t: f64) -> [f64; DIM] {
    let (r, p) = ((1.0 - t).sqrt(), t.sqrt());
    [r * rest[0], r * rest[1], r * rest[2], p * pose[0], p * pose[1], p * pose[2]]
}
