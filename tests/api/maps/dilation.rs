//! What a texture holds around charts: with the dilation, a lookup beside a seam shows what the surface shows there.
//! The texture of these tests has the surface's own position at rest in each texel, so that a lookup tells where on the
//! surface its content is from, and both sides of a seam can be compared.

use std::collections::HashMap;

use vrtm::{ErrorKind, ImageLayout, ImageViewMut, PixelFormat, Strided};
use vrtm_testkit::{Model, assets, barycentric, cpu, dilation, on_all_cores, scenes};

const SIZE: usize = 1024;
const REACH: f64 = 1.0 / 32.0;

/// A face corner's vertex and UV.
type Corner = (u32, [f64; 2]);

/// A side of an edge: its tile, and the UVs of its ends.
type Side = (u32, [[f64; 2]; 2]);

/// A tile's texture of positions: `None` where nothing is known.
type Texture = Vec<Option<[f64; 3]>>;

struct Painted {
    textures: HashMap<u32, Texture>,
    /// Both sides of each edge at a seam, and its length on the surface.
    seams: Vec<([Side; 2], f64)>,
}

fn udim(uv: [f64; 2]) -> u32 {
    1001 + uv[0].floor() as u32 + 10 * uv[1].floor() as u32
}

impl Painted {
    fn new(model: &Model) -> Painted {
        let mut edges: HashMap<[u32; 2], Vec<Side>> = HashMap::new();
        let mut textures: HashMap<u32, Texture> = HashMap::new();
        for face in model.faces() {
            let corner = |c: usize| -> Corner {
                (model.indices[c], model.uvs[model.uv_indices[c] as usize].map(f64::from))
            };
            let corners: Vec<Corner> = face.map(corner).collect();
            let n = corners.len();
            let middle = [0, 1].map(|k| corners.iter().map(|c| c.1[k]).sum::<f64>() / n as f64);
            let tile = udim(middle);
            for k in 0..n {
                let mut ends = [corners[k], corners[(k + 1) % n]];
                ends.sort_by_key(|end| end.0);
                edges.entry(ends.map(|end| end.0)).or_default().push((tile, ends.map(|end| end.1)));
            }
            let texture = textures.entry(tile).or_insert_with(|| vec![None; SIZE * SIZE]);
            for k in 1..n - 1 {
                let of = [corners[0], corners[k], corners[k + 1]];
                let at = of.map(|c| [0, 1].map(|k| (c.1[k] - middle[k].floor()) * SIZE as f64 - 0.5));
                let p = of.map(|c| model.rest[c.0 as usize].map(f64::from));
                paint(texture, at, p);
            }
        }
        let seam = |(vertices, sides): (&[u32; 2], &Vec<Side>)| match sides[..] {
            [a, b] if a != b => {
                let [p, q] = vertices.map(|v| model.rest[v as usize].map(f64::from));
                Some(([a, b], distance(p, q)))
            }
            _ => None,
        };
        let mut seams: Vec<_> = edges.iter().filter_map(seam).collect();
        seams.sort_by(|a, b| a.partial_cmp(b).unwrap());
        Painted { textures, seams }
    }

    /// The texture at a UV, bilinear; what is not known is black.
    fn lookup(&self, tile: u32, uv: [f64; 2]) -> [f64; 3] {
        let at =
            [0, 1].map(|k| (uv[k] - ((tile - 1001) / [1, 10][k] % [10, 1000][k]) as f64) * SIZE as f64 - 0.5);
        self.weigh(&self.textures[&tile], at, true)
    }

    /// The mean of the four texels around a place, in texels; of the known ones alone, unless black counts.
    fn weigh(&self, texture: &Texture, at: [f64; 2], black: bool) -> [f64; 3] {
        let (mut sum, mut all) = ([0.0; 3], 0.0);
        for k in 0..4 {
            let texel = [0, 1].map(|axis| at[axis].floor() + f64::from(k >> axis & 1));
            let weight: f64 = (0..2).map(|axis| 1.0 - (at[axis] - texel[axis]).abs()).product();
            let [x, y] = texel.map(|x| x.clamp(0.0, SIZE as f64 - 1.0) as usize);
            if let Some(value) = texture[y * SIZE + x] {
                (0..3).for_each(|c| sum[c] += weight * value[c]);
                all += weight;
            }
        }
        let all = if black { 1.0 } else { all };
        sum.map(|x| x / all)
    }

    /// Copies what the dilations say. Returns the share of the copied texels whose source no chart covers.
    fn dilate(&mut self, model: &Model, reach: f64) -> f64 {
        let asset = model.bare_on(&cpu(2), Strided::from_slice(&model.rest));
        let before = self.textures.clone();
        let (mut copied, mut beside, mut different) = (0, 0, 0);
        for tile in 0..asset.tile_count() {
            let tile_udim = asset.tile(tile).udim();
            let origin = [(tile_udim - 1001) % 10, (tile_udim - 1001) / 10].map(f64::from);
            // u, v, 0 and whether they are known.
            let texels = dilation(&asset, tile, reach, SIZE as u32, [f32::NAN; 4]);
            for (n, [u, v, zero, known]) in texels.into_iter().enumerate() {
                let covered = before[&tile_udim][n].is_some();
                let own = [n % SIZE, n / SIZE].map(|x| (x as f64 + 0.5) / SIZE as f64);
                let own = [0, 1].map(|k| (own[k] + origin[k]) as f32);
                assert_eq!(zero, 0.0);
                let copies = [u, v] != own;
                // Where faces with more than four corners are bent in the UV plane, they are not divided alike here.
                different += usize::from(copies == covered && known == 1.0);
                assert!(known == 1.0 || !copies, "{n}: {u} {v}");
                if covered || !copies {
                    continue;
                }
                let uv = [u, v].map(f64::from);
                let from = udim(uv);
                let at = [0, 1].map(|k| (uv[k] - uv[k].floor()) * SIZE as f64 - 0.5);
                let value = self.weigh(&before[&from], at, false);
                copied += 1;
                if value[0].is_nan() {
                    beside += 1;
                } else {
                    self.textures.get_mut(&tile_udim).unwrap()[n] = Some(value);
                }
            }
        }
        assert!(different * 10_000 < before.len() * SIZE * SIZE, "{different}");
        f64::from(beside) / f64::from(copied.max(1))
    }

