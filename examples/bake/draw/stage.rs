//! The mesh as pictures show it: a pose in front of a camera, its painted surface, and the light on it.

use vrtm_examples::mesh::{Positions, Triangle, cross, dot, minus};
use vrtm_examples::source::Source;

use super::camera::Camera;
use super::material::{Colour, Material, mix, step};
use super::raster::Raster;
use crate::bake::{Bake, Tile};
use crate::field::Field;

/// Samples per pixel along each axis.
pub const SUPER: usize = 2;
pub const PAPER: Colour = [0.80, 0.80, 0.78];
pub const INK: Colour = [0.012, 0.012, 0.016];
/// Colour of elastic material in the strain pictures.
pub const QUIET: Colour = [0.16, 0.16, 0.165];

/// Everything that stays the same from picture to picture.
pub struct Stage<'a> {
    source: &'a Source,
    pub rest: Vec<[f32; 3]>,
    pub triangles: Vec<Triangle>,
    /// Index of each triangle's tile.
    pub owners: Vec<usize>,
    pub materials: Vec<Material>,
}

/// A pose as seen by a camera.
pub struct View {
    raster: Raster,
    /// Normals of the vertices in view space (right, up, toward the viewer), on the side that is meant to be seen.
    normals: Vec<[f64; 3]>,
    /// Pixels per unit of length.
    pub scale: f64,
}

/// The surface at a sample.
pub struct Sample {
    pub tile: usize,
    pub uv: [f32; 2],
    /// Unit normal toward the viewer, in view space.
    normal: [f32; 3],
    /// True if the surface is seen from inside.
    inside: bool,
}

