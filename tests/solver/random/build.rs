//! Builds the arrays, maps and poses of a recipe.

use std::collections::HashMap;

use vrtm::{
    Asset, Device, ImageLayout, ImageView, MeshSource, Origin, PixelFormat, SolveOptions, Strided, UvSource,
    Weld,
};

use super::recipe::{Joints, Layer, Move, Paint, Piece, Recipe, Rigidity, Shape};

/// The data that a host would hand over.
#[derive(Default)]
pub struct Model {
    pub rest: Vec<[f64; 3]>,
    pub uvs: Vec<[f32; 2]>,
    pub faces: Vec<Vec<u32>>,
    pub poses: Vec<Vec<[f64; 3]>>,
    /// Of each vertex, the one that it is a copy of, or itself.
    pub original: Vec<u32>,
    pub seams: Vec<[u32; 2]>,
    /// Per face, whether it has a texture.
    pub textured: Vec<bool>,
}

/// The edges of a face.
pub fn edges(face: &[u32]) -> impl Iterator<Item = [u32; 2]> {
    (0..face.len()).map(|k| [face[k], face[(k + 1) % face.len()]])
}

/// A number between 0 and 1 for each seed and index (an integer hash of 32 bits after Wellons).
pub fn random(seed: u32, k: u32) -> f32 {
    let mut x = seed.wrapping_mul(0x9E37_79B9) ^ k.wrapping_mul(0x85EB_CA6B).wrapping_add(0x7F4A_7C15);
    for _ in 0..2 {
        x = (x ^ (x >> 16)).wrapping_mul(0x7FEB_352D);
        x = (x ^ (x >> 15)).wrapping_mul(0x846C_A68B);
    }
    ((x ^ (x >> 16)) >> 8) as f32 / (1 << 24) as f32
}

impl Shape {
    /// Points in the unit square, faces, and the size of a quad.
    fn mesh(&self) -> (Vec<[f32; 2]>, Vec<Vec<u32>>, [f32; 2]) {
        match *self {
            Shape::Sheet(nx, ny) => {
                let node = |i: u32, j: u32| j * (nx + 1) + i;
                let step = [1.0 / nx as f32, 1.0 / ny as f32];
                let points = (0..(nx + 1) * (ny + 1))
                    .map(|k| [(k % (nx + 1)) as f32 * step[0], (k / (nx + 1)) as f32 * step[1]])
                    .collect();
                let quad = |k: u32| {
                    let (i, j) = (k % nx, k / nx);
                    vec![node(i, j), node(i + 1, j), node(i + 1, j + 1), node(i, j + 1)]
                };
                (points, (0..nx * ny).map(quad).collect(), step)
            }
            Shape::Strip(n) => {
                let points = (0..n + 2).map(|k| [k as f32 / (n + 1) as f32, (k % 2) as f32]).collect();
                let triangle =
                    |k: u32| if k.is_multiple_of(2) { vec![k, k + 2, k + 1] } else { vec![k, k + 1, k + 2] };
                (points, (0..n).map(triangle).collect(), [1.0 / (n + 1) as f32, 1.0])
            }
            Shape::Fan(n) => {
                let rim = (0..n).map(|k| on_circle(k as f32 / n as f32, 0.5));
                let points = std::iter::once([0.5; 2]).chain(rim).collect();
                (points, (0..n).map(|k| vec![0, 1 + k, 1 + (k + 1) % n]).collect(), [1.0 / n as f32; 2])
            }
            Shape::Polygon(n) => {
                // From the second one on, every other corner lies at half the radius: the polygon is concave.
                let radius = |k: u32| if k % 2 == 1 && n > 4 { 0.25 } else { 0.5 };
                let points = (0..n).map(|k| on_circle(k as f32 / n as f32, radius(k))).collect();
                (points, vec![(0..n).collect()], [0.0; 2])
            }
        }
    }
}

fn on_circle(fraction: f32, radius: f32) -> [f32; 2] {
    let (sin, cos) = (fraction * std::f32::consts::TAU).sin_cos();
    [0.5 + radius * cos, 0.5 + radius * sin]
}

