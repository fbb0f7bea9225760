//! Results read and judged independently of the solver, for tests and benches (cargo feature `lab`).

use std::sync::Arc;

use crate::asset::measure::gather;
use crate::asset::{Asset, torn};
use crate::error::Result;
use crate::lab::reference::minimise::Options;
use crate::lab::reference::{Minimum, Problem};
use crate::map::nodes;
use crate::mesh::TileMesh;
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

impl Asset {
    /// Displacements of the last result, in cells, row by row from v = 0, (nx + 1) x (ny + 1).
    ///
    /// # Errors
    /// `NotSolved` before the first solve.
    pub fn displacements(&self, tile: usize) -> Result<Vec<[f32; 2]>> {
        self.check_tile(tile)?;
        self.results.solved(tile).and_then(|result| nodes::dense(&result.solved))
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
