//! Maps of a texture's colour and brightness.

/// A texture of 8 bits: red, green, blue and alpha of each texel, in the curve of sRGB; width and height.
#[derive(Clone, Copy)]
pub struct Picture<'a> {
    rgba: &'a [[u8; 4]],
    pub(crate) size: [usize; 2],
}

impl<'a> Picture<'a> {
    /// `None` if the size is not that of the bytes, or 0.
    #[must_use]
    pub fn new(rgba: &'a [u8], size: [usize; 2]) -> Option<Picture<'a>> {
        let (rgba, rest) = rgba.as_chunks();
        let texels = size[0].checked_mul(size[1]).filter(|&texels| texels > 0);
        (rest.is_empty() && texels == Some(rgba.len())).then_some(Picture { rgba, size })
    }

    /// Weighted by ITU-R BT.709; `channel` makes a number of a byte.
    pub(crate) fn brightness(&self, index: usize, channel: impl Fn(u8) -> f32) -> f32 {
        let [red, green, blue, _] = self.rgba[index];
        0.2126 * channel(red) + 0.7152 * channel(green) + 0.0722 * channel(blue)
    }

    fn values(&self) -> impl Iterator<Item = f32> {
        (0..self.rgba.len()).map(|k| self.brightness(k, unit))
    }
}

fn unit(byte: u8) -> f32 {
    f32::from(byte) / 255.0
}

/// The brightness that parts all pictures into two groups with the least variance within them (Otsu 1979).
#[must_use]
pub fn otsu(pictures: &[Picture]) -> f32 {
    let values = || pictures.iter().flat_map(Picture::values);
    let (low, high) = values().fold((f32::MAX, f32::MIN), |(low, high), x| (low.min(x), high.max(x)));
    if high <= low {
        return low;
    }
    let mut counts = [0.0; 256];
    for value in values() {
        counts[((256.0 * (value - low) / (high - low)) as usize).min(255)] += 1.0;
    }
    let (all, sum) =
        (0..256).fold((0.0, 0.0), |(n, sum), k| (n + counts[k], sum + counts[k] * (k as f64 + 0.5)));
    let (mut below, mut below_sum) = (0.0, 0.0);
    let between: Vec<f64> = (0..255)
        .map(|k| {
            below += counts[k];
            below_sum += counts[k] * (k as f64 + 0.5);
            let above = all - below;
            if below == 0.0 || above == 0.0 {
                return 0.0;
            }
            below * above * (below_sum / below - (sum - below_sum) / above).powi(2)
        })
        .collect();
    let best = between.iter().copied().fold(0.0, f64::max);
    let is_best = |value: &f64| *value >= best * (1.0 - 1e-12);
    // Where nothing lies between the groups, in the middle of the gap.
    let ends =
        [between.iter().position(is_best), between.iter().rposition(is_best)].map(Option::unwrap_or_default);
    low + (high - low) * (1 + (ends[0] + ends[1]) / 2) as f32 / 256.0
}

/// The map that is rigid where a picture is brighter than a threshold, 0..1, such as [`otsu`]'s.
#[must_use]
pub fn of_brightness(picture: Picture, threshold: f32) -> Vec<u8> {
    soft(&picture.values().map(|value| value > threshold).collect::<Vec<_>>(), picture.size)
}

/// The map that is rigid where a picture is at most `tolerance` from a colour, 0..1; black and white are sqrt(3) apart.
#[must_use]
pub fn of_colour(picture: Picture, colour: [f32; 3], tolerance: f32) -> Vec<u8> {
    let far = |texel: &[u8; 4]| (0..3).map(|c| (unit(texel[c]) - colour[c]).powi(2)).sum::<f32>().sqrt();
    soft(&picture.rgba.iter().map(|texel| far(texel) <= tolerance).collect::<Vec<_>>(), picture.size)
}

/// A mask as 255 and 0, with borders about a texel wide.
fn soft(inside: &[bool], [width, height]: [usize; 2]) -> Vec<u8> {
    let weights = |x: usize, n: usize| [(x.saturating_sub(1), 1), (x, 2), ((x + 1).min(n - 1), 1)];
    let mut map = Vec::with_capacity(inside.len());
    for y in 0..height {
        for x in 0..width {
            let rows = weights(y, height);
            let row = |j: usize| {
                weights(x, width).map(|(i, w)| w * u32::from(inside[j * width + i])).iter().sum::<u32>()
            };
            map.push(
                (rows.map(|(j, w)| w * row(j)).iter().sum::<u32>() as f32 * 255.0 / 16.0).round_ties_even()
                    as u8,
            );
        }
    }
    map
}