impl Piece {
    /// Adds the piece's vertices, UVs and faces; `number` keeps pieces apart in space.
    fn add_to(&self, model: &mut Model, number: usize, polygons: bool) {
        let (points, faces, quad) = self.shape.mesh();
        let first = model.uvs.len();
        let noise = |k: usize, c: u32| random(self.seed, 4 * k as u32 + c) - 0.5;
        for (k, p) in points.iter().enumerate() {
            // Jitter moves the UV alone; the surface does not move.
            let [s, t] = [0, 1].map(|c| p[c] + self.jitter * quad[c] * noise(k, c as u32) - 0.5);
            let s = if self.mirrored { -s } else { s };
            let ([s, t], (sin, cos)) = ([s * self.size[0], t * self.size[1]], self.turn.sin_cos());
            let middle = [0, 1].map(|c| self.low[c] + 0.5 * self.size[c]);
            model.uvs.push([middle[0] + cos * s - sin * t, middle[1] + sin * s + cos * t]);

            let [x, y] = [0, 1].map(|c| f64::from(p[c] * self.size[c] * self.stretch[c]));
            let (bend, crumple) = (f64::from(self.bend), f64::from(self.crumple));
            let z = bend * (5.0 * x).sin() * (4.0 * y).cos() + crumple * f64::from(noise(k, 2));
            model.rest.push([x + number as f64, y, z]);
        }
        if self.weld > 0 {
            for k in (first..model.uvs.len() - 1).step_by(self.weld as usize) {
                model.uvs[k] = model.uvs[k + 1];
            }
        }
        for (k, face) in faces.into_iter().enumerate() {
            let mut face: Vec<u32> = face.iter().map(|v| v + first as u32).collect();
            if self.flip > 0 && (k as u32).is_multiple_of(self.flip) {
                face.reverse();
            }
            if polygons {
                model.faces.push(face);
            } else {
                model.faces.extend((1..face.len() - 1).map(|k| vec![face[0], face[k], face[k + 1]]));
            }
        }
    }
}

impl Joints {
    fn apply(&self, model: &mut Model) {
        model.original = (0..model.rest.len() as u32).collect();
        let mut copies = HashMap::new();
        for (f, face) in model.faces.iter_mut().enumerate() {
            if self.cut > 0.0 && random(self.seed, f as u32) < self.cut {
                for v in face {
                    *v = *copies.entry(*v).or_insert_with(|| {
                        let copy = model.rest.len() as u32;
                        let noise = |c: u32| self.noise * (random(self.seed, copy * 2 + c) - 0.5);
                        let [x, y] = model.uvs[*v as usize];
                        model.rest.push(model.rest[*v as usize]);
                        model.uvs.push([x + noise(0), y + noise(1)]);
                        model.original.push(*v);
                        copy
                    });
                }
            }
        }
        let every = |n: u32, k: usize| n > 0 && (k as u32 + self.seed).is_multiple_of(n);
        let all: Vec<[u32; 2]> = model.faces.iter().flat_map(|face| edges(face)).collect();
        model.seams = (0..all.len()).filter(|&k| every(self.seams, k)).map(|k| all[k]).collect();
        model.textured = (0..model.faces.len()).map(|f| !every(self.bare, f)).collect();
    }
}

impl Move {
    fn apply(&self, points: &mut [[f64; 3]]) {
        let last = points.len() - 1;
        match *self {
            Move::Line => points.iter_mut().for_each(|p| *p = [p[0], 0.3 * p[0], 0.1]),
            Move::Point => points.fill([0.3, -0.2, 0.1]),
            Move::Spike(k, size) => points[k as usize % (last + 1)][2] += size,
            Move::Noise(size, seed) => {
                for (k, x) in points.iter_mut().flatten().enumerate() {
                    *x += size * f64::from(random(seed, k as u32) - 0.5);
                }
            }
            _ => points.iter_mut().for_each(|p| *p = self.of(*p)),
        }
    }

    fn of(&self, [x, y, z]: [f64; 3]) -> [f64; 3] {
        match *self {
            Move::Turn(angle) => {
                let (sin, cos) = angle.sin_cos();
                let [x, y] = [cos * x - sin * y, sin * x + cos * y];
                [x, cos * y - sin * z, sin * y + cos * z]
            }
            Move::Scale(s) => [s[0] * x, s[1] * y, s[2] * z],
            Move::Shear(k) => [x + k * y, y, z],
            Move::Twist(angle) => {
                let (sin, cos) = (angle * x).sin_cos();
                [x, cos * y - sin * z, sin * y + cos * z]
            }
            Move::Bulge(size) => {
                let t = (1.0 - 6.0 * ((x - 0.4).powi(2) + (y - 0.4).powi(2))).max(0.0);
                [x, y, z + size * t * t]
            }
            Move::Shift(d) => [x + d, y - d, z],
            _ => [x, y, z],
        }
    }
}

impl Paint {
    fn at(&self, x: u32, y: u32, size: [u32; 2]) -> f32 {
        let disc = |n: u32| {
            let off = |x: u32, size: u32| (n as f32 * (x as f32 + 0.5) / size as f32).fract() - 0.5;
            off(x, size[0]).powi(2) + off(y, size[1]).powi(2) < 0.09
        };
        match *self {
            Paint::Constant(value) => value,
            Paint::Grey(seed) => random(seed, y * size[0] + x),
            Paint::Bits(seed) => random(seed, y * size[0] + x).round(),
            Paint::Discs(n) => f32::from(disc(n)),
            Paint::Holes(n) => f32::from(!disc(n)),
            Paint::Checker(n) => ((x / n + y / n) % 2) as f32,
            Paint::Curve => f32::from((x * x / size[0]).abs_diff(y) > 1),
        }
    }
}

impl Layer {
    pub fn values(&self) -> Vec<f32> {
        let [width, height] = self.size;
        (0..width * height).map(|k| self.paint.at(k % width, k / width, self.size)).collect()
    }

