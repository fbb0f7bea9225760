//! Results read and judged independently of the solver, for tests and benches.

use std::ops::Range;

use vrtm::Asset;
use vrtm_core::error::Result;
use vrtm_core::grid::planes::{NODES, SIDE, slot};
use vrtm_core::mesh::{Chart, FacePoint, Triangle};
use vrtm_core::view::Strided;

use crate::reference::minimise::Options;
use crate::reference::{Minimum, Problem};

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

/// Corners in the chart's plane, as UVs within the tile; and the vertices of the mesh with their weights that each of
/// them is on the surface.
pub type CollarTriangleInSpace = ([[f64; 2]; 3], [[(u32, f64); 3]; 3]);

/// The collar of a chart: copies of the surface beyond its borders.
#[derive(Clone, Debug)]
pub struct CollarOfChart {
    /// A point of the chart, as UV within the tile.
    pub inside: [f64; 2],
    /// Nearer ones first.
    pub triangles: Vec<CollarTriangleInSpace>,
}

/// Access for tests and benches to an asset's inner state.
pub trait Lab {
    /// Displacements of the last result, in cells, row by row from v = 0, (nx + 1) x (ny + 1).
    fn displacements(&self, tile: usize) -> Result<Vec<[f32; 2]>>;

    /// Displacements of the last result, as [`Lab::displacements`] returns them, of each chart by itself: with its
    /// collar, which may lie over other charts.
    fn displacements_of_charts(&self, tile: usize) -> Result<Vec<Vec<[f32; 2]>>>;

    /// The collar of each chart in the chart's own plane, as it was solved with: empty unless charts continue
    /// beyond seams. Mirror images beyond open borders are left out.
    fn collars(&self, tile: usize) -> Result<Vec<CollarOfChart>>;

    /// The energy of a warp for a pose, computed in f64 by the reference.
    fn reference_energy(&self, tile: usize, positions: Strided, u: &[[f64; 2]]) -> Result<f64>;

    /// The reference's minimum for a pose, descending from `start` (and, if `thorough`, from the identity too).
    fn reference_minimum(
        &self,
        tile: usize,
        positions: Strided,
        start: Option<&[[f64; 2]]>,
        thorough: bool,
    ) -> Result<ReferenceMinimum>;
}

impl Lab for Asset {
    fn displacements(&self, tile: usize) -> Result<Vec<[f32; 2]>> {
        Ok(self.result_inside(tile)?.dense_displacements()?.into())
    }

    fn displacements_of_charts(&self, tile: usize) -> Result<Vec<Vec<[f32; 2]>>> {
        let result = self.result_inside(tile)?;
        let level = &result.grid().levels[0];
        let u = result.displacements()?;
        let width = level.nx + 1;
        let of_chart = |blocks: &Range<usize>| {
            let mut dense = vec![[0.0; 2]; width * (level.ny + 1)];
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
        Ok(level.blocks.of_chart.iter().map(of_chart).collect())
    }

    fn collars(&self, tile: usize) -> Result<Vec<CollarOfChart>> {
        let result = self.result_inside(tile)?;
        let Some(tile) = result.extended() else { return Ok(Vec::new()) };
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
            let triangles = chart.collar.clone().filter(is_there).map(triangle).collect();
            CollarOfChart { inside: ((own[0] + own[1] + own[2]) / 3.0).to_array(), triangles }
        };
        Ok(tile.charts.iter().map(of_chart).collect())
    }

    fn reference_energy(&self, tile: usize, positions: Strided, u: &[[f64; 2]]) -> Result<f64> {
        let pose = gather(positions);
        let inside = self.tile_inside(tile, &positions)?;
        Ok(Problem::new(inside.mesh, &inside.tile, inside.maps, &pose)?.energy(u))
    }

    fn reference_minimum(
        &self,
        tile: usize,
        positions: Strided,
        start: Option<&[[f64; 2]]>,
        thorough: bool,
    ) -> Result<ReferenceMinimum> {
        let pose = gather(positions);
        let inside = self.tile_inside(tile, &positions)?;
        let mut problem = Problem::new(inside.mesh, &inside.tile, inside.maps, &pose)?;
        let minimum = problem.minimise(start, &Options { thorough, ..Options::default() });
        let min_jacobian = problem.min_jacobian(&minimum.u);
        let Minimum { u, energy, converged, .. } = minimum;
        Ok(ReferenceMinimum { u, energy, min_jacobian, converged })
    }
}

fn gather(positions: Strided) -> Vec<[f64; 3]> {
    (0..positions.len()).map(|v| positions.get3(v)).collect()
}
