//! Paints rigidity maps: shapes with soft edges, in UV units.

use super::TileMaps;
use super::build::sin_cos;

pub struct Canvas {
    width: usize,
    height: usize,
    values: Vec<f64>,
}

impl Canvas {
    pub fn new(width: usize, height: usize) -> Canvas {
        Canvas { width, height, values: vec![0.0; width * height] }
    }

    /// Paints texels whose `distance` (to the outline, negative inside) is less than half of `soft`; the larger value
    /// is kept.
    fn shape(
        &mut self,
        centre: [f64; 2],
        reach: f64,
        soft: f64,
        peak: f64,
        distance: impl Fn(f64, f64) -> f64,
    ) {
        let (w, h) = (self.width as f64, self.height as f64);
        let soft = soft.max(1.0 / w.max(h));
        let span = |centre: f64, size: f64, count: usize| {
            let low = ((centre - reach - soft) * size).floor().clamp(0.0, size) as usize;
            let high = ((centre + reach + soft) * size).ceil().clamp(0.0, size) as usize;
            low..high.min(count)
        };
        for y in span(1.0 - centre[1], h, self.height) {
            for x in span(centre[0], w, self.width) {
                let u = (x as f64 + 0.5) / w - centre[0];
                let v = 1.0 - (y as f64 + 0.5) / h - centre[1];
                let value = peak * (0.5 - distance(u, v) / soft).clamp(0.0, 1.0);
                let texel = &mut self.values[y * self.width + x];
                *texel = texel.max(value);
            }
        }
    }

    pub fn disc(&mut self, centre: [f64; 2], radius: f64, soft: f64, peak: f64) {
        self.shape(centre, radius, soft, peak, |u, v| (u * u + v * v).sqrt() - radius);
    }

    pub fn oval(&mut self, centre: [f64; 2], radii: [f64; 2], soft: f64, peak: f64) {
        let reach = radii[0].max(radii[1]);
        // First-order distance to an ellipse.
        self.shape(centre, reach, soft, peak, |u, v| {
            let [a, b] = radii;
            let f = ((u / a).powi(2) + (v / b).powi(2)).sqrt();
            let slope = ((u / (a * a)).powi(2) + (v / (b * b)).powi(2)).sqrt();
            if f > 0.0 && slope > 0.0 { (f - 1.0) * f / slope } else { -reach }
        });
    }

    /// A box with rounded corners, rotated by `angle`.
    pub fn tile(&mut self, centre: [f64; 2], half: [f64; 2], corner: f64, angle: f64, soft: f64, peak: f64) {
        let (sin, cos) = sin_cos(angle);
        self.shape(centre, half[0] + half[1], soft, peak, |u, v| {
            let x = (cos * u + sin * v).abs() - (half[0] - corner);
            let y = (cos * v - sin * u).abs() - (half[1] - corner);
            let outside = (x.max(0.0).powi(2) + y.max(0.0).powi(2)).sqrt();
            outside + x.max(y).min(0.0) - corner
        });
    }

    pub fn finish(self, udim: u32) -> TileMaps {
        let rigidity = self.values.iter().map(|v| (v * 255.0 + 0.5) as u8).collect();
        TileMaps { udim, width: self.width as u32, height: self.height as u32, rigidity, mask: None }
    }
}
