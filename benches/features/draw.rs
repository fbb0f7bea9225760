//! A picture of a model in a pose, its painted features looked up through the redirection: drawn without a GPU,
//! straight on, with a light at the camera.

use image::{Rgb, RgbImage};
use vrtm::{Asset, FetchKind};

use vrtm_testkit::features::of_asset;
use vrtm_testkit::{Maps, Model, fetch};

/// Camera of a scene: degrees around it and upward, its size relative to the picture, and the point in the middle, in
/// extents of the mesh from its own middle, to the right and up.
pub struct View {
    pub turn: [f64; 2],
    pub zoom: f64,
    pub middle: [f64; 2],
}

/// The views of the scenes that are drawn.
pub const VIEWS: [(&str, View); 4] = [
    ("fox", View { turn: [60.0, 15.0], zoom: 2.6, middle: [0.0, 0.0] }),
    ("ict_inner", View { turn: [20.0, 5.0], zoom: 2.2, middle: [0.0, 0.0] }),
    ("squash to 40 %", View { turn: [0.0, 0.0], zoom: 4.5, middle: [0.0, 0.07] }),
    ("creature", View { turn: [35.0, 20.0], zoom: 2.4, middle: [0.0, 0.0] }),
];

/// Samples along each side of a pixel.
const SAMPLES: usize = 3;
/// Texels on a side of the redirections.
const MAP: usize = 1024;
const GROUND: [f64; 3] = [0.93, 0.93, 0.92];
const ELASTIC: [f64; 3] = [0.86, 0.78, 0.66];
const RIGID: [f64; 3] = [0.13, 0.30, 0.47];
const HARMED: [f64; 3] = [0.85, 0.16, 0.12];

/// Draws the model as the asset's last result has it. Features that are worse by 0.02 than with the original UVs are
/// red.
pub fn draw(model: &Model, pose: &[[f32; 3]], asset: &mut Asset, view: &View, size: usize) -> RgbImage {
    let features = of_asset(model, pose, asset);
    let maps: Vec<Painted> = (0..model.maps.len())
        .map(|k| {
            let tile = asset.find_tile(model.maps[k].udim).expect("a tile of each map");
            let redirect = fetch(asset, tile, FetchKind::RedirectionDelta, [MAP as u32; 2]);
            let harmed = features.iter().filter(|f| f.at.0 == k && f.after > f.before + 0.02).map(|f| f.at.1);
            Painted { maps: &model.maps[k], redirect, harmed: filled(&model.maps[k], harmed) }
        })
        .collect();
    let points = turned(pose, view.turn);
    let range = |axis: usize| {
        let values = points.iter().map(|p| p[axis]);
        (values.clone().fold(f64::INFINITY, f64::min), values.fold(f64::NEG_INFINITY, f64::max))
    };
    let (x, y) = (range(0), range(1));
    let extent = (x.1 - x.0).max(y.1 - y.0);
    let centre = [0.5 * (x.0 + x.1) + view.middle[0] * extent, 0.5 * (y.0 + y.1) + view.middle[1] * extent];
    let side = size * SAMPLES;
    let scale = side as f64 * view.zoom / extent;
    let on_screen = |p: &[f64; 3]| {
        [(p[0] - centre[0]) * scale + side as f64 / 2.0, side as f64 / 2.0 - (p[1] - centre[1]) * scale, p[2]]
    };
    let mut colours = vec![GROUND; side * side];
    let mut depths = vec![f64::NEG_INFINITY; side * side];
    for face in model.faces() {
        for k in 1..face.len() - 1 {
            let corners = [face.start, face.start + k, face.start + k + 1];
            let space = corners.map(|c| points[model.indices[c] as usize]);
            let uvs = corners.map(|c| model.uvs[model.uv_indices[c] as usize].map(f64::from));
            let tile = [0, 1].map(|c| ((uvs[0][c] + uvs[1][c] + uvs[2][c]) / 3.0).floor());
            let udim = 1001 + tile[0] as u32 + 10 * tile[1] as u32;
            let Some(map) = maps.iter().find(|map| map.maps.udim == udim) else { continue };
            let light = 0.35 + 0.65 * facing(&space);
            covered(&space.each_ref().map(on_screen), side, |at, weights, depth| {
                if depth > depths[at] {
                    let uv = [0, 1].map(|c| (0..3).map(|k| weights[k] * uvs[k][c]).sum::<f64>() - tile[c]);
                    depths[at] = depth;
                    colours[at] = map.colour(uv).map(|c| c * light);
                }
            });
        }
    }
    RgbImage::from_fn(size as u32, size as u32, |x, y| {
        let samples = (0..SAMPLES * SAMPLES).map(|k| {
            let at = (y as usize * SAMPLES + k / SAMPLES) * side + x as usize * SAMPLES + k % SAMPLES;
            colours[at]
        });
        let sum = samples.fold([0.0; 3], |sum, c| [0, 1, 2].map(|k| sum[k] + c[k]));
        Rgb(sum.map(|c| (255.0 * c / (SAMPLES * SAMPLES) as f64) as u8))
    })
}

/// A tile: what is painted on it, where its texels are led to (by how far, first row at v = 0), and which texels belong
/// to features that are worse.
struct Painted<'a> {
    maps: &'a Maps,
    redirect: Vec<[f32; 2]>,
    harmed: Vec<bool>,
}

