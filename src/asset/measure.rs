//! Measures the strain of a result on the mesh, for reports.

use std::sync::Arc;

use super::Asset;
use crate::map::nodes;
use crate::solved::Solved;
use vrtm_core::allocation::Vec;
use vrtm_core::error::Result;
use vrtm_core::grid::coverage::{NodeMaps, node_maps};
use vrtm_core::grid::planes::{NODES, SIDE, slot};
use vrtm_core::strain::measure;
use vrtm_core::team::Team;
use vrtm_core::view::Strided;

/// Bytes of what a measurement holds per node of a grid, also where nothing moves: coverage, maps, displacements,
/// positions at rest and in the pose, features.
const BYTES_PER_NODE: u64 = 170;

impl Asset {
    /// Fills in the strain of the reports of solved tiles.
    pub(super) fn measure(
        &self,
        team: &Team,
        positions: Strided,
        tiles: &[(usize, Arc<Solved>)],
        published: &mut [Option<Solved>],
    ) -> Result<()> {
        let pose: Vec<[f64; 3]> = (0..positions.len()).map(|v| positions.get3(v)).collect();
        for ((tile, result), published) in tiles.iter().zip(published) {
            let solved = published.get_or_insert_with(|| result.with_warp(result.warp.clone()));
            team.check_or_unwind();
            let given = &self.given.maps[*tile];
            let mesh = &*solved.mesh;
            let level = &solved.grid.levels[0];
            let mut booked = self.device.booking();
            booked.set(BYTES_PER_NODE * ((level.nx + 1) * (level.ny + 1)) as u64, &mesh.name())?;
            let mut maps = node_maps(mesh, given, [level.nx, level.ny]);
            if solved.extended.is_some() {
                set_movable(&mut maps, solved);
            }
            let nodes = nodes::dense(solved)?;
            let width = level.nx + 1;
            let tile = solved.extended.as_deref().unwrap_or(mesh);
            let strain = measure(&self.mesh, tile, &maps, &pose, &|i, j| nodes[j * width + i]);
            solved.report.strain = Some(strain);
        }
        Ok(())
    }
}

/// Sets which nodes of charts may move to those of a result with collars.
fn set_movable(maps: &mut NodeMaps, solved: &Solved) {
    let level = &solved.grid.levels[0];
    for (b, block) in level.blocks.list.iter().enumerate().filter(|(_, block)| block.active) {
        for n in 0..NODES {
            let (i, j) = (block.x as usize * SIDE + n % SIDE, block.y as usize * SIDE + n / SIDE);
            let s = slot(n % SIDE, n / SIDE);
            if level.movable[b][s] != 0 && (solved.grid.triangle[b][s] as usize) < solved.mesh.own() {
                maps.chart[j * (level.nx + 1) + i] = block.chart;
            }
        }
    }
}
