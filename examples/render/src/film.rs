//! Pictures of all frames of a model: on the left with the original UVs, on the right redirected.

use std::ops::RangeInclusive;
use std::path::Path;

use image::imageops::{FilterType, resize};
use image::{Rgb, RgbImage};

use super::Result;
use super::camera::View;
use super::draw::Renderer;
use super::gpu::Gpu;
use super::maps::Solved;
use super::model::Model;
use super::stage::shot;
use super::surface::corners;
use super::texture::Levels;
use super::ways::{ORIGINAL, Way};

/// Pixels of a drawn picture along a side of each pixel that is written.
const FINER: u32 = 2;

pub struct Film<'a> {
    pub gpu: &'a Gpu,
    pub model: &'a Model,
    pub colours: &'a [Levels],
    pub normals: Option<&'a [Levels]>,
    pub view: View,
    /// The size of both halves together.
    pub size: [u32; 2],
    /// Texels on a side of the redirection map.
    pub map: u32,
}

impl Film<'_> {
    /// Draws frames, which are numbered from 1, into `film.NNNN.png` in a folder. The camera stands where it sees the mesh
    /// at rest.
    ///
    /// # Errors
    /// An unknown frame, a file that cannot be written, the errors of vrtm and of the GPU.
    pub fn draw(&self, mut solved: Solved, frames: RangeInclusive<usize>, folder: &Path) -> Result<()> {
        let Film { gpu, model, .. } = *self;
        let [width, height] = self.size;
        let half = [width / 2, height];
        let drawn = half.map(|side| side * FINER);
        let mut renderer = Renderer::new(gpu, &corners(model, &model.rest, &solved.udims), drawn)?;
        let camera = renderer.camera(&self.view.camera(&model.rest, drawn));
        let material = renderer.material(self.colours, self.normals)?;
        let forward = Way::named("forward");
        let ways = [ORIGINAL, forward].map(|way| (way, renderer.pipelines(&way, self.normals.is_some())));
        for frame in frames {
            let positions = model.frame(frame)?;
            solved.solve(positions)?;
            renderer.pose(&corners(model, positions, &solved.udims));
            let maps = renderer.maps(&solved, self.map)?;
            let mut picture = RgbImage::new(2 * half[0], half[1]);
            for (left, (way, pipelines)) in [0, half[0]].into_iter().zip(&ways) {
                let texels = renderer.picture(&shot(way, pipelines, &camera, &material, &maps))?;
                let side = resize(&before_backdrop(&texels, drawn), half[0], half[1], FilterType::Lanczos3);
                image::imageops::replace(&mut picture, &side, i64::from(left), 0);
            }
            let path = folder.join(format!("film.{frame:04}.png"));
            picture.save(&path).map_err(|error| format!("{}: {error}", path.display()))?;
        }
        Ok(())
    }
}

/// The picture before a grey backdrop that is brightest behind its middle.
fn before_backdrop(texels: &[u8], [width, height]: [u32; 2]) -> RgbImage {
    RgbImage::from_fn(width, height, |x, y| {
        let texel = &texels[4 * (y * width + x) as usize..][..4];
        if texel[3] == 255 {
            return Rgb([texel[0], texel[1], texel[2]]);
        }
        let away = |k: u32, side: u32| (k as f32 + 0.5) / side as f32 - 0.5;
        let fall = (away(x, width).hypot(away(y, height)) * 1.6).min(1.0);
        Rgb([(74.0 - 44.0 * fall) as u8; 3])
    })
}
