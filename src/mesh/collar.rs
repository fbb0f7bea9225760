//! What lies beyond a chart's border on the surface, laid into the chart's own UV plane: its *collar*. Across a seam the
//! surface goes on elsewhere in the UV plane; the collar is a copy of that part of it, continued from the seam with as
//! little change of shape as possible. It depends on the rest pose alone.

mod flatten;
mod patch;
mod surface;

use std::ops::Range;

use glam::DVec2;

use crate::mesh::Mesh;
use crate::team::Team;
use surface::Surface;

/// The collar of a chart has this many bands of equal width, each laid out after the ones nearer to the border: what is far
/// away must not bend what is near.
const BANDS: usize = 6;

/// A triangle of a collar.
#[derive(Clone, Copy, Debug)]
pub(crate) struct CollarTriangle {
    /// Its corners in the chart's plane, as UVs within the chart's tile.
    pub uv: [DVec2; 3],
    /// The same points of the surface where the mesh has them: UVs in the plane of all tiles.
    pub source: [DVec2; 3],
    /// Their distances from the chart's border, along the surface, as lengths in the chart's plane.
    pub distance: [f64; 3],
}

/// The collars of all charts of a tile, out to `reach`, a length in UV.
pub(crate) fn collars(team: &Team, mesh: &Mesh, tile: usize, reach: f64) -> Vec<Vec<CollarTriangle>> {
    let surface = Surface::new(mesh, tile);
    team.map(mesh.tiles[tile].charts.len(), |chart| collar(&surface, chart, reach))
}

fn collar(surface: &Surface, chart: usize, reach: f64) -> Vec<CollarTriangle> {
    let scale = surface.scale(chart);
    if !(scale > 0.0 && scale.is_finite()) {
        return Vec::new();
    }
    let region = surface.region(chart, reach / scale);
    let patch = patch::Patch::new(surface, &region, reach / scale / BANDS as f64);
    flatten::flatten(&patch, reach / scale, scale)
}

/// The tiles of the UV set of a tile.
fn tiles_of_set(mesh: &Mesh, tile: usize) -> Range<usize> {
    let set = mesh.tiles[tile].uv_set;
    mesh.tiles.partition_point(|t| t.uv_set < set)..mesh.tiles.partition_point(|t| t.uv_set <= set)
}

#[cfg(test)]
mod tests;
