//! A picture of rectangles and text, in linear colours.

use image::{Rgb, RgbImage};
use noto_sans_mono_bitmap::{FontWeight, RasterHeight, get_raster, get_raster_width};

use crate::material::{Colour, mix};

pub struct Canvas {
    pub width: usize,
    pub height: usize,
    /// Linear RGB.
    pub pixels: Vec<Colour>,
}

/// Size and weight of a text.
#[derive(Clone, Copy)]
pub struct Font {
    weight: FontWeight,
    height: RasterHeight,
}

pub const TITLE: Font = Font { weight: FontWeight::Bold, height: RasterHeight::Size24 };
pub const HEADING: Font = Font { weight: FontWeight::Bold, height: RasterHeight::Size20 };
pub const LARGE: Font = Font { weight: FontWeight::Regular, height: RasterHeight::Size20 };
pub const TEXT: Font = Font { weight: FontWeight::Regular, height: RasterHeight::Size16 };

impl Font {
    /// Width of a character in pixels.
    pub fn advance(self) -> usize {
        get_raster_width(self.weight, self.height)
    }
}

impl Canvas {
    pub fn new(width: usize, height: usize, background: Colour) -> Canvas {
        Canvas { width, height, pixels: vec![background; width * height] }
    }

    pub fn put(&mut self, x: usize, y: usize, colour: Colour) {
        if x < self.width && y < self.height {
            self.pixels[y * self.width + x] = colour;
        }
    }

    pub fn rectangle(&mut self, at: [usize; 2], size: [usize; 2], colour: impl Fn(f32, f32) -> Colour) {
        for y in 0..size[1] {
            for x in 0..size[0] {
                let centre = |i: usize, n: usize| (i as f32 + 0.5) / n as f32;
                self.put(at[0] + x, at[1] + y, colour(centre(x, size[0]), centre(y, size[1])));
            }
        }
    }

    /// Draws one line of text. Characters that the font lacks become question marks; the text is cut off at `room`
    /// pixels.
    pub fn text(&mut self, at: [usize; 2], room: usize, font: Font, colour: Colour, text: &str) {
        let fits = room / font.advance();
        let count = text.chars().count();
        let cut = if count > fits { fits.saturating_sub(2) } else { count };
        let dots = if count > fits { ".." } else { "" };
        for (i, c) in text.chars().take(cut).chain(dots.chars()).enumerate() {
            let raster = get_raster(c, font.weight, font.height);
            let Some(raster) = raster.or_else(|| get_raster('?', font.weight, font.height)) else { continue };
            for (y, row) in raster.rows().enumerate() {
                for (x, &cover) in row.iter().enumerate() {
                    let (x, y) = (at[0] + i * font.advance() + x, at[1] + y);
                    if cover > 0 && x < self.width && y < self.height {
                        let below = self.pixels[y * self.width + x];
                        self.put(x, y, mix(below, colour, f32::from(cover) / 255.0));
                    }
                }
            }
        }
    }

    /// The finished picture in sRGB.
    pub fn finish(&self) -> RgbImage {
        let mut image = RgbImage::new(self.width as u32, self.height as u32);
        for (pixel, colour) in image.pixels_mut().zip(&self.pixels) {
            *pixel = Rgb(colour.map(encode));
        }
        image
    }
}

fn encode(linear: f32) -> u8 {
    let x = linear.clamp(0.0, 1.0);
    let srgb = if x <= 0.003_130_8 { 12.92 * x } else { 1.055 * x.powf(1.0 / 2.4) - 0.055 };
    (255.0 * srgb + 0.5) as u8
}
