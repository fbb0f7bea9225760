//! Looks at results from outside the solver: the strain on the mesh, and the f64 reference.

use super::{Asset, fetch, not_solved};
use crate::error::Result;
use crate::oracle::measure::measure;
use crate::oracle::reference::{Options, Problem};
use crate::tile::coverage::Coverage;
use crate::tile::node_maps;
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
    /// True if the gradient vanished, or nothing more was gained.
    pub converged: bool,
}

impl Asset {
    /// Fills the strain of every tile's report.
    pub(super) fn measure(&mut self, positions: Strided) -> Result<()> {
        let pose = gather(positions);
        for (tile, state) in self.tiles.iter_mut().enumerate() {
            let Some(solved) = &mut state.solved else { continue };
            let mesh = &self.mesh.tiles[tile];
            let level = &solved.grid.levels[0];
            let coverage = Coverage::new(mesh, level.nx, level.ny, state.maps.settings.overlap);
            let maps = node_maps(&self.mesh, mesh, &state.maps, &coverage);
            let nodes = fetch::dense(solved)?;
            let width = level.nx + 1;
            let strain = measure(&self.mesh, tile, &coverage, &maps, &pose, &|i, j| nodes[j * width + i]);
            solved.report.strain = Some(strain);
        }
        Ok(())
    }

    /// Displacements of the last result, in cells, row by row from v = 0, (nx + 1) x (ny + 1).
    ///
    /// # Errors
    /// `NotSolved` before the first solve.
    #[doc(hidden)]
    pub fn displacements(&self, tile: usize) -> Result<Vec<[f32; 2]>> {
        self.check_tile(tile)?;
        self.tiles[tile].solved.as_ref().ok_or_else(not_solved).and_then(fetch::dense)
    }

    /// The energy of a warp for a pose, in f64 by the reference.
    ///
    /// # Errors
    /// `InvalidArgument` for a pose that does not fit the mesh.
    #[doc(hidden)]
    pub fn reference_energy(&self, tile: usize, positions: Strided, u: &[[f64; 2]]) -> Result<f64> {
        self.check_tile(tile)?;
        let pose = gather(positions);
        Ok(Problem::new(&self.mesh, tile, &self.tiles[tile].maps, &pose)?.energy(u))
    }

    /// The reference's minimum for a pose, descending from `start` (and, if `thorough`, from the identity too).
    ///
    /// # Errors
    /// `InvalidArgument` for a pose that does not fit the mesh.
    #[doc(hidden)]
    pub fn reference_minimum(
        &self,
        tile: usize,
        positions: Strided,
        start: Option<&[[f64; 2]]>,
        thorough: bool,
    ) -> Result<ReferenceMinimum> {
        self.check_tile(tile)?;
        let pose = gather(positions);
        let mut problem = Problem::new(&self.mesh, tile, &self.tiles[tile].maps, &pose)?;
        let minimum = problem.minimise(start, &Options { thorough, ..Options::default() });
        let min_jacobian = problem.min_jacobian(&minimum.u);
        let crate::oracle::reference::Minimum { u, energy, converged, .. } = minimum;
        Ok(ReferenceMinimum { u, energy, min_jacobian, converged })
    }
}

fn gather(positions: Strided) -> Vec<[f64; 3]> {
    (0..positions.len()).map(|v| positions.get3(v)).collect()
}
