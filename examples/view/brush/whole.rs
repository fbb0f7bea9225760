//! Tools that change all of a map: grow, shrink, invert, and rigidity from the brightness of a texture.

use image::RgbaImage;

use super::canvas::Canvas;

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Tool {
    Grow,
    Shrink,
    Invert,
}

/// Texels of a map's side for each texel that features grow by.
const PER_TEXEL: u32 = 400;

/// The map after a tool was used; `charts` has the chart of each texel, which does not grow into others.
pub fn used(tool: Tool, canvas: &Canvas, charts: &[Option<u32>]) -> Vec<u16> {
    let best = match tool {
        Tool::Invert => return canvas.texels.iter().map(|&texel| 65535 - texel).collect(),
        Tool::Grow => u16::max,
        Tool::Shrink => u16::min,
    };
    let mut texels = canvas.texels.clone();
    let [width, height] = canvas.size.map(|side| side as usize);
    for round in 0..canvas.size[0].max(canvas.size[1]).div_ceil(PER_TEXEL) {
        let old = texels.clone();
        // Squares and crosses in turn make octagons, which are nearly round.
        let cross = [(0, 1), (1, 0), (1, 2), (2, 1)];
        let corners = [(0, 0), (0, 2), (2, 0), (2, 2)];
        let near: Vec<_> = if round % 2 == 0 { [cross, corners].concat() } else { cross.to_vec() };
        for (k, texel) in texels.iter_mut().enumerate().filter(|(k, _)| charts[*k].is_some()) {
            let (x, y) = (k % width, k / width);
            for &(dx, dy) in &near {
                let (nx, ny) = (x + dx, y + dy);
                // From one texel to the left and above.
                if nx == 0 || ny == 0 || nx > width || ny > height {
                    continue;
                }
                let other = (ny - 1) * width + nx - 1;
                if charts[other] == charts[k] {
                    *texel = best(*texel, old[other]);
                }
            }
        }
    }
    texels
}

/// Weights of red, green and blue in brightness (ITU-R BT.709).
const WEIGHTS: [f32; 3] = [0.2126, 0.7152, 0.0722];

fn brightness(pixel: &image::Rgba<u8>) -> f32 {
    (0..3).map(|c| WEIGHTS[c] * f32::from(pixel.0[c])).sum::<f32>() / 255.0
}

/// The threshold that parts all pixels into dark and bright ones with the least variance within both (Otsu 1979), as
/// `vrtm rigidity` finds it.
pub fn otsu<'a>(textures: impl Iterator<Item = &'a RgbaImage>) -> f32 {
    let mut counts = [0u64; 256];
    for pixel in textures.flat_map(|texture| texture.pixels()) {
        counts[(brightness(pixel) * 255.0).round() as usize] += 1;
    }
    let sum_of = |counts: &[u64], first: usize| -> (f64, f64) {
        let weighted = |(k, &n): (usize, &u64)| (k + first) as f64 * n as f64;
        (counts.iter().map(|&n| n as f64).sum(), counts.iter().enumerate().map(weighted).sum())
    };
    let between = |split: usize| {
        let [(below, a), (above, b)] = [sum_of(&counts[..split], 0), sum_of(&counts[split..], split)];
        if below > 0.0 && above > 0.0 { below * above * (a / below - b / above).powi(2) } else { 0.0 }
    };
    let all: Vec<f64> = (0..256).map(between).collect();
    let most = all.iter().copied().fold(0.0, f64::max);
    // Where nothing lies between both, in the middle of the gap.
    let mut best = (0..256).filter(|&k| all[k] == most);
    let first = best.next().unwrap_or(128);
    ((first + best.next_back().unwrap_or(first)) as f32 / 2.0 - 0.5) / 255.0
}

