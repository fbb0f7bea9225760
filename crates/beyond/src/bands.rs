//! Texels on which triangles are drawn, by several threads.

use glam::DVec2;

use vrtm_core::allocation::{Vec, vec};
use vrtm_core::grid::fill::Fill;
use vrtm_core::image::ImagePart;
use vrtm_core::team::Team;

/// Rows that one item of work draws.
const BAND: usize = 64;

/// A value for each texel of a part of an image, in bands of rows, from v = 0 upward.
pub struct Bands<T> {
    part: ImagePart,
    bands: Vec<Vec<T>>,
}

impl<T: Clone + Send> Bands<T> {
    pub fn new(part: &ImagePart, value: T) -> Bands<T> {
        let [width, height] = part.extent();
        let rows = |band: usize| BAND.min(height - band * BAND);
        let bands = (0..height.div_ceil(BAND)).map(|band| vec![value.clone(); rows(band) * width]).collect();
        Bands { part: *part, bands }
    }

    /// Calls `put(t, corners, at, texel)` for the texels whose centre lies in a triangle, by its UVs, or on its side,
    /// where places are in texels of the whole image.
    pub fn draw<P: Sync>(
        &mut self,
        team: &Team,
        triangles: &[P],
        uv: impl Fn(&P) -> [DVec2; 3] + Sync,
        put: impl Fn(usize, [DVec2; 3], DVec2, &mut T) + Sync,
    ) {
        let (part, width) = (self.part, self.part.extent()[0]);
        let size = DVec2::new(part.size[0] as f64, part.size[1] as f64);
        team.fill_large(&mut self.bands, |band, texels| {
            let first = [part.first[0], part.first[1] + band * BAND];
            let end = [part.end[0], first[1] + texels.len() / width];
            for (t, triangle) in triangles.iter().enumerate() {
                let corners = uv(triangle).map(|uv| uv * size - 0.5);
                Fill::new(corners).visit_in(first, end, |x, y, _| {
                    let texel = &mut texels[(y - first[1]) * width + x - first[0]];
                    put(t, corners, DVec2::new(x as f64, y as f64), texel);
                });
            }
        });
    }

    /// A row of the part.
    pub fn row(&self, y: usize) -> &[T] {
        let width = self.part.extent()[0];
        &self.bands[y / BAND][y % BAND * width..][..width]
    }

    /// The texels row by row.
    pub fn into_texels(self) -> Vec<T> {
        self.bands.into_iter().flatten().collect()
    }
}
