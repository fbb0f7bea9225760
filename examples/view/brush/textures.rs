//! Rigidity from textures: a colour, what is bright, what is drawn.

use image::RgbaImage;
use vrtm_paint::{Picture, fitted, of_brightness, of_colour, of_detail, otsu};

use super::canvas::Canvas;
use super::kind::Brush;
use super::painter::Painter;
use super::steps::Change;
use crate::pictures::Textures;

/// The part of textures that becomes rigid: a colour, what is bright or dark, or what is drawn outside of features.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Source {
    Colour([f32; 3]),
    Bright,
    Dark,
    Detail,
}

/// Rigidity of what is drawn: it gives way to features.
const DRAWN: f32 = 0.3;

/// The colour of a texture at a UV.
pub fn colour(image: &RgbaImage, uv: [f32; 2]) -> [f32; 3] {
    let size = [image.width(), image.height()];
    let [x, y] = [0, 1].map(|c| ((uv[c] * size[c] as f32).max(0.0) as u32).min(size[c] - 1));
    let [r, g, b, _] = image.get_pixel(x, y).0.map(|byte| f32::from(byte) / 255.0);
    [r, g, b]
}

impl Painter {
    /// Gives the brush's value to a part of all textures. Returns what changed.
    pub fn take(&mut self, textures: &Textures, source: Source, brush: &Brush) -> Vec<Change> {
        let all = textures.iter().enumerate().filter_map(|(page, image)| {
            let image = image.as_ref()?;
            let size = [image.width(), image.height()].map(|side| side as usize);
            Some((page, Picture::new(image, size)?, size))
        });
        let all: Vec<_> = all.collect();
        let threshold = otsu(&all.iter().map(|of| of.1).collect::<Vec<_>>());
        let has_features =
            self.canvases.iter().any(|canvas| canvas.texels.iter().any(|&texel| texel > 32767));
        let of_page = |(page, picture, size): (usize, Picture, [usize; 2])| {
            let canvas = &self.canvases[page];
            let bright = || of_brightness(picture, threshold);
            let (map, size) = match source {
                Source::Colour(colour) => (of_colour(picture, colour, brush.tolerance), size),
                Source::Bright => (bright(), size),
                Source::Dark => (bright().into_iter().map(|value| 255 - value).collect(), size),
                Source::Detail if has_features => {
                    let features: Vec<u8> = rows(canvas).map(|&texel| (texel / 257) as u8).collect();
                    let size = canvas.size.map(|side| side as usize);
                    (of_detail(picture, Some((&features, size)), DRAWN), size)
                }
                Source::Detail => (of_detail(picture, None, DRAWN), size),
            };
            (page, self.with(page, &map, size, brush))
        };
        let pages = all.into_iter().map(of_page).collect();
        self.set(pages)
    }

    /// A page's texels with the brush's value where a map is rigid; its rows run from v = 0 upward, as in textures.
    fn with(&self, page: usize, map: &[u8], size: [usize; 2], brush: &Brush) -> Vec<u16> {
        let canvas = &self.canvases[page];
        let map = Canvas {
            texels: fitted(map, size, canvas.size.map(|side| side as usize))
                .into_iter()
                .map(u16::from)
                .collect(),
            ..*canvas
        };
        let mixed = canvas.texels.iter().zip(rows(&map)).map(|(&old, &share)| {
            let before = f32::from(old);
            let now = before + (brush.target() - before) * f32::from(share) / 255.0;
            // Of a value under 1 nothing loses rigidity.
            if brush.erase { now as u16 } else { (now.round() as u16).max(old) }
        });
        mixed.collect()
    }
}

/// Texels with the rows the other way up.
fn rows(canvas: &Canvas) -> impl Iterator<Item = &u16> {
    canvas.texels.chunks_exact(canvas.size[0] as usize).rev().flatten()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::model::Model;

    /// A texture that is red where u and v are under a half, and dark blue elsewhere.
    #[test]
    fn colours_and_what_is_bright_or_drawn_become_rigid() {
        let image = RgbaImage::from_fn(64, 64, |x, y| {
            image::Rgba(if x < 32 && y < 32 { [255, 0, 0, 255] } else { [0, 0, 60, 255] })
        });
        let mut painter = Painter::new(&Model::scene("mug_to_jug"));
        painter.canvases[0].texels.fill(0);
        let at = |painter: &Painter| {
            let canvas = &painter.canvases[0];
            [[0.25, 0.25], [0.25, 0.75], [0.75, 0.25], [0.5, 0.25]]
                .map(|uv| canvas.texels[canvas.index(canvas.texel(uv))])
        };
        let (brush, textures) = (Brush::DEFAULT, vec![Some(image.clone().into())]);
        let red = Source::Colour(colour(&image, [0.25, 0.25]));
        let changes = painter.take(&textures, red, &brush);
        assert!(changes.len() == 1 && at(&painter)[..3] == [65535, 0, 0], "{:?}", at(&painter));
        painter.take(&textures, red, &Brush { erase: true, ..brush });
        assert_eq!(at(&painter)[..3], [0; 3]);
        painter.take(&textures, Source::Bright, &Brush { value: 0.5, ..brush });
        assert_eq!(at(&painter)[..3], [32768, 0, 0]);
        painter.undo();
        painter.take(&textures, Source::Dark, &brush);
        assert_eq!(at(&painter)[..3], [0, 65535, 65535]);
        painter.undo();
        painter.take(&textures, Source::Detail, &brush);
        let [inside, above, beside, edge] = at(&painter);
        assert!(
            inside.max(above).max(beside) == 0 && edge > 18000,
            "the border is drawn: {:?}",
            at(&painter)
        );
    }
}
