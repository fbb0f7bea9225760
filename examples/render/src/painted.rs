//! A texture from files: its colours, and its heights, of which it makes normals.

use std::path::PathBuf;

use image::DynamicImage;

use super::texture::Levels;
use super::{Result, fill_rows, mips};

/// The colours of each tile (sRGB), from PNG files; alpha is 0 where the surface is metal. `pattern` holds `<UDIM>` for the
/// tile's number unless there is only one tile.
///
/// # Errors
/// A file that cannot be read, or one that is not as large as the others; `pattern` follows the option's name, `option`.
pub fn colours(option: &str, pattern: &str, udims: &[u32]) -> Result<Vec<Levels>> {
    let images = load(option, pattern, udims)?;
    let texels = |image: DynamicImage| image.flipv().into_rgba8().pixels().map(|pixel| pixel.0).collect();
    Ok(images.into_iter().map(|image| mips::levels(texels(image), mips::mean_colour)).collect())
}

/// The normals of each tile, from PNG files of heights in grey, 8 or 16 bits. White is `high` above black, as a fraction of
/// the tile's side.
///
/// # Errors
/// As for [`colours`].
pub fn normals(option: &str, pattern: &str, udims: &[u32], high: f32) -> Result<Vec<Levels>> {
    Ok(load(option, pattern, udims)?.into_iter().map(|image| of_heights(&image, high)).collect())
}

fn of_heights(image: &DynamicImage, high: f32) -> Levels {
    let heights = image.flipv().into_luma16();
    let side = heights.width() as usize;
    let at = |x: usize, y: usize| f32::from(heights.as_raw()[y * side + x]) / 65535.0;
    let mut texels = vec![[0; 4]; side * side];
    fill_rows(&mut texels, side, |y, row| {
        for (x, texel) in row.iter_mut().enumerate() {
            let [west, south] = [x, y].map(|k| k.saturating_sub(1));
            let [east, north] = [x, y].map(|k| (k + 1).min(side - 1));
            // The slope, since both lengths are fractions of the tile's side.
            let scale = 0.5 * side as f32 * high;
            let slope = [at(east, y) - at(west, y), at(x, north) - at(x, south)].map(|d| -d * scale);
            let length = (slope[0] * slope[0] + slope[1] * slope[1] + 1.0).sqrt();
            let [r, g, b] =
                [slope[0], slope[1], 1.0].map(|c| ((c / length * 0.5 + 0.5) * 255.0).round() as u8);
            *texel = [r, g, b, 255];
        }
    });
    mips::levels(texels, mips::mean_bytes)
}

/// One image per tile, all of one size.
fn load(option: &str, pattern: &str, udims: &[u32]) -> Result<Vec<DynamicImage>> {
    let said = |why: String| format!("{option} {pattern}: {why}");
    if udims.len() > 1 && !pattern.contains("<UDIM>") {
        return Err(said(format!("the mesh has {} tiles: write <UDIM> for the tile's number", udims.len())));
    }
    let mut images: Vec<DynamicImage> = Vec::new();
    for udim in udims {
        let path = PathBuf::from(pattern.replace("<UDIM>", &udim.to_string()));
        let image = image::open(&path).map_err(|error| said(error.to_string()))?;
        let side = image.width();
        if image.height() != side || !side.is_power_of_two() {
            return Err(said(format!("{side}x{} texels: not a power of two on each side", image.height())));
        }
        if let Some(first) = images.first().filter(|first| first.width() != side) {
            return Err(said(format!(
                "tile {udim} has {side} texels on a side, the first {}",
                first.width()
            )));
        }
        images.push(image);
    }
    Ok(images)
}