impl<'a> Stage<'a> {
    pub fn new(source: &'a Source, bake: &Bake) -> Stage<'a> {
        let rest = near(source, &source.mesh.rest);
        let mut triangles = source.mesh.triangles();
        let owner = |t: &Triangle| bake.tiles.iter().position(|tile| tile.udim == t.udim);
        triangles.retain(|t| owner(t).is_some());
        let owners: Vec<usize> = triangles.iter().filter_map(owner).collect();
        let material = |(number, tile): (usize, &Tile)| {
            let own = triangles.iter().zip(&owners).filter(|(_, owner)| **owner == number);
            let areas = own.fold([0.0; 2], |[texture, surface], (t, _)| {
                let [a, b, c] = t.uvs.map(|[u, v]| [u, v, 0.0]);
                let [p, q, r] = t.vertices.map(|v| rest[v as usize].map(f64::from));
                let area =
                    |a, b, c| cross(minus(b, a), minus(c, a)).map(|x| x * x).iter().sum::<f64>().sqrt();
                [texture + area(a, b, c), surface + area(p, q, r)]
            });
            Material::new(tile.rigidity, (areas[1] / areas[0].max(1e-30)).sqrt())
        };
        let materials = bake.tiles.iter().enumerate().map(material).collect();
        Stage { source, rest, triangles, owners, materials }
    }

    /// A pose in f32, as pictures are drawn.
    pub fn near(&self, pose: &Positions) -> Vec<[f32; 3]> {
        near(self.source, pose)
    }

    /// Rest and all poses.
    pub fn poses(&self) -> Vec<Vec<[f32; 3]>> {
        let poses = self.source.frames.iter().map(|frame| self.near(&frame.positions));
        std::iter::once(self.rest.clone()).chain(poses).collect()
    }

    /// A pose on the straight way from rest, 0, to another one, 1.
    pub fn between(&self, pose: &Positions, way: f64) -> Positions {
        let rest = self.source.mesh.rest.iter();
        let point = |(a, b): ([f64; 3], [f64; 3])| [0, 1, 2].map(|c| (1.0 - way) * a[c] + way * b[c]);
        Positions::F64(rest.zip(pose.iter()).map(point).collect())
    }

    /// A pose in a picture of `size` pixels.
    pub fn view(&self, camera: &Camera, positions: &[[f32; 3]], size: [usize; 2]) -> View {
        let samples = size.map(|n| n * SUPER);
        let screen: Vec<[f64; 3]> = positions.iter().map(|&p| camera.project(p, samples)).collect();
        let corners = |t: &Triangle| t.vertices.map(|v| screen[v as usize]);
        let raster = Raster::new((0..).zip(self.triangles.iter().map(corners)), samples);

        let seen: Vec<[f64; 3]> = positions.iter().map(|&p| camera.view(p)).collect();
        let mut normals = vec![[0.0; 3]; positions.len()];
        // The sign of the enclosed volume tells whether the faces' winding points outward. Positions are relative to a
        // point of the mesh, since far from the origin the sum would be lost to rounding.
        let mut volume = 0.0;
        for t in &self.triangles {
            let [a, b, c] = t.vertices.map(|v| seen[v as usize]);
            let normal = cross(minus(b, a), minus(c, a));
            volume += dot(normal, minus(a, seen[0]));
            for v in t.vertices {
                normals[v as usize] = minus(normals[v as usize], normal.map(|x| -x));
            }
        }
        let sign = if volume < 0.0 { -1.0 } else { 1.0 };
        let normals = normals.into_iter().map(|n| n.map(|x| x * sign)).collect();
        View { raster, normals, scale: camera.scale(size) }
    }

    /// The surface at a sample of a view, counted from the upper left.
    pub fn sample(&self, view: &View, x: usize, y: usize) -> Option<Sample> {
        let (triangle, weights) = view.raster.hits[y * view.raster.size[0] + x]?;
        let t = &self.triangles[triangle as usize];
        let weights = weights.map(f64::from);
        let uv = [0, 1].map(|c| (0..3).map(|k| weights[k] * t.uvs[k][c]).sum::<f64>() as f32);
        let corners = t.vertices.map(|v| view.normals[v as usize]);
        let normal = [0, 1, 2].map(|c| (0..3).map(|k| weights[k] * corners[k][c]).sum::<f64>());
        let inside = normal[2] < 0.0;
        let length = dot(normal, normal).sqrt().max(1e-30) * if inside { -1.0 } else { 1.0 };
        let normal = normal.map(|x| (x / length) as f32);
        Some(Sample { tile: self.owners[triangle as usize], uv, normal, inside })
    }

    /// The painted surface with the texture looked up at a UV.
    pub fn painted(&self, view: &View, s: &Sample, target: [f32; 2]) -> Colour {
        light(self.materials[s.tile].colour(target, view.scale), s)
    }

    /// The surface in `colour` where the UV at which the texture is looked up is rigid.
    pub fn marked(&self, s: &Sample, target: [f32; 2], colour: impl FnOnce() -> Option<Colour>) -> Colour {
        let rigid = step(0.25, 0.40, self.materials[s.tile].rigidity(target));
        let colour = if rigid > 0.0 { colour() } else { None };
        soft_light(colour.map_or(QUIET, |colour| mix(QUIET, colour, rigid)), s)
    }
}

fn near(source: &Source, pose: &Positions) -> Vec<[f32; 3]> {
    pose.around(pose.origin(&source.mesh.rest))
}

/// The redirected UV. Deltas are interpolated, because they are zero at a chart's border and smooth inside.
pub fn redirect(map: &Field<3>, uv: [f32; 2]) -> [f32; 2] {
    let target = map.sample(uv);
    [0, 1].map(|c| {
        let half = 0.5 / map.size[c] as f32;
        uv[c] + target[c] - uv[c].clamp(half, 1.0 - half)
    })
}

/// Light from the upper left.
fn key([x, y, z]: [f32; 3]) -> f32 {
    (-0.45 * x + 0.55 * y + 0.70 * z).max(0.0)
}

/// Shades a colour with the key light and light from the sky.
fn light(colour: Colour, s: &Sample) -> Colour {
    let (key, sky) = (key(s.normal), 0.5 + 0.5 * s.normal[1]);
    let strength = (0.80 * key + 0.20 * sky + 0.10) * if s.inside { 0.45 } else { 1.0 };
    // A small, strong highlight, as glaze has it.
    colour.map(|c| c * strength + key.powi(40) * 0.22)
}

/// Shades flat enough to read colours from, but varied enough to show the shape.
fn soft_light(colour: Colour, s: &Sample) -> Colour {
    let strength = (0.68 + 0.32 * key(s.normal)) * if s.inside { 0.7 } else { 1.0 };
    colour.map(|c| c * strength)
}
