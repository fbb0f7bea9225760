//! Maps of what is drawn outside of features.

use crate::picture::Picture;
use crate::plane::{Plane, blocks, grown};

/// Means of the structure tensor along a picture's longer side.
const CELLS: usize = 256;
/// Cells around features that stay elastic.
const MARGIN: f32 = 4.0;
/// Contrasts of lightness, from 0 to 1: up to the first a ground counts as plain, from the second on as drawn on.
const PLAIN: f32 = 0.02;
const DRAWN: f32 = 0.1;

/// The map of what is drawn: from 0 on plain ground to `ceiling`, 0..1, where the contrast is that of an edge between
/// greys a tenth of the way from black to white apart. A value is the root of the trace of the structure tensor of
/// lightness (CIE 1976), which is a mean over about a 256th of the longer side.
///
/// `features`: a rigidity map with its size, which the result has, too. Around its rigid parts the result is 0, and
/// everywhere if nothing in it is over a half: there, grey alone would count as a feature.
#[must_use]
pub fn of_detail(picture: Picture, features: Option<(&[u8], [usize; 2])>, ceiling: f32) -> Vec<u8> {
    let size = features.map_or(picture.size, |(_, size)| size);
    if features.is_some_and(|(map, _)| map.iter().all(|&value| value < 128)) {
        return vec![0; size[0] * size[1]];
    }
    let light: [f32; 256] = std::array::from_fn(|k| light(k as f32 / 255.0));
    // Four texels per cell resolve the tensor.
    let shown = blocks(picture.size, 4 * CELLS, |k| picture.brightness(k, |byte| light[usize::from(byte)]));
    let [width, height] = shown.size;
    let side = width.max(height);
    let per_cell = (side as f32 / CELLS as f32).max(1.0);
    let near = features.map(|(map, size)| {
        let rigid = Plane::of_map(map, size).smaller(side).fitted(shown.size);
        let rigid = rigid.values.iter().map(|&value| value > 0.0).collect();
        grown(rigid, shown.size, (MARGIN * per_cell).round_ties_even() as usize)
    });
    let is_free = |k: usize| near.as_ref().is_none_or(|near| !near[k]);
    let lightness: Vec<f32> = shown.values.iter().map(|value| 1.16 * value.cbrt()).collect();
    let trace = |k: usize| {
        let [right, down] = [(k % width + 1 < width, 1), (k / width + 1 < height, width)]
            .map(|(is_inside, step)| if is_inside { lightness[k + step] - lightness[k] } else { 0.0 });
        if is_free(k) { right * right + down * down } else { 0.0 }
    };
    let trace = Plane { values: (0..width * height).map(trace).collect(), size: shown.size };
    let mut found = trace.blurred((per_cell / 2.0).round_ties_even().max(1.0) as usize);
    for (k, value) in found.values.iter_mut().enumerate() {
        let contrast = (per_cell * value.max(0.0)).sqrt();
        let share = ((contrast - PLAIN) / (DRAWN - PLAIN)).clamp(0.0, 1.0);
        *value = if is_free(k) { ceiling * share } else { 0.0 };
    }
    found.fitted(size).to_map()
}

/// Linear light of a value in the curve of sRGB.
fn light(coded: f32) -> f32 {
    if coded <= 0.04045 { coded / 12.92 } else { ((coded + 0.055) / 1.055).powf(2.4) }
}
