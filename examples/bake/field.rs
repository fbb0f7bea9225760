//! Outputs of vrtm in memory.

/// N channels per texel, first row at the top of the tile.
#[derive(Clone, Debug)]
pub struct Field<const N: usize> {
    pub size: [usize; 2],
    pub data: Vec<[f32; N]>,
}

impl<const N: usize> Field<N> {
    /// Bilinear between texel centres, clamped at the edges.
    pub fn sample(&self, uv: [f32; 2]) -> [f32; N] {
        let [width, height] = self.size;
        let (x0, x1, fx) = taps(uv[0] * width as f32 - 0.5, width);
        let (y0, y1, fy) = taps((1.0 - uv[1]) * height as f32 - 0.5, height);
        let at = |x: usize, y: usize| self.data[y * width + x];
        let (a, b, c, d) = (at(x0, y0), at(x1, y0), at(x0, y1), at(x1, y1));
        std::array::from_fn(|k| {
            let top = a[k] + (b[k] - a[k]) * fx;
            let bottom = c[k] + (d[k] - c[k]) * fx;
            top + (bottom - top) * fy
        })
    }
}

/// The two neighbours of a coordinate in texels, and the weight of the second.
fn taps(x: f32, size: usize) -> (usize, usize, f32) {
    let x = x.clamp(0.0, (size - 1) as f32);
    let low = x as usize;
    (low, (low + 1).min(size - 1), x - low as f32)
}
