//! The dilation of a tile: for each texel beside the charts, the point of the texture that shows what lies beyond the
//! nearest border, so that a texture can hold, around each chart, what the surface shows there.

use glam::DVec2;

use super::canvas::Canvas;
use super::chart_texels::{BAND, ChartTexels};
use vrtm_beyond::{Collar, collars};
use vrtm_core::allocation::{Vec, vec};
use vrtm_core::grid::fill::Fill;
use vrtm_core::image::ImagePart;
use vrtm_core::mesh::triangle::barycentrics;
use vrtm_core::mesh::{Mesh, TileMesh};
use vrtm_core::settings::Beyond;
use vrtm_core::team::Team;

/// What a texel beside the charts shows.
#[derive(Clone, Copy)]
struct Found {
    /// Distance to the border on the surface, as a length in the chart's plane.
    distance: f64,
    uv: DVec2,
}

/// A dilation that is about to be written. It holds the memory that writing needs.
pub(crate) struct Dilation<'a> {
    mesh: &'a Mesh,
    tile: usize,
    part: ImagePart,
    charts: ChartTexels,
    collars: Vec<Collar>,
    reach: f64,
    rows: Vec<Vec<Found>>,
}

const NOTHING: Found = Found { distance: f64::INFINITY, uv: DVec2::ZERO };

impl<'a> Dilation<'a> {
    /// Lays out the collars of a tile's charts beyond their seams up to `reach`, a length in UV.
    pub fn new(team: &Team, mesh: &'a Mesh, tile: usize, reach: f64, part: &ImagePart) -> Dilation<'a> {
        let collars = collars(team, mesh, tile, &Beyond { seams: true, open_borders: false, reach });
        let mut charts = ChartTexels::new(part);
        // All layers of the tile share one texture.
        mesh.layers(tile).for_each(|layer| charts.draw(team, &mesh.tiles[layer], part));
        let [width, height] = part.extent();
        let rows = |band: usize| BAND.min(height - band * BAND);
        let rows = (0..height.div_ceil(BAND)).map(|band| vec![NOTHING; rows(band) * width]).collect();
        Dilation { mesh, tile, part: *part, charts, collars, reach, rows }
    }

    /// Writes the UV and, as a fourth channel, whether it is known.
    pub fn write(mut self, team: &Team, canvas: &Canvas) {
        let tile: &TileMesh = &self.mesh.tiles[self.tile];
        let (part, collars, reach) = (self.part, &self.collars, self.reach);
        let size = DVec2::new(part.size[0] as f64, part.size[1] as f64);
        let width = part.extent()[0];
        let (charts, mesh) = (&self.charts, self.mesh);
        team.fill_large(&mut self.rows, |band, texels| {
            let first = [part.first[0], part.first[1] + band * BAND];
            let end = [part.end[0], first[1] + texels.len() / width];
            for triangle in collars.iter().flat_map(|collar| &collar.triangles) {
                let corners = triangle.uv.map(|uv| uv * size - 0.5);
                Fill::new(corners).visit_in(first, end, |x, y, _| {
                    let texel = &mut texels[(y - first[1]) * width + x - first[0]];
                    let [s, t] = barycentrics(corners, DVec2::new(x as f64, y as f64));
                    let [p, q, r] = triangle.distance;
                    let distance = p + s * (q - p) + t * (r - p);
                    if distance < texel.distance && distance <= reach {
                        let [a, b, c] = triangle.source.uv;
                        let uv = a
                            + s * (b - a)
                            + t * (c - a)
                            + mesh.tiles[triangle.source.tile as usize].origin();
                        *texel = Found { distance, uv };
                    }
                });
            }
            for (y, row) in texels.chunks_exact(width).enumerate() {
                let covered = charts.row(band * BAND + y);
                for (x, found) in row.iter().enumerate() {
                    let at = [first[0] + x, first[1] + y].map(|k| k as f64 + 0.5);
                    let own = DVec2::from(at) / size + tile.origin();
                    let (uv, known) = match (covered[x], found.distance.is_finite()) {
                        (false, true) => (found.uv, 1.0),
                        (covered, _) => (own, f64::from(u8::from(covered))),
                    };
                    canvas.put(x, band * BAND + y, [uv.x, uv.y, 0.0, known]);
                }
            }
        });
    }
}
