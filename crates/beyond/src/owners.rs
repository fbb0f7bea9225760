//! Which chart the texels of an image or the nodes of a grid belong to, if charts go on beyond their seams and may lie over
//! one another there.

use glam::DVec2;

use vrtm_core::allocation::{Vec, vec};
use vrtm_core::grid::fill::Fill;
use vrtm_core::image::ImagePart;
use vrtm_core::mesh::triangle::barycentrics;
use vrtm_core::mesh::{NONE, TileMesh};
use vrtm_core::team::Team;

/// Rows that one item of work draws.
const BAND: usize = 64;

/// Per texel of a part of an image, the chart that its centre lies in, or per node of a grid. Beside all charts it is the one whose border is
/// nearest on the surface, if its collar lies there.
pub struct Owners {
    width: usize,
    /// Bands of rows, from v = 0 upward.
    bands: Vec<Vec<Owner>>,
}

#[derive(Clone, Copy)]
struct Owner {
    chart: u32,
    /// Distance from the border; 0 inside of a chart.
    distance: f32,
}

const NOBODY: Owner = Owner { chart: NONE, distance: f32::INFINITY };

impl Owners {
    /// The owners of the texels of a part: nobody, before they are drawn.
    pub fn new(part: &ImagePart) -> Owners {
        let [width, height] = part.extent();
        let rows = |band: usize| BAND.min(height - band * BAND);
        let bands = (0..height.div_ceil(BAND)).map(|band| vec![NOBODY; rows(band) * width]).collect();
        Owners { width, bands }
    }

    /// Draws the charts of a tile with collars on the texels of a part.
    pub fn draw(&mut self, team: &Team, tile: &TileMesh, part: &ImagePart) {
        let size = DVec2::new(part.size[0] as f64, part.size[1] as f64);
        self.draw_at(team, tile, part, |uv| uv * size - 0.5);
    }

    /// The owners of the nodes of a grid of nx by ny cells.
    pub fn of_nodes(team: &Team, tile: &TileMesh, [nx, ny]: [usize; 2]) -> Owners {
        let cells = DVec2::new(nx as f64, ny as f64);
        let size = [nx + 1, ny + 1];
        let part = ImagePart { size, first: [0, 0], end: size };
        let mut owners = Owners::new(&part);
        owners.draw_at(team, tile, &part, |uv| uv * cells);
        owners
    }

    /// `place` takes a UV to a place among the points, which have integer places.
    fn draw_at(
        &mut self,
        team: &Team,
        tile: &TileMesh,
        part: &ImagePart,
        place: impl Fn(DVec2) -> DVec2 + Sync,
    ) {
        let width = self.width;
        let charts = tile.chart_of_triangles();
        team.fill_large(&mut self.bands, |band, texels| {
            let first = [part.first[0], part.first[1] + band * BAND];
            let end = [part.end[0], first[1] + texels.len() / width];
            for (t, triangle) in tile.triangles.iter().enumerate() {
                let corners = triangle.uv.map(&place);
                Fill::new(corners).visit_in(first, end, |x, y, _| {
                    let owner = &mut texels[(y - first[1]) * width + x - first[0]];
                    let distance = tile.source(t).map_or(0.0, |source| {
                        let [s, t] = barycentrics(corners, DVec2::new(x as f64, y as f64)).map(|l| l as f32);
                        let [p, q, r] = source.distance;
                        // Never that of a chart.
                        (p + s * (q - p) + t * (r - p)).max(f32::MIN_POSITIVE)
                    });
                    if distance < owner.distance {
                        *owner = Owner { chart: charts[t], distance };
                    }
                });
            }
        });
    }

    /// True if a point lies in a chart, not beside all.
    pub fn is_inside(&self, x: usize, y: usize) -> bool {
        self.bands[y / BAND][y % BAND * self.width + x].distance <= 0.0
    }

    /// The chart of a point, or `NONE`.
    pub fn chart(&self, x: usize, y: usize) -> u32 {
        self.bands[y / BAND][y % BAND * self.width + x].chart
    }
}
