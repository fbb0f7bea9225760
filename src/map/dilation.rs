//! The dilation of a tile: for each texel beside the charts, the point of the texture that shows what lies beyond the
//! nearest border, so that a texture can hold, around each chart, what the surface shows there.

use glam::DVec2;

use super::canvas::Canvas;
use vrtm_beyond::bands::Bands;
use vrtm_beyond::{CollarTriangle, Surface, collar};
use vrtm_core::allocation::Vec;
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

/// A triangle of a collar.
struct Piece {
    uv: [DVec2; 3],
    /// Its corners on the surface, in the UV plane of all tiles, and their distances from the border.
    source: [DVec2; 3],
    distance: [f64; 3],
}

const NOTHING: Found = Found { distance: f64::INFINITY, uv: DVec2::ZERO };

/// Lays out the collars of a tile's charts beyond their seams up to `reach`, a length in UV, and writes the UV and, as
/// a fourth channel, whether it is known. Nothing is written before all memory is there.
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
    let pieces: Vec<Piece> = pieces.into_iter().flatten().collect();
    let mut charts = Bands::new(part, false);
    // True for texels whose centre lies in a chart: all layers of the tile share one texture.
    mesh.layers(tile).for_each(|layer| {
        charts.draw(team, &mesh.tiles[layer].triangles, |t| t.uv, |_, _, _, covered| *covered = true);
    });
    let mut texels = Bands::new(part, NOTHING);
    let put = |k: usize, corners, at, texel: &mut Found| {
        let Piece { source: [a, b, c], distance: [p, q, r], .. } = pieces[k];
        let [s, t] = barycentrics(corners, at);
        let distance = p + s * (q - p) + t * (r - p);
        if distance < texel.distance && distance <= reach {
            *texel = Found { distance, uv: a + s * (b - a) + t * (c - a) };
        }
    };
    texels.draw(team, &pieces, |piece| piece.uv, put);
    let (origin, canvas) = (mesh.tiles[tile].origin(), Canvas::new(image));
    let size = DVec2::new(part.size[0] as f64, part.size[1] as f64);
    team.run(part.extent()[1], |y| {
        for (x, (found, &covered)) in texels.row(y).iter().zip(charts.row(y)).enumerate() {
            let at = [part.first[0] + x, part.first[1] + y].map(|k| k as f64 + 0.5);
            let (uv, known) = match covered || !found.distance.is_finite() {
                true => (DVec2::from(at) / size + origin, f64::from(u8::from(covered))),
                false => (found.uv, 1.0),
            };
            canvas.put(x, y, [uv.x, uv.y, 0.0, known]);
        }
    });
}
