//! The texture of the pictures, painted from the rigidity map: gold studs on blue enamel with a fine UV grid.

use vrtm_examples::maps::Map;

use crate::field::Field;

/// Linear RGB.
pub type Colour = [f32; 3];

const ENAMEL: Colour = [0.020, 0.095, 0.330];
const LINES: Colour = [0.070, 0.200, 0.480];
const STUD: Colour = [0.92, 0.60, 0.20];
const RIM: Colour = [0.004, 0.012, 0.050];
/// Approximate width in pixels of a cell of the UV grid on the enamel.
const CELL: f32 = 26.0;
/// Half of the width of an outline and of a grid line, in pixels.
const OUTLINE_WIDTH: f32 = 1.4;
const LINE_WIDTH: f32 = 0.55;
/// Rigidity at which a feature's outline lies: low, so that features of rigidity one half have an outline, too.
const OUTLINE: f32 = 0.28;

pub struct Material {
    /// The rigidity, smoothed slightly: the outlines of an 8-bit mask would otherwise be staircases.
    rigidity: Option<Field<1>>,
    /// Approximate length of the tile's side on the mesh at rest.
    side: f64,
}

impl Material {
    pub fn new(map: Option<&Map>, side: f64) -> Material {
        let rigidity = map.map(|map| {
            let size = map.size.map(|n| n as usize);
            let data = map.values().into_iter().map(|v| [v]).collect();
            let field = Field { size, data };
            smooth(&field)
        });
        Material { rigidity, side }
    }

    /// Smoothed rigidity at a UV.
    pub fn rigidity(&self, uv: [f32; 2]) -> f32 {
        self.rigidity.as_ref().map_or(0.0, |map| map.sample(uv)[0])
    }

    /// Colour at a UV in a picture with `scale` pixels per unit of length; lines are equally wide on every mesh.
    pub fn colour(&self, uv: [f32; 2], scale: f64) -> Colour {
        let pixels = (self.side * scale).clamp(64.0, 65536.0) as f32;
        let cells = (pixels / CELL).log2().round().exp2();
        let line = |x: f32| {
            let distance = (0.5 - ((x * cells).fract().abs() - 0.5).abs()) * pixels / cells;
            1.0 - step(0.5 * LINE_WIDTH, 1.5 * LINE_WIDTH, distance)
        };
        let colour = mix(ENAMEL, LINES, line(uv[0]).max(line(uv[1])));
        let Some(map) = &self.rigidity else { return colour };
        let r = map.sample(uv)[0];
        let texel = map.size.map(|n| 1.0 / n as f32);
        let along = |du: f32, dv: f32| map.sample([uv[0] + du, uv[1] + dv])[0];
        // Change of the rigidity per texel toward u and v.
        let slope = [
            0.5 * (along(texel[0], 0.0) - along(-texel[0], 0.0)),
            0.5 * (along(0.0, texel[1]) - along(0.0, -texel[1])),
        ];
        // Light from the texture's upper left makes the rim of a stud look raised.
        let relief = 1.0 + 0.9 * (0.6 * slope[0] - 0.8 * slope[1]);
        let stud = mix(ENAMEL, STUD, 0.35 + 0.65 * r).map(|c| c * relief);
        let colour = mix(colour, stud, step(OUTLINE - 0.05, OUTLINE + 0.05, r));
        // Distance to the outline in pixels. The outline is at least a texel wide, otherwise the bilinear filter would
        // become visible.
        let wide = pixels * texel[0];
        let distance = (r - OUTLINE).abs() / slope[0].hypot(slope[1]).max(1e-4) * wide;
        let width = OUTLINE_WIDTH.max(0.4 * wide);
        mix(RIM, colour, step(0.6 * width, 1.4 * width, distance))
    }
}

/// The mean over two texels in each direction.
fn smooth(map: &Field<1>) -> Field<1> {
    let [width, height] = map.size;
    let mean = |k: usize| {
        let uv = |dx: f32, dy: f32| {
            let (x, y) = ((k % width) as f32 + 0.5 + dx, (k / width) as f32 + 0.5 + dy);
            [x / width as f32, 1.0 - y / height as f32]
        };
        let around = [(-0.75, -0.75), (0.75, -0.75), (-0.75, 0.75), (0.75, 0.75)];
        [around.map(|(dx, dy)| map.sample(uv(dx, dy))[0]).iter().sum::<f32>() / 4.0]
    };
    Field { size: map.size, data: (0..width * height).map(mean).collect() }
}

pub fn mix(a: Colour, b: Colour, t: f32) -> Colour {
    [0, 1, 2].map(|c| a[c] + (b[c] - a[c]) * t)
}

/// 0 below `a`, 1 above `b`, smooth in between.
pub fn step(a: f32, b: f32, x: f32) -> f32 {
    let t = ((x - a) / (b - a)).clamp(0.0, 1.0);
    t * t * (3.0 - 2.0 * t)
}
