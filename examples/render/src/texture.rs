//! The painted texture of a tile, made from its rigidity: studs with crossing lines over a coloured
//! checker with a ring in each square, so that errors are visible. Rows run from v = 0 upward.

use super::{fill_rows, mips};
use vrtm_testkit::scenes::TileMaps;

/// Squares of the checker along a side, and lines on studs.
const SQUARES: f32 = 32.0;
const LINES: f32 = 128.0;
/// Rigidity at which a stud's outline lies.
const OUTLINE: f32 = 0.5;

/// The colours of a texture, in sRGB, with all its levels.
pub type Levels = Vec<Vec<[u8; 4]>>;

/// The colours of a tile; it may lack a rigidity map.
pub fn colours(tile: Option<&TileMaps>, side: usize) -> Levels {
    let rigidity = tile.map(Rigidity::new);
    let mut texels = vec![[0; 4]; side * side];
    fill_rows(&mut texels, side, |y, row| {
        for (x, texel) in row.iter_mut().enumerate() {
            let uv = [x, y].map(|k| (k as f32 + 0.5) / side as f32);
            let [r, g, b] = colour(rigidity.as_ref(), uv).map(mips::encoded);
            *texel = [r, g, b, 255];
        }
    });
    mips::levels(texels, mips::mean_colour)
}

/// Light at a UV.
fn colour(map: Option<&Rigidity>, uv: [f32; 2]) -> [f32; 3] {
    let square = uv.map(|x| (x * SQUARES).floor());
    let even = (square[0] + square[1]) % 2.0 == 0.0;
    // Colours vary over the tile, so that no two places look alike.
    let part = |phase: f32| 0.5 + 0.5 * (6.3 * (uv[0] * 1.3 + uv[1] * 0.9 + phase)).cos();
    let strength = if even { 0.34 } else { 0.16 };
    let mut light = [part(0.0), part(0.33), part(0.67)].map(|c| strength * (0.35 + 0.65 * c));
    let inside = [0, 1].map(|c| uv[c] * SQUARES - square[c] - 0.5);
    let ring = (inside[0].hypot(inside[1]) - 0.32).abs();
    light = mix(light, [0.55, 0.55, 0.5], 1.0 - step(0.03, 0.05, ring));
    let Some(map) = map else { return light };
    let r = map.at(uv);
    let line = |x: f32| ((x * LINES).fract() - 0.5).abs();
    let lines = step(0.38, 0.44, line(uv[0])).max(step(0.38, 0.44, line(uv[1])));
    let stud = mix([0.86, 0.58, 0.20], [0.20, 0.06, 0.02], 0.85 * lines);
    light = mix(light, stud, step(OUTLINE - 0.04, OUTLINE + 0.04, r));
    // A dark outline, one and a half texels of the rigidity map wide.
    let [du, dv] = map.slope(uv);
    let distance = (r - OUTLINE).abs() / du.hypot(dv).max(1e-4);
    mix([0.01, 0.006, 0.006], light, step(0.5, 0.9, distance))
}

/// A rigidity map, smoothed: the outlines of an 8-bit mask would otherwise be staircases. Rows run from v = 0 upward.
struct Rigidity {
    size: [usize; 2],
    values: Vec<f32>,
}

impl Rigidity {
    fn new(tile: &TileMaps) -> Rigidity {
        let [width, height] = [tile.width as usize, tile.height as usize];
        let rows = tile.rigidity.chunks_exact(width).rev();
        let mut map = Rigidity {
            size: [width, height],
            values: rows.flatten().map(|&value| f32::from(value) / 255.0).collect(),
        };
        for _ in 0..2 {
            let old = Rigidity { size: map.size, values: map.values.clone() };
            fill_rows(&mut map.values, width, |y, row| {
                for (x, value) in row.iter_mut().enumerate() {
                    let [x, y] = [x as i64, y as i64];
                    let row = |y: i64| old.get(x - 1, y) + 2.0 * old.get(x, y) + old.get(x + 1, y);
                    *value = (row(y - 1) + 2.0 * row(y) + row(y + 1)) / 16.0;
                }
            });
        }
        map
    }

    fn get(&self, x: i64, y: i64) -> f32 {
        let [x, y] = [(x, 0), (y, 1)].map(|(k, axis)| k.clamp(0, self.size[axis] as i64 - 1) as usize);
        self.values[y * self.size[0] + x]
    }

    fn at(&self, uv: [f32; 2]) -> f32 {
        let at = [0, 1].map(|c| uv[c] * self.size[c] as f32 - 0.5);
        let [x, y] = at.map(|k| k.floor() as i64);
        let [s, t] = at.map(|k| k - k.floor());
        let row = |y: i64| self.get(x, y) + (self.get(x + 1, y) - self.get(x, y)) * s;
        row(y) + (row(y + 1) - row(y)) * t
    }

    /// Change per texel of the map.
    fn slope(&self, uv: [f32; 2]) -> [f32; 2] {
        let [a, b] = [0, 1].map(|c| 1.0 / self.size[c] as f32);
        [
            0.5 * (self.at([uv[0] + a, uv[1]]) - self.at([uv[0] - a, uv[1]])),
            0.5 * (self.at([uv[0], uv[1] + b]) - self.at([uv[0], uv[1] - b])),
        ]
    }
}

fn mix(a: [f32; 3], b: [f32; 3], t: f32) -> [f32; 3] {
    [0, 1, 2].map(|c| a[c] + (b[c] - a[c]) * t)
}

/// 0 below `a`, 1 above `b`, smooth in between.
fn step(a: f32, b: f32, x: f32) -> f32 {
    let t = ((x - a) / (b - a)).clamp(0.0, 1.0);
    t * t * (3.0 - 2.0 * t)
}
