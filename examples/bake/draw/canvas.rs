//! A picture of rectangles and text, in linear colours.

use image::{Rgb, RgbImage};
use noto_sans_mono_bitmap::{FontWeight, RasterHeight, get_raster, get_raster_width};
use vrtm_testkit::on_all_cores;

use super::material::{Colour, mix};

pub struct Canvas {
    size: [usize; 2],
    pixels: Vec<Colour>,
}

/// Size and weight of a text.
pub type Font = (FontWeight, RasterHeight);

pub const TITLE: Font = (FontWeight::Bold, RasterHeight::Size24);
pub const HEADING: Font = (FontWeight::Bold, RasterHeight::Size20);
pub const TEXT: Font = (FontWeight::Regular, RasterHeight::Size16);

impl Canvas {
    pub fn new(size: [usize; 2], background: Colour) -> Canvas {
        Canvas { size, pixels: vec![background; size[0] * size[1]] }
    }

    fn at(&mut self, x: usize, y: usize) -> Option<&mut Colour> {
        let inside = x < self.size[0] && y < self.size[1];
        inside.then(|| &mut self.pixels[y * self.size[0] + x])
    }

    /// Fills a rectangle with the mean of samples, `samples` along each axis of a pixel. `colour` gets the sample's
    /// position relative to the rectangle's upper left. Rows are computed in parallel.
    pub fn picture(
        &mut self,
        corner: [usize; 2],
        [width, height]: [usize; 2],
        samples: usize,
        colour: impl Fn(usize, usize) -> Colour + Sync,
    ) {
        let pixel = |x: usize, y: usize| {
            let all =
                (0..samples * samples).map(|k| colour(x * samples + k % samples, y * samples + k / samples));
            let sum = all.fold([0.0; 3], |sum, colour| [0, 1, 2].map(|c| sum[c] + colour[c]));
            sum.map(|x: f32| x / (samples * samples) as f32)
        };
        let rows: Vec<usize> = (0..height).collect();
        let row = |&y: &usize| (0..width).map(|x| pixel(x, y)).collect::<Vec<Colour>>();
        for (y, row) in on_all_cores(&rows, row).into_iter().enumerate() {
            for (x, colour) in row.into_iter().enumerate() {
                if let Some(pixel) = self.at(corner[0] + x, corner[1] + y) {
                    *pixel = colour;
                }
            }
        }
    }

    /// Draws one line of text. Characters that the font lacks become question marks.
    pub fn text(&mut self, corner: [usize; 2], (weight, height): Font, ink: Colour, text: &str) {
        for (i, c) in text.chars().enumerate() {
            let raster = get_raster(c, weight, height).or_else(|| get_raster('?', weight, height));
            let Some(raster) = raster else { continue };
            let left = corner[0] + i * get_raster_width(weight, height);
            for (y, row) in raster.rows().enumerate() {
                for (x, &cover) in row.iter().enumerate() {
                    if let Some(pixel) = self.at(left + x, corner[1] + y) {
                        *pixel = mix(*pixel, ink, f32::from(cover) / 255.0);
                    }
                }
            }
        }
    }

    /// The finished picture in sRGB.
    pub fn finish(&self) -> RgbImage {
        let encode = |linear: f32| {
            let x = linear.clamp(0.0, 1.0);
            let srgb = if x <= 0.003_130_8 { 12.92 * x } else { 1.055 * x.powf(1.0 / 2.4) - 0.055 };
            (255.0 * srgb + 0.5) as u8
        };
        let [width, height] = self.size;
        RgbImage::from_fn(width as u32, height as u32, |x, y| {
            Rgb(self.pixels[y as usize * width + x as usize].map(encode))
        })
    }
}
