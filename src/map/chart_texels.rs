//! Finds the texels of an image whose centre lies in a chart.

use glam::DVec2;

use vrtm_core::allocation::{Vec, zeroed};
use vrtm_core::grid::fill::Fill;
use vrtm_core::image::ImagePart;
use vrtm_core::mesh::TileMesh;
use vrtm_core::team::Team;

/// Rows that one item of work draws.
pub(crate) const BAND: usize = 64;

/// Per texel of a part of an image, true if its centre lies in a chart or on its border.
pub(crate) struct ChartTexels {
    width: usize,
    /// Bands of rows, from v = 0 upward.
    bands: Vec<Vec<bool>>,
}

impl ChartTexels {
    /// Starts with texels that no chart covers.
    pub fn new(part: &ImagePart) -> ChartTexels {
        let [width, height] = part.extent();
        let rows = |band: usize| BAND.min(height - band * BAND);
        let bands = (0..height.div_ceil(BAND)).map(|band| zeroed(rows(band) * width)).collect();
        ChartTexels { width, bands }
    }

    /// Draws a tile's charts.
    pub fn draw(&mut self, team: &Team, mesh: &TileMesh, part: &ImagePart) {
        let (width, size) = (self.width, part.size);
        team.fill_large(&mut self.bands, |band, texels| {
            let first = [part.first[0], part.first[1] + band * BAND];
            let end = [part.end[0], first[1] + texels.len() / width];
            for triangle in &mesh.triangles {
                let corners = triangle.uv.map(|uv| uv * DVec2::new(size[0] as f64, size[1] as f64) - 0.5);
                Fill::new(corners).visit_in(first, end, |x, y, _| {
                    texels[(y - first[1]) * width + x - first[0]] = true;
                });
            }
        });
    }

    /// A row of the part.
    pub fn row(&self, y: usize) -> &[bool] {
        &self.bands[y / BAND][y % BAND * self.width..][..self.width]
    }
}
