//! Results read and judged independently of the solver, for tests and benches (cargo feature `lab`).

use std::sync::Arc;

use crate::allocation::{Collect, filled, zeroed};
use crate::asset::measure::gather;
use crate::asset::{Asset, torn};
use crate::cpu;
use crate::error::Result;
use crate::grid::planes::{NODES, SIDE, slot};
use crate::grid::pose::Pose;
use crate::lab::reference::minimise::Options;
use crate::lab::reference::{Minimum, Problem};
use crate::map::nodes;
use crate::mesh::{Chart, FacePoint, TileMesh, Triangle};
use crate::method::plan::{ChartResult, Input, Purpose};
use crate::method::stage::{Stage, Stages, Start};
use crate::view::Strided;

/// The converged f64 minimum of a tile's finest-level energy: the oracle of tests and benches.
#[derive(Clone, Debug)]
pub struct ReferenceMinimum {
    /// Displacements in cells, row by row from v = 0, (nx + 1) x (ny + 1).
    pub u: Vec<[f64; 2]>,
    /// The energy there.
    pub energy: f64,
    /// The smallest corner Jacobian: over 0.02, up to rounding.
    pub min_jacobian: f64,
    /// True if the gradient vanished, or no further gain was found.
    pub converged: bool,
}

/// Corners in the chart's plane, as UVs within the tile; and the vertices of the mesh with their weights that each of them is
/// on the surface.
pub type CollarTriangleInSpace = ([[f64; 2]; 3], [[(u32, f64); 3]; 3]);

/// The collar of a chart.
#[derive(Clone, Debug)]
pub struct CollarOfChart {
    /// A point of the chart, as UV within the tile.
    pub inside: [f64; 2],
    /// Nearer ones first.
    pub triangles: Vec<CollarTriangleInSpace>,
}

impl Asset {
    /// Displacements of the last result, in cells, row by row from v = 0, (nx + 1) x (ny + 1).
    ///
    /// # Errors
    /// `NotSolved` before the first solve.
    pub fn displacements(&self, tile: usize) -> Result<Vec<[f32; 2]>> {
        self.check_tile(tile)?;
        self.results.solved(tile).and_then(|result| nodes::dense(&result.solved))
    }

    /// Displacements of the last result, as [`Asset::displacements`] returns them, of each chart by itself: with its collar,
    /// which may lie over other charts.
    ///
    /// # Errors
    /// `NotSolved` before the first solve.
    pub fn displacements_of_charts(&self, tile: usize) -> Result<Vec<Vec<[f32; 2]>>> {
        self.check_tile(tile)?;
        let solved = self.results.solved(tile)?.solved;
        let level = &solved.grid.levels[0];
        let u = solved.warp.host()?;
        let width = level.nx + 1;
        let of_chart = |blocks: &std::ops::Range<usize>| {
            let mut dense = zeroed(width * (level.ny + 1));
            for b in blocks.clone() {
                let block = &level.blocks.list[b];
                for n in 0..NODES {
                    let (i, j) = (block.x as usize * SIDE + n % SIDE, block.y as usize * SIDE + n / SIDE);
                    if i <= level.nx && j <= level.ny {
                        dense[j * width + i] = [0, 1].map(|c| u[b][c][slot(n % SIDE, n / SIDE)]);
                    }
                }
            }
            dense
        };
        Ok(level.blocks.of_chart.iter().map(of_chart).collected())
    }

    /// What lies beyond the seams of each chart in the chart's own plane, as it was solved with: empty unless charts go on
    /// beyond seams. What is a mirror image beyond an open border is left out.
    ///
    /// # Errors
    /// `NotSolved` before the first solve.
    pub fn collars(&self, tile: usize) -> Result<Vec<CollarOfChart>> {
        self.check_tile(tile)?;
        let result = self.results.solved(tile)?;
        let Some(tile) = &result.solved.extended else { return Ok(Vec::new()) };
        let of_chart = |chart: &Chart| {
            let own = tile.triangles[chart.triangles.start].uv;
            let triangle = |t: usize| {
                let Triangle { local, uv, .. } = &tile.triangles[t];
                let point = |local: u32| match chart.vertices.get(local as usize) {
                    Some(&v) => [(v, 1.0), (v, 0.0), (v, 0.0)],
                    None => {
                        let FacePoint { vertices, weights, .. } =
                            chart.points[local as usize - chart.vertices.len()];
                        [0, 1, 2].map(|k| (vertices[k], weights[k]))
                    }
                };
                (uv.map(|uv| uv.to_array()), local.map(point))
            };
            let is_there = |t: &usize| !tile.is_image(*t as u32);
            let triangles = chart.collar.clone().filter(is_there).map(triangle).collected();
            CollarOfChart { inside: ((own[0] + own[1] + own[2]) / 3.0).to_array(), triangles }
        };
        Ok(tile.charts.iter().map(of_chart).collected())
    }

