//! Rasterises triangles: finds the triangle at each sample of a raster, and the position on it.

/// The triangle at a sample, and the weights of its corners there.
pub type Hit = Option<(u32, [f32; 3])>;

pub struct Raster {
    pub size: [usize; 2],
    pub hits: Vec<Hit>,
}

impl Raster {
    /// Draws triangles from both sides with a depth buffer. `corners` are in samples (y down), with the depth (larger =
    /// nearer).
    pub fn new(triangles: impl Iterator<Item = (u32, [[f64; 3]; 3])>, [width, height]: [usize; 2]) -> Raster {
        let mut hits: Vec<Hit> = vec![None; width * height];
        let mut depths = vec![f64::MIN; width * height];
        for (index, [a, b, c]) in triangles {
            let area = (b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0]);
            if area == 0.0 || !area.is_finite() {
                continue;
            }
            let span = |k: usize, size: usize| {
                let low = a[k].min(b[k]).min(c[k]).floor().clamp(0.0, size as f64) as usize;
                let high = a[k].max(b[k]).max(c[k]).ceil().clamp(0.0, size as f64) as usize;
                low..high
            };
            for y in span(1, height) {
                for x in span(0, width) {
                    let p = [x as f64 + 0.5, y as f64 + 0.5];
                    let side = |p0: [f64; 3], p1: [f64; 3]| {
                        ((p1[0] - p0[0]) * (p[1] - p0[1]) - (p1[1] - p0[1]) * (p[0] - p0[0])) / area
                    };
                    let w = [side(b, c), side(c, a), side(a, b)];
                    let depth = w[0] * a[2] + w[1] * b[2] + w[2] * c[2];
                    // Triangles contain their edges, so no sample between two triangles is missed.
                    if w.iter().all(|&w| w >= -1e-9) && depth > depths[y * width + x] {
                        depths[y * width + x] = depth;
                        hits[y * width + x] = Some((index, w.map(|w| w as f32)));
                    }
                }
            }
        }
        Raster { size: [width, height], hits }
    }
}
