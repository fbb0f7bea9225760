//! What lies beyond a chart's border on the surface, laid into the chart's own UV plane: its *collar*. Across a seam the
//! surface goes on elsewhere in the UV plane; the collar is a copy of that part of it, continued from the seam with as
//! little change of shape as possible. Beyond an open border the surface goes on with its mirror image, if that is asked
//! for: what is the same on both sides of a border can only slide along it. The collar depends on the rest pose alone.

mod flatten;
mod patch;
mod surface;

use flatten::BANDS;
#[cfg(test)]
use flatten::CollarTriangle;
pub use flatten::{Across, Collar};
use surface::Surface;
use vrtm_core::allocation::Vec;
use vrtm_core::mesh::Mesh;
use vrtm_core::settings::Beyond;
use vrtm_core::team::Team;

/// The largest reach of a chart's collar on the surface, in sides of a square of the chart's area.
const WIDEST: f64 = 4.0;

/// The collars of all charts of a tile.
pub fn collars(team: &Team, mesh: &Mesh, tile: usize, beyond: &Beyond) -> Vec<Collar> {
    let surface = Surface::new(mesh, tile, beyond);
    team.map(mesh.tiles[tile].charts.len(), |chart| collar(&surface, chart, beyond.reach))
}

fn collar(surface: &Surface, chart: usize, reach: f64) -> Collar {
    let [scale, side] = surface.size(chart);
    if !(scale > 0.0 && scale.is_finite()) {
        return Collar::default();
    }
    // A chart that is shrunk to a dot in the UV plane must not drag the whole mesh after it.
    let reach = (reach / scale).min(WIDEST * side);
    let region = surface.region(chart, reach);
    let patch = patch::Patch::new(surface, &region, reach / BANDS as f64);
    flatten::flatten(surface, &patch, reach, scale)
}

#[cfg(test)]
pub(crate) mod tests;
