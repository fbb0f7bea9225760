//! Measures the strain of a result on the mesh, for reports.

use super::Asset;
use crate::allocation::Collect;
use crate::error::Result;
use crate::grid::coverage::{Coverage, node_maps};
use crate::map::nodes;
use crate::solver::solved::Solved;
use crate::strain::measure;
use crate::team::Team;
use crate::view::Strided;

impl Asset {
    /// Fills in the strain of the reports of solved tiles.
    pub(super) fn measure(
        &self,
        team: &Team,
        positions: Strided,
        tiles: &mut [(usize, Solved)],
    ) -> Result<()> {
        let pose = gather(positions);
        for (tile, solved) in tiles {
            team.check_or_unwind();
            let state = &self.tiles[*tile];
            let mesh = &*solved.mesh;
            let level = &solved.grid.levels[0];
            let coverage = Coverage::new(mesh, level.nx, level.ny, state.maps.settings.overlap);
            let maps = node_maps(mesh, &state.maps, [level.nx, level.ny]);
            let nodes = nodes::dense(solved)?;
            let width = level.nx + 1;
            let strain = measure(&self.mesh, mesh, &coverage, &maps, &pose, &|i, j| nodes[j * width + i]);
            solved.report.strain = Some(strain);
        }
        Ok(())
    }
}

/// The positions in the format of the measurement.
pub(crate) fn gather(positions: Strided) -> Vec<[f64; 3]> {
    (0..positions.len()).map(|v| positions.get3(v)).collected()
}