    /// Calls `f` with a view of the map, first row at v = 0.
    fn with<R>(&self, f: impl FnOnce(ImageView) -> R) -> R {
        let bytes: Vec<u8> = self.values().iter().flat_map(|v| v.to_ne_bytes()).collect();
        let [width, height] = self.size;
        let layout = ImageLayout::packed(width, height, PixelFormat::F32);
        f(ImageView::new("map", &bytes, ImageLayout { origin: Origin::Bottom, ..layout }).unwrap())
    }
}

impl Recipe {
    pub fn model(&self) -> Model {
        let mut model = Model::default();
        for (number, piece) in self.pieces.iter().enumerate() {
            piece.add_to(&mut model, number, self.polygons);
        }
        self.joints.apply(&mut model);
        for frame in &self.frames {
            let mut pose = model.rest.clone();
            frame.iter().for_each(|step| step.apply(&mut pose));
            model.poses.push(pose);
        }
        let unit = 10f64.powi(self.unit);
        for p in std::iter::once(&mut model.rest).chain(&mut model.poses).flatten().flatten() {
            *p = (*p + self.away) * unit;
            if !self.doubles {
                *p = f64::from(p.clamp(-3e38, 3e38) as f32);
            }
        }
        model
    }

    /// Calls `f` with the positions in the recipe's format.
    pub fn with_positions<R>(&self, points: &[[f64; 3]], f: impl FnOnce(Strided) -> R) -> R {
        if self.doubles {
            return f(Strided::from_slice(points));
        }
        let floats: Vec<[f32; 3]> = points.iter().map(|p| p.map(|x| x as f32)).collect();
        f(Strided::from_slice(&floats))
    }

    pub fn asset(&self, model: &Model, device: &Device) -> vrtm::Result<Asset> {
        let indices: Vec<u32> = model.faces.iter().flatten().copied().collect();
        let counts: Vec<u32> = model.faces.iter().map(|face| face.len() as u32).collect();
        let [u, v] = [0, 1].map(|axis| {
            let noise = |c: usize| self.joints.noise * (random(self.joints.seed, c as u32 * 2 + axis) - 0.5);
            let corner = |(c, &k): (usize, &u32)| model.uvs[k as usize][axis as usize] + noise(c);
            indices.iter().enumerate().map(corner).collect::<Vec<f32>>()
        });
        let textured = |f: usize| std::iter::repeat_n(model.textured[f], model.faces[f].len());
        let uv_indices: Vec<u32> = (0..model.faces.len())
            .flat_map(textured)
            .zip(&indices)
            .map(|(textured, &k)| if textured { k } else { u32::MAX })
            .collect();
        // Faces without texture are told by their UV indices if there are any, otherwise by a list of the others.
        let uvs = if self.split_uvs {
            UvSource { u: Strided::from_slice(&u), v: Some(Strided::from_slice(&v)), indices: None }
        } else {
            UvSource { u: Strided::from_slice(&model.uvs), v: None, indices: Some(&uv_indices) }
        };
        let chosen: Vec<u32> = (0..).zip(&model.textured).filter(|(_, t)| **t).map(|(f, _)| f).collect();
        let offsets: Vec<u32> = std::iter::once(0)
            .chain(counts.iter().scan(0, |end, n| {
                *end += n;
                Some(*end)
            }))
            .collect();
        let mut asset = self.with_positions(&model.rest, |positions| {
            Asset::new(
                device,
                &MeshSource {
                    positions,
                    face_counts: (self.polygons && !self.joints.offsets).then_some(counts.as_slice()),
                    face_offsets: (self.polygons && self.joints.offsets).then_some(offsets.as_slice()),
                    indices: &indices,
                    uvs,
                    textured_faces: self.split_uvs.then_some(chosen.as_slice()),
                    seams: &model.seams,
                    weld: Weld { by: self.joints.weld, ..Weld::default() },
                    ..MeshSource::default()
                },
            )
        })?;
        for tile in 0..asset.tile_count() {
            if let Rigidity::Map(layer) = &self.rigidity {
                layer.with(|view| asset.tile_mut(tile).set_rigidity(Some(view)))?;
            }
            if let Some(layer) = &self.mask {
                layer.with(|view| asset.tile_mut(tile).set_mask(Some(view)))?;
            }
            asset.tile_mut(tile).set_settings(&self.settings)?;
        }
        if let Rigidity::Vertices(paint) = &self.rigidity {
            let size = [model.rest.len() as u32, 1];
            let values: Vec<f32> = (0..size[0]).map(|k| paint.at(k, 0, size)).collect();
            asset.set_vertex_rigidity(Some(Strided::from_slice(&values)))?;
        }
        Ok(asset)
    }

    pub fn solve(&self, asset: &mut Asset, pose: &[[f64; 3]]) -> vrtm::Result<()> {
        self.solve_with(asset, pose, &self.options)
    }

    pub fn solve_with(
        &self,
        asset: &mut Asset,
        pose: &[[f64; 3]],
        options: &SolveOptions,
    ) -> vrtm::Result<()> {
        self.with_positions(pose, |positions| asset.solve(positions, options))
    }
}