impl Painted<'_> {
    fn colour(&self, uv: [f64; 2]) -> [f64; 3] {
        let by = [0, 1].map(|c| {
            bilinear([MAP; 2], uv, |i, j| {
                let x = f64::from(self.redirect[j * MAP + i][c]);
                // Texels beside all charts hold nothing.
                if x.is_finite() { x } else { 0.0 }
            })
        });
        let to = [uv[0] + by[0], uv[1] + by[1]];
        let [width, height] = [self.maps.width, self.maps.height].map(|n| n as usize);
        let at = |i: usize, j: usize| (height - 1 - j) * width + i;
        // A mean of places around takes the steps of texels from outlines.
        let around = [[-0.8, 0.0], [0.8, 0.0], [0.0, -0.8], [0.0, 0.8], [0.0, 0.0]];
        let places = around.map(|d| [to[0] + d[0] / width as f64, to[1] + d[1] / height as f64]);
        let painted =
            |place| bilinear([width, height], place, |i, j| f64::from(self.maps.rigidity[at(i, j)]) / 255.0);
        let rigidity = places.into_iter().map(painted).sum::<f64>() / places.len() as f64;
        let harm = bilinear([width, height], to, |i, j| f64::from(u8::from(self.harmed[at(i, j)])));
        match (rigidity > 0.5, harm > 0.25) {
            (false, _) => ELASTIC,
            (true, false) => RIGID,
            (true, true) => HARMED,
        }
    }
}

/// A value between the centres of texels, of which `texel` gives column i in row j from v = 0.
fn bilinear(size: [usize; 2], uv: [f64; 2], texel: impl Fn(usize, usize) -> f64) -> f64 {
    let at = [0, 1].map(|c| (uv[c] * size[c] as f64 - 0.5).clamp(0.0, size[c] as f64 - 1.0));
    let low = at.map(|x| x as usize);
    let high = [0, 1].map(|c| (low[c] + 1).min(size[c] - 1));
    let [s, t] = [0, 1].map(|c| at[c] - low[c] as f64);
    (1.0 - t) * ((1.0 - s) * texel(low[0], low[1]) + s * texel(high[0], low[1]))
        + t * ((1.0 - s) * texel(low[0], high[1]) + s * texel(high[0], high[1]))
}

/// The texels of the painted features that hold these places.
fn filled(maps: &Maps, places: impl Iterator<Item = [f64; 2]>) -> Vec<bool> {
    let [width, height] = [maps.width, maps.height].map(|n| n as usize);
    let mut found = vec![false; width * height];
    for [u, v] in places {
        let [x, y] = [u * width as f64, (1.0 - v) * height as f64].map(|x| x as usize);
        let mut open = vec![[x.min(width - 1), y.min(height - 1)]];
        while let Some([x, y]) = open.pop() {
            let texel = y * width + x;
            if found[texel] || maps.rigidity[texel] < 128 {
                continue;
            }
            found[texel] = true;
            open.extend([
                [x.saturating_sub(1), y],
                [(x + 1).min(width - 1), y],
                [x, y.saturating_sub(1)],
                [x, (y + 1).min(height - 1)],
            ]);
        }
    }
    found
}

/// Points turned by degrees around the vertical axis, then towards the camera.
fn turned(points: &[[f32; 3]], turn: [f64; 2]) -> Vec<[f64; 3]> {
    let [(sy, cy), (sp, cp)] = turn.map(|degrees| degrees.to_radians().sin_cos());
    let turn = |p: &[f32; 3]| {
        let [x, y, z] = p.map(f64::from);
        let (x, z) = (cy * x - sy * z, sy * x + cy * z);
        [x, cp * y - sp * z, sp * y + cp * z]
    };
    points.iter().map(turn).collect()
}

/// The cosine between a triangle's normal and the line to the camera, from either side.
fn facing(corners: &[[f64; 3]; 3]) -> f64 {
    let [a, b] = [1, 2].map(|k| [0, 1, 2].map(|c| corners[k][c] - corners[0][c]));
    let normal = [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]];
    normal[2].abs() / normal.iter().map(|x| x * x).sum::<f64>().sqrt().max(f64::MIN_POSITIVE)
}

/// Calls `found(sample, weights, depth)` for each sample inside a triangle.
fn covered(corners: &[[f64; 3]; 3], side: usize, mut found: impl FnMut(usize, [f64; 3], f64)) {
    let [a, b, c] = corners;
    let area = (b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0]);
    if area == 0.0 {
        return;
    }
    let range = |axis: usize| {
        let values = corners.iter().map(|p| p[axis]);
        let low = values.clone().fold(f64::INFINITY, f64::min).max(0.0) as usize;
        low..((values.fold(f64::NEG_INFINITY, f64::max).max(0.0) as usize) + 1).min(side)
    };
    for y in range(1) {
        for x in range(0) {
            let p = [x as f64 + 0.5, y as f64 + 0.5];
            let part =
                |u: &[f64; 3], v: &[f64; 3]| (u[0] - p[0]) * (v[1] - p[1]) - (u[1] - p[1]) * (v[0] - p[0]);
            let weights = [part(b, c), part(c, a), part(a, b)].map(|w| w / area);
            if weights.iter().all(|&w| w >= 0.0) {
                let depth = (0..3).map(|k| weights[k] * corners[k][2]).sum();
                found(y * side + x, weights, depth);
            }
        }
    }
}
