//! Computes mip levels as averages of two by two texels.

use std::sync::LazyLock;

use super::fill_rows;

/// The linear light of each 8-bit sRGB value.
pub static LIGHT: LazyLock<[f32; 256]> = LazyLock::new(|| {
    std::array::from_fn(|k| {
        let x = k as f32 / 255.0;
        if x <= 0.04045 { x / 12.92 } else { ((x + 0.055) / 1.055).powf(2.4) }
    })
});

/// The 8-bit sRGB values of 4096 steps of light, from which [`encoded`] takes the nearest one.
static ENCODED: LazyLock<Vec<u8>> = LazyLock::new(|| {
    let encode = |k: usize| {
        let x = k as f32 / 4095.0;
        let y = if x <= 0.003_130_8 { 12.92 * x } else { 1.055 * x.powf(1.0 / 2.4) - 0.055 };
        (255.0 * y).round() as u8
    };
    (0..4096).map(encode).collect()
});

/// The 8-bit sRGB value of light.
pub fn encoded(light: f32) -> u8 {
    ENCODED[(light.clamp(0.0, 1.0) * 4095.0 + 0.5) as usize]
}

/// All levels of a square image whose side is a power of two, from the finest to one texel.
pub fn levels<T: Copy + Default + Send + Sync>(finest: Vec<T>, mean: fn([T; 4]) -> T) -> Vec<Vec<T>> {
    let mut side = finest.len().isqrt();
    let mut levels = vec![finest];
    while side > 1 {
        let fine = &levels[levels.len() - 1];
        let mut coarse = vec![T::default(); side * side / 4];
        fill_rows(&mut coarse, side / 2, |y, row| {
            for (x, texel) in row.iter_mut().enumerate() {
                let at = 2 * y * side + 2 * x;
                *texel = mean([fine[at], fine[at + 1], fine[at + side], fine[at + side + 1]]);
            }
        });
        levels.push(coarse);
        side /= 2;
    }
    levels
}

/// The mean of opaque sRGB colours, as light.
pub fn mean_colour(texels: [[u8; 4]; 4]) -> [u8; 4] {
    let light = |c: usize| texels.iter().map(|texel| LIGHT[texel[c] as usize]).sum::<f32>() / 4.0;
    [encoded(light(0)), encoded(light(1)), encoded(light(2)), 255]
}

pub fn mean_uv(texels: [[f32; 2]; 4]) -> [f32; 2] {
    [0, 1].map(|c| texels.iter().map(|texel| texel[c]).sum::<f32>() / 4.0)
}