    /// The energy of a warp for a pose, computed in f64 by the reference.
    ///
    /// # Errors
    /// `InvalidArgument` for a pose that does not fit the mesh.
    pub fn reference_energy(&self, tile: usize, positions: Strided, u: &[[f64; 2]]) -> Result<f64> {
        self.check_tile(tile)?;
        let pose = gather(positions);
        let torn = self.in_pose(tile, &positions)?;
        Ok(Problem::new(&self.mesh, &torn, &self.tiles[tile].maps, &pose)?.energy(u))
    }

    /// The energies of the identity and of the last result on level 0, in f32 as the CPU computes them. The report has those
    /// of a coarser level where work has ended there.
    ///
    /// # Errors
    /// `NotSolved` before the first solve.
    pub fn energies_on_level_0(&self, tile: usize, positions: Strided) -> Result<[f64; 2]> {
        self.check_tile(tile)?;
        let result = self.results.solved(tile)?;
        let grid = &result.solved.grid;
        let anchor = result.solved.warp.host()?;
        let torn = self.in_pose(tile, &positions)?;
        let mesh = result.solved.extended.as_ref().unwrap_or(&torn);
        let pose = Pose::new(mesh, |v| positions.get3(v as usize), Some(&grid.rest));
        let charts: Vec<bool> = (0..mesh.charts.len()).map(|c| !grid.is_still(mesh, &pose, c)).collected();
        let input = Input {
            grid,
            mesh,
            pose: &pose,
            settings: &self.tiles[tile].maps.settings,
            // The stages below do not compute it.
            protect: 0.0,
            charts: &charts,
            continuation: 1.0,
            pull: 0.0,
        };
        let mut memory = cpu::Memory::new(grid, Purpose::default());
        let mut warp = filled([[0.0; NODES]; 2], anchor.len());
        Ok(self.device.team(|team| {
            let mut run = cpu::Run::new(team, &input, &mut memory, &mut warp, anchor);
            for stage in [
                Stage::Surface,
                Stage::Start { level: 0, from: Start::Previous },
                Stage::Certify { allow_folds: true },
            ] {
                run.run(&stage);
            }
            let sum = |of: fn(&ChartResult) -> f64| run.results.iter().map(of).sum();
            [sum(|chart| chart.energy_before), sum(|chart| chart.energy)]
        }))
    }

    /// The reference's minimum for a pose, descending from `start` (and, if `thorough`, from the identity too).
    ///
    /// # Errors
    /// `InvalidArgument` for a pose that does not fit the mesh.
    pub fn reference_minimum(
        &self,
        tile: usize,
        positions: Strided,
        start: Option<&[[f64; 2]]>,
        thorough: bool,
    ) -> Result<ReferenceMinimum> {
        self.check_tile(tile)?;
        let pose = gather(positions);
        let torn = self.in_pose(tile, &positions)?;
        let mut problem = Problem::new(&self.mesh, &torn, &self.tiles[tile].maps, &pose)?;
        let minimum = problem.minimise(start, &Options { thorough, ..Options::default() });
        let min_jacobian = problem.min_jacobian(&minimum.u);
        let Minimum { u, energy, converged, .. } = minimum;
        Ok(ReferenceMinimum { u, energy, min_jacobian, converged })
    }
    /// The tile with the connectivity of a pose.
    fn in_pose(&self, tile: usize, positions: &Strided) -> Result<Arc<TileMesh>> {
        self.check_vertices("positions", positions, 3)?;
        Ok(torn::in_pose(&self.mesh, tile, positions))
    }
}