/// Rigid where a texture is brighter than a threshold, or darker; borders are about a texel wide. The first row of the
/// texture is at v = 0.
pub fn of_brightness(texture: &RgbaImage, threshold: f32, dark: bool, size: [u32; 2]) -> Vec<u16> {
    let [width, height] = size;
    let pixels = |k: u32, side: u32, count: u32| {
        let first = (u64::from(k) * u64::from(count) / u64::from(side)) as u32;
        let end = (u64::from(k + 1) * u64::from(count)).div_ceil(u64::from(side)) as u32;
        first..end.clamp(first + 1, count)
    };
    let mut inside = Vec::with_capacity((width * height) as usize);
    for y in 0..height {
        let rows = pixels(height - 1 - y, height, texture.height());
        for x in 0..width {
            let columns = pixels(x, width, texture.width());
            let all = (rows.len() * columns.len()) as f32;
            let over = |(x, y)| (brightness(texture.get_pixel(x, y)) > threshold) != dark;
            let count =
                rows.clone().flat_map(|y| columns.clone().map(move |x| (x, y))).filter(|&at| over(at));
            inside.push(count.count() as f32 / all);
        }
    }
    let [width, height] = size.map(|side| side as usize);
    let at = |x: usize, y: usize| inside[y.min(height - 1) * width + x.min(width - 1)];
    let blurred = |k: usize| {
        let (x, y) = (k % width, k / width);
        let columns = |y: usize| at(x.saturating_sub(1), y) + 2.0 * at(x, y) + at(x + 1, y);
        (columns(y.saturating_sub(1)) + 2.0 * columns(y) + columns(y + 1)) / 16.0
    };
    (0..width * height).map(|k| (blurred(k) * 65535.0).round() as u16).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A map of two charts, left and right of column 6, with one rigid texel at [5, 5].
    fn canvas() -> (Canvas, Vec<Option<u32>>) {
        let mut texels = vec![0; 144];
        texels[5 * 12 + 5] = 65535;
        let charts = (0..144).map(|k| if k / 12 == 11 { None } else { Some(u32::from(k % 12 > 5)) });
        (Canvas { size: [12, 12], texels, deep: false }, charts.collect())
    }

    #[test]
    fn features_grow_within_their_chart_and_shrink_again() {
        let (mut canvas, charts) = canvas();
        canvas.texels = used(Tool::Grow, &canvas, &charts);
        let rigid: Vec<usize> = (0..144).filter(|&k| canvas.texels[k] > 0).collect();
        let expected: Vec<usize> = [4, 5, 6].into_iter().flat_map(|y| [4, 5].map(|x| 12 * y + x)).collect();
        assert_eq!(rigid, expected, "the chart ends at column 6");
        canvas.texels = used(Tool::Shrink, &canvas, &charts);
        assert_eq!((0..144).filter(|&k| canvas.texels[k] > 0).collect::<Vec<_>>(), [5 * 12 + 5]);
        canvas.texels = used(Tool::Invert, &canvas, &charts);
        assert_eq!(canvas.texels.iter().filter(|&&t| t == 0).count(), 1);
    }

    #[test]
    fn bright_pixels_become_rigid_where_they_are() {
        // Dark grey; bright where v is over a half and u under a quarter. The first row is at v = 0.
        let texture = RgbaImage::from_fn(64, 64, |x, y| {
            let grey = if y >= 32 && x < 16 { 200 } else { 60 };
            image::Rgba([grey, grey, grey, 255])
        });
        let threshold = otsu([&texture].into_iter());
        assert!((threshold - 130.0 / 255.0).abs() < 0.01, "{threshold}");
        let texels = of_brightness(&texture, threshold, false, [16, 16]);
        assert_eq!((texels[0], texels[16 * 15], texels[8]), (65535, 0, 0));
        assert_eq!(texels.iter().filter(|&&t| t > 32768).count(), 4 * 8);
        let dark = of_brightness(&texture, threshold, true, [16, 16]);
        assert!(texels.iter().zip(&dark).all(|(a, b)| u32::from(*a) + u32::from(*b) >= 65534));
    }
}
