//! The dilation of a tile: for each texel beside the charts, the point of the texture that shows what lies beyond the
//! nearest border, so that a texture can hold, around each chart, what the surface shows there.

use glam::DVec2;

use super::canvas::Canvas;
use vrtm_beyond::bands::{BAND, Bands};
use vrtm_beyond::{CollarTriangle, Surface, collar};
use vrtm_core::allocation::{Vec, vec};
use vrtm_core::grid::fill::Fill;
use vrtm_core::image::ImageViewMut;
use vrtm_core::mesh::Mesh;
use vrtm_core::mesh::triangle::barycentrics;
use vrtm_core::settings::Beyond;
use vrtm_core::team::Team;

/// Source of a texel beside the charts.
#[derive(Clone, Copy)]
struct Found {
    /// Distance to the border on the surface, as a length in the chart's plane.
    distance: f64,
    uv: DVec2,
}

struct Band {
    texels: Vec<Found>,
    pieces: Vec<Piece>,
}

/// A triangle of a collar.
#[derive(Clone, Copy)]
struct Piece {
    uv: [DVec2; 3],
    /// Its corners on the surface, in the UV plane of all tiles, and their distances from the border.
    source: [DVec2; 3],
    distance: [f64; 3],
}

const NOTHING: Found = Found { distance: f64::INFINITY, uv: DVec2::ZERO };

/// Lays out the collars of a tile's charts beyond their seams up to `reach`, a length in UV, and writes the UV and, as a
/// fourth channel, whether it is known. Nothing is written before all memory is there.
pub(crate) fn write(team: &Team, mesh: &Mesh, tile: usize, reach: f64, image: &mut ImageViewMut) {
    let part = &image.part().clone();
    let surface = Surface::new(mesh, tile, &Beyond { seams: true, open_borders: false, reach });
    let of_chart = |chart: usize| -> Vec<Piece> {
        let collar = collar(&surface, chart, reach, &|| team.check_or_unwind());
        let piece = |of: &CollarTriangle| {
            let origin = mesh.tiles[of.source.tile as usize].origin();
            Piece { uv: of.uv, source: of.source.uv.map(|uv| uv + origin), distance: of.distance }
        };
        collar.triangles.iter().map(piece).collect()
    };
    let pieces = team.map(mesh.tiles[tile].charts.len(), of_chart);
    let mut charts = Bands::new(part, false);
    // True for texels whose centre lies in a chart: all layers of the tile share one texture.
    mesh.layers(tile).for_each(|layer| {
        charts.draw(team, &mesh.tiles[layer].triangles, |_, _, _, covered| *covered = true);
    });
    let [width, height] = part.extent();
    let rows = |band: usize| BAND.min(height - band * BAND);
    let band = |band: usize| Band { texels: vec![NOTHING; rows(band) * width], pieces: Vec::new() };
    let mut bands: Vec<Band> = (0..height.div_ceil(BAND)).map(band).collect();
    for piece in pieces.iter().flatten() {
        let rows = piece.uv.map(|uv| uv.y * part.size[1] as f64 - 0.5 - part.first[1] as f64);
        let band = |y: f64| (y / BAND as f64).max(0.0) as usize;
        let [low, high] = [rows.into_iter().reduce(f64::min), rows.into_iter().reduce(f64::max)];
        let (low, high) = (low.map_or(0, band), high.map_or(0, |y| band(y) + 1));
        bands.iter_mut().take(high).skip(low).for_each(|band| band.pieces.push(*piece));
    }
    let (origin, canvas) = (mesh.tiles[tile].origin(), Canvas::new(image));
    let size = DVec2::new(part.size[0] as f64, part.size[1] as f64);
    team.fill_large(&mut bands, |band, Band { texels, pieces }| {
        let first = [part.first[0], part.first[1] + band * BAND];
        let end = [part.end[0], first[1] + texels.len() / width];
        for piece in &*pieces {
            let corners = piece.uv.map(|uv| uv * size - 0.5);
            Fill::new(corners).visit_in(first, end, |x, y, _| {
                let texel = &mut texels[(y - first[1]) * width + x - first[0]];
                let [s, t] = barycentrics(corners, DVec2::new(x as f64, y as f64));
                let [p, q, r] = piece.distance;
                let distance = p + s * (q - p) + t * (r - p);
                if distance < texel.distance && distance <= reach {
                    let [a, b, c] = piece.source;
                    *texel = Found { distance, uv: a + s * (b - a) + t * (c - a) };
                }
            });
        }
        for (y, row) in texels.chunks_exact(width).enumerate() {
            let covered = charts.row(band * BAND + y);
            for (x, found) in row.iter().enumerate() {
                let at = [first[0] + x, first[1] + y].map(|k| k as f64 + 0.5);
                let own = DVec2::from(at) / size + origin;
                let (uv, known) = match (covered[x], found.distance.is_finite()) {
                    (false, true) => (found.uv, 1.0),
                    (covered, _) => (own, f64::from(u8::from(covered))),
                };
                canvas.put(x, band * BAND + y, [uv.x, uv.y, 0.0, known]);
            }
        }
    });
}