    /// Distance between the contents of both sides of the seams, in texels of the coarser side along the seam: median,
    /// 90 %, and the share over two texels.
    fn apart(&self) -> [f64; 3] {
        let mut apart = Vec::new();
        for (sides, length) in &self.seams {
            let shortest = sides.map(|(_, [a, b])| (a[0] - b[0]).hypot(a[1] - b[1]));
            let texel = length / (shortest[0].min(shortest[1]) * SIZE as f64);
            for k in 0..8 {
                let along = (f64::from(k) + 0.5) / 8.0;
                let [p, q] = sides.map(|(tile, ends)| {
                    self.lookup(tile, [0, 1].map(|k| ends[0][k] + along * (ends[1][k] - ends[0][k])))
                });
                apart.push(distance(p, q) / texel);
            }
        }
        apart.sort_by(f64::total_cmp);
        let over = apart.iter().filter(|x| **x > 2.0).count() as f64 / apart.len() as f64;
        [apart[apart.len() / 2], apart[apart.len() * 9 / 10], over]
    }
}

fn distance(p: [f64; 3], q: [f64; 3]) -> f64 {
    (0..3).map(|c| (p[c] - q[c]).powi(2)).sum::<f64>().sqrt()
}

fn paint(texture: &mut Texture, at: [[f64; 2]; 3], p: [[f64; 3]; 3]) {
    let span = |k: usize| {
        let of = |f: fn(f64, f64) -> f64| at.iter().map(|a| a[k]).reduce(f).unwrap();
        of(f64::min).ceil().max(0.0) as usize..=(of(f64::max).floor().max(0.0) as usize).min(SIZE - 1)
    };
    for y in span(1) {
        for x in span(0) {
            let w = barycentric(&at, [x as f64, y as f64]);
            if w.iter().all(|&w| w >= 0.0) {
                texture[y * SIZE + x] =
                    Some([0, 1, 2].map(|c| w[0] * p[0][c] + w[1] * p[1][c] + w[2] * p[2][c]));
            }
        }
    }
}

/// Bounds, about a third above the measured values: the median and 90 % of the distances, in texels, and the share over
/// two texels.
const BARS: [(&str, [f64; 3]); 6] = [
    ("creature", [0.09, 0.6, 0.001]),
    ("mh_face", [0.28, 1.05, 0.035]),
    ("spot", [0.28, 1.03, 0.035]),
    ("cesium_man", [0.17, 0.66, 0.02]),
    ("fox", [0.22, 0.73, 0.015]),
    ("ict_inner", [0.26, 0.92, 0.06]),
];

#[test]
fn both_sides_of_a_seam_show_the_same() {
    let models: Vec<Model> = [Model::from(scenes::creature())].into_iter().chain(assets()).collect();
    let rows = on_all_cores(&models, |model| {
        let mut painted = Painted::new(model);
        let before = painted.apart();
        let beside = painted.dilate(model, REACH);
        let after = painted.apart();
        let bars = BARS.iter().find(|bars| bars.0 == model.name).unwrap().1;
        let good = (0..3).all(|k| after[k] <= bars[k]) && before[2] > 0.5 && beside < 0.001;
        let line = format!(
            "{:13} {:5} {:8.3} {:8.3} {:6.4} | {:6.3} {:6.3} {:6.4} | {beside:.4}",
            model.name,
            painted.seams.len(),
            before[0],
            before[1],
            before[2],
            after[0],
            after[1],
            after[2]
        );
        (good, line)
    });
    println!(
        "scene, edges at seams; apart, in texels: 50 %, 90 %, share over 2, before | after | sources beside charts"
    );
    rows.iter().for_each(|row| println!("{}", row.1));
    let failed: Vec<_> = rows.iter().filter(|row| !row.0).map(|row| &*row.1).collect();
    assert!(failed.is_empty(), "\n{}", failed.join("\n"));
}

#[test]
fn bad_arguments_are_named() {
    let model = Model::from(scenes::creature());
    let asset = model.bare_on(&cpu(1), Strided::from_slice(&model.rest));
    let fetch = |tile: usize, reach: f64, channels: u32| {
        let mut bytes = vec![7; 16 * 16 * 16];
        let layout = ImageLayout::packed(16, 16, PixelFormat::F32).with_channels(channels);
        let mut image = ImageViewMut::new("image", &mut bytes, layout).unwrap();
        let error = asset.results().tile(tile).fetch_dilation(reach, &mut image).unwrap_err();
        assert!(bytes.iter().all(|&b| b == 7), "something was written");
        assert_eq!(error.kind, ErrorKind::InvalidArgument);
        error.to_string()
    };
    for reach in [0.0, -1.0, 0.6, f64::NAN, f64::INFINITY] {
        assert!(fetch(0, reach, 4).contains("reach: "), "{reach}");
    }
    assert!(fetch(9, 0.1, 4).contains("tile: index 9"));
    assert!(fetch(0, 0.1, 1).contains("image: 1 channels"));
}
